"""The films that a perceptual study shows."""
