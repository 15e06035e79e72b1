"""Segments: weights cut at the peaks of their energies (Reverdy 2019, chapter 4)."""
