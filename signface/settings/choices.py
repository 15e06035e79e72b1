"""What there is to choose from where a classifier is trained; names, which cost nothing to import.

- `FEATURES`, `NORMALISATIONS`: what it sees of a take (`signface.label.variants`).
- `AGGREGATES`: how a segment gets its label (`signface.label.labelling`).
- `NAMES`, `SEQUENCE_NAMES`: the classifiers (`signface.label.labellers`, `signface.sequence`).
"""

from __future__ import annotations

#: name: what it is.
FEATURES = {
    "weights": "the weights",
    "derivatives": "how fast each weight changes, 1/s",
    "windows": "mean and standard deviation of each weight over the second around the frame",
    "head": "the head's angles and place beside the weights",
}

#: name: what it is.
NORMALISATIONS = {
    "none": "weights as they are",
    "signer": "weights less the signer's mean, over their spread",
    "range": "weights less the low end of the signer's range, over half of it",
    "middle": "weights less the signer's median, over half the span of their middle two thirds",
}

#: Those that need the level of the signer.
BY_SIGNER = ("signer", "range", "middle")

#: How a segment gets its label. name: what it is.
AGGREGATES = {
    "mean": "the label of the segment's mean descriptor (thesis, eq. 4.6)",
    "frames": "the label with the highest mean log probability over the segment's frames",
    "course": "the label of how each column runs through the segment; learnt from whole segments",
}

#: Classifiers of frames. name: what it is.
NAMES = {
    "knn1": "the nearest training frame",
    "knn3": "the three nearest training frames",
    "svm-linear": "support vector machine, linear kernel",
    "svm-rbf": "support vector machine, Gaussian kernel",
    "forest": "random forest",
    "extra-trees": "extremely randomised trees",
}

#: Sequence models, which find boundaries and labels at once. name: what it is.
SEQUENCE_NAMES = {
    "net-hsmm": "neural network on frames, decoded by a hidden semi-Markov model",
    "forest-viterbi": "random forest on frames, decoded by Viterbi's algorithm through a transition state",
    "hmm": "hidden Markov model with Gaussian frames",
    "crf": "linear-chain conditional random field",
    "gru": "recurrent network, decoded by a hidden semi-Markov model",
    "boosting": "gradient-boosted trees on frames in their sentence, decoded by Viterbi's algorithm",
}
