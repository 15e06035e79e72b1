"""Variants of the descriptor that a classifier can be trained on, beside the weights as they are.

- `DescriptorVariant`: a choice of features and of a normalisation, as a transformer of takes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from sklearn.base import BaseEstimator, TransformerMixin

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.frames import Means
from signface.head import HEAD_COLUMNS, with_head
from signface.segmentation.energy import bridged
from signface.settings.choices import BY_SIGNER, FEATURES, NORMALISATIONS
from signface.signer_level import SignerLevel, signer_level, signer_middle, signer_range

#: Width of the windows, seconds.
WINDOW_S = 1.0

#: Width of the parabola whose slope is the derivative, seconds (as `signface.segmentation.energy.energies`).
SLOPE_S = 0.23

#: Added to every spread: a base that hardly moves must not be blown up to the size of one that does (weights are 0 at
#: rest and 1 fully active).
LEAST_SPREAD = 0.02


#: Half a signer's range is taken as at least this: weights, and degrees and millimetres of the head.
LEAST_RANGE = 0.05
LEAST_RANGES = {name: 1.0 if name in HEAD_COLUMNS[:3] else 2.0 for name in HEAD_COLUMNS}


class DescriptorVariant(TransformerMixin, BaseEstimator):
    """Takes with the columns that a classifier is to see, as a transformer of scikit-learn.

    It learns nothing from the takes it is fitted on: what it gives for a take depends on that take and, where it
    normalises, on the other takes of the same signer that are given with it.

    Parameters
    ----------
    features : sequence of str
        Names of `signface.settings.choices.FEATURES`, in the order of the columns; `head` adds its columns to those of
        the take, of which the others are made.
    normalise : str
        A name of `signface.settings.choices.NORMALISATIONS`.

    Examples
    --------
    >>> variant = DescriptorVariant(features=("weights", "derivatives"))
    >>> variant.names(("jawOpen",))
    ('jawOpen', 'slope(jawOpen)')
    """

    def __init__(self, features: Sequence[str] = ("weights",), normalise: str = "none") -> None:
        self.features = features
        self.normalise = normalise

    def check(self) -> DescriptorVariant:
        """The variant itself.

        Raises
        ------
        SignfaceError
            A name is unknown, repeated or missing.
        """
        unknown = [name for name in self.features if name not in FEATURES]
        if unknown or not self.features:
            problem = f"there are no features named {unknown[0]}" if unknown else "no features are named"
            raise SignfaceError(problem, hint=f"choose among {', '.join(FEATURES)}")
        if len(set(self.features)) < len(self.features):
            raise SignfaceError(f"features are named twice: {', '.join(self.features)}")
        if self.normalise not in NORMALISATIONS:
            raise SignfaceError(
                f"there is no normalisation named {self.normalise}", hint=f"choose {' or '.join(NORMALISATIONS)}"
            )
        return self

    @property
    def plain(self) -> bool:
        """Whether it leaves takes as they are."""
        return tuple(self.features) == ("weights",) and self.normalise == "none"

    @property
    def by_signer(self) -> bool:
        """Whether it needs the level of the signer."""
        return self.normalise in BY_SIGNER

    def names(self, bases: Sequence[str]) -> tuple[str, ...]:
        """Names of the columns for some bases; with `head`, its columns are like bases."""
        if "head" in self.features:
            bases = (*bases, *HEAD_COLUMNS)
        forms = {"weights": ("{}",), "derivatives": ("slope({})",), "windows": ("mean({})", "deviation({})")}
        return tuple(form.format(base) for name in self._forms for form in forms[name] for base in bases)

    @property
    def _forms(self) -> tuple[str, ...]:
        """The features that are made of columns; the columns as they are where there is only the head."""
        return tuple(name for name in self.features if name != "head") or ("weights",)

    def fit(self, takes: Sequence[Descriptors], y: object = None) -> DescriptorVariant:
        """Nothing is learnt; the names are checked."""
        return self.check()

    def transform(self, takes: Sequence[Descriptors], signers: Sequence[str] | None = None) -> list[Descriptors]:
        """The takes with the columns wanted.

        Parameters
        ----------
        takes : sequence of Descriptors
        signers : sequence of str, optional
            Who signs each; one and the same signer when not given.
        """
        who = [""] * len(takes) if signers is None else list(signers)
        levels: dict[str, SignerLevel | None] = dict.fromkeys(who)
        if self.by_signer:
            levels = {name: signer_level([t for t, w in zip(takes, who, strict=True) if w == name]) for name in levels}
        return [self.of(take, levels[name]) for take, name in zip(takes, who, strict=True)]

    def of(self, take: Descriptors, level: SignerLevel | None = None) -> Descriptors:
        """One take with the columns wanted; `level` is that of the take alone when not given."""
        self.check()
        bases = take.names
        level = signer_level([take]) if self.by_signer and level is None else level
        columns = with_head(take) if "head" in self.features else take
        if level is not None and self.normalise in ("range", "middle"):
            take = _scaled(columns, level, signer_range if self.normalise == "range" else signer_middle)
        elif level is not None and self.normalise == "signer":
            place = [level.names.index(name) for name in take.names]
            scaled = (take.weights - level.mean[place]) / (level.spread[place] + LEAST_SPREAD)
            take = replace(
                columns, weights=np.concatenate([scaled, columns.weights[:, take.weights.shape[1] :]], axis=1)
            )
        else:
            take = columns
        if self._forms == ("weights",):
            return take
        known = np.isfinite(take.weights).all(axis=1)
        smooth = bridged(take) if known.any() else take.weights
        parts: list[np.ndarray] = []
        for name in self._forms:
            if name == "weights":
                parts.append(take.weights)
            elif name == "derivatives":
                parts.append(_slopes(smooth, take.rate))
            else:
                parts += _window_statistics(smooth, take.rate)
        made = np.concatenate(parts, axis=1)
        made[~known] = np.nan
        return replace(take, weights=made, names=self.names(bases))


def _scaled(
    take: Descriptors, level: SignerLevel, judge: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
) -> Descriptors:
    """The take in units of the signer: less the place that `judge` finds in their frames, over the width."""
    frames = level.frames
    if frames is None:
        raise SignfaceError(
            "the level of the signer says nothing of their range",
            hint="it was learnt by an older signface: learn it again with signface corpus signers",
        )
    low, half = judge((with_head(frames) if HEAD_COLUMNS[0] in take.names else frames).on(take.names).weights)
    least = [LEAST_RANGES.get(name, LEAST_RANGE) for name in take.names]
    return replace(take, weights=(take.weights - low) / np.maximum(half, least))


def _slopes(weights: np.ndarray, rate: float) -> np.ndarray:
    """(F, N) rates of change, 1/s, of a parabola fitted in a sliding window; zero for a take of fewer than 3 frames."""
    frames = len(weights)
    window = min(max(3, 2 * round(SLOPE_S * rate / 2) + 1), frames if frames % 2 else frames - 1)
    if window < 3:
        return np.zeros_like(weights)
    from scipy.signal import savgol_filter  # slow to import

    return savgol_filter(weights, window, polyorder=2, deriv=1, delta=1 / rate, axis=0, mode="mirror")


def _window_statistics(weights: np.ndarray, rate: float) -> list[np.ndarray]:
    """Two (F, N): mean and standard deviation over `WINDOW_S` around each frame; the ends of the take are held."""
    time = (np.arange(len(weights)) + 0.5) / rate
    low, high = time - WINDOW_S / 2, time + WINDOW_S / 2
    mean = Means(weights, rate).between(low, high)
    squares = Means(weights**2, rate).between(low, high)
    return [mean, np.sqrt((squares - mean**2).clip(0))]
