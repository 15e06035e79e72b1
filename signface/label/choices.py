"""What there is to choose from where a classifier is trained; names, which cost nothing to import.

- `FEATURES`, `NORMALISATIONS`: what it sees of a take (`signface.label.variants`).
- `AGGREGATES`: how a segment gets its label (`signface.label.labelling`).

The classifiers themselves are named in `signface.label.labellers`.
"""

from __future__ import annotations

#: name: what it is.
FEATURES = {
    "weights": "the weights",
    "derivatives": "how fast each weight changes, 1/s",
    "windows": "mean and standard deviation of each weight over the second around the frame",
}

#: name: what it is.
NORMALISATIONS = {
    "none": "weights as they are",
    "signer": "weights less the signer's mean, over their spread",
}

#: How a segment gets its label. name: what it is.
AGGREGATES = {
    "mean": "the label of the segment's mean descriptor (thesis, eq. 4.6)",
    "frames": "the label with the highest mean log probability over the segment's frames",
}
