"""Channels beside the affect: brows, eyes, mouth, cheeks, nose by rules on weights, and the head by its angles."""
