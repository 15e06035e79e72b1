"""Formats of faces: glTF, folders of OBJ, CANDIDE."""
