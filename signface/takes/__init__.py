"""Recordings of markers: read, named, cleaned, filtered and freed from the head's motion."""
