"""Segmentation and classifiers measured on a corpus: who is trained on, who is tested, and what comes of it."""
