"""The statistics of a perceptual study."""
