"""Corpora: their manifest, what is solved of them kept on disk, and runs over all takes."""
