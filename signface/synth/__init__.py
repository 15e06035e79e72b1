"""Signers who do not exist: heads, expressions, motion and markers of synthetic corpora."""
