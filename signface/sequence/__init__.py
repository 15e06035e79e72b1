"""Sequence models: labels of all frames of a take at once, segments included."""
