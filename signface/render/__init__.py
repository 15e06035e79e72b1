"""Pictures and films of faces, without a display."""
