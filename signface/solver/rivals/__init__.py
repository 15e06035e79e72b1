"""Other ways to solve, to compare with."""
