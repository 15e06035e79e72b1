"""Figures and pages: what was found and measured, to look at."""
