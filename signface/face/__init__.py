"""Faces: meshes with bases, marker layouts on them, and the operators of the skin."""
