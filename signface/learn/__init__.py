"""Training: examples, settings, tuning and calibration of the classifiers."""
