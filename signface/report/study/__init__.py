"""The report of a perceptual study."""
