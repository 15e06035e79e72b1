"""Annotate the faces of signers: recordings in, ELAN tiers out."""
