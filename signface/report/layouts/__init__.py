"""The report of a study of marker layouts."""
