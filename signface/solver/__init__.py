"""The solver: markers to weights, by a thin shell (Reverdy 2019, chapter 5)."""
