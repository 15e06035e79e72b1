"""Labels of segments: trained models, on disk and at work."""
