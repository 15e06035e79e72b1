"""Measures on plain tables: segmentation, classification, agreement."""
