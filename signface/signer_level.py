"""Where a signer's face rests and how far it moves, from all of their takes, without any label.

- `SignerRest`: places of the landmarks of the resting face.
- `SignerLevel`, `signer_level`: where the weights lie, how far they go, and some frames by which any signal is judged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from signface.content import Content
from signface.errors import SignfaceError

if TYPE_CHECKING:
    from signface.descriptors import Descriptors

#: Frames that a level keeps of all takes, evenly spaced.
SAMPLE = 600
#: The ends of a signer's range, percentiles. Not the least and the greatest, which are blinks, sneezes and lost tracks.
RANGE = (5.0, 95.0)
#: The ends of the middle two thirds, which are as far from the middle as a standard deviation of a Gaussian.
MIDDLE = (16.0, 84.0)


@dataclass(frozen=True, eq=False)
class SignerRest(Content):
    """Where the landmarks of a signer's resting face are: their median over all takes, the head's motion taken away.

    A take of one sentence may begin and end within a raise of the brows, so that none of its frames is at rest; all
    takes of a signer know better. Only for landmarks that a tracker puts on the same places of a face each time:
    markers that are glued on anew are elsewhere.

    Parameters
    ----------
    labels : (M,) tuple of str
    places : (M, 3) array
        Millimetres.
    takes : int
        From how many.
    """

    labels: tuple[str, ...]
    places: np.ndarray
    takes: int = 1

    def __post_init__(self) -> None:
        places = np.array(self.places, dtype=np.float64)
        if places.shape != (len(self.labels), 3) or not np.isfinite(places).all():
            raise SignfaceError(f"places of {places.shape} do not match {len(self.labels)} landmarks of a resting face")
        self._hold(places=places)

    def of(self, labels: Sequence[str]) -> tuple[tuple[str, ...], np.ndarray]:
        """Those of some landmarks that are known, and their (K, 3) places."""
        known = tuple(label for label in labels if label in self.labels)
        return known, self.places[[self.labels.index(label) for label in known]].reshape(-1, 3)

    def plain(self) -> dict[str, Any]:
        """As plain values, for JSON."""
        return {"labels": list(self.labels), "places": self.places.tolist(), "takes": self.takes}

    @classmethod
    def from_plain(cls, content: Mapping[str, Any]) -> SignerRest:
        """What `plain` gave."""
        places = np.array(content["places"], dtype=np.float64).reshape(-1, 3)
        return cls(tuple(map(str, content["labels"])), places, int(content["takes"]))


@dataclass(frozen=True, eq=False)
class SignerLevel(Content):
    """How a signer's weights lie, whatever is expressed.

    Parameters
    ----------
    names : (N,) tuple of str
        The bases.
    mean, spread : (N,) arrays
        Mean and standard deviation of the weight of each base over all frames.
    solve : mapping
        The `SolveSettings` of the takes, as plain values; empty where they are not known or differ.
    sample : (S, N) array, optional
        Weights of some frames, evenly spaced over all takes.
    head : (S, 4, 4) array, optional
        The head's poses in these frames.
    """

    names: tuple[str, ...]
    mean: np.ndarray
    spread: np.ndarray
    solve: Mapping[str, Any] = field(default_factory=dict)
    sample: np.ndarray | None = None
    head: np.ndarray | None = None

    @property
    def frames(self) -> Descriptors | None:
        """The frames of the sample as a take, by which any signal of weights and head is judged; None where unknown."""
        if self.sample is None:
            return None
        from signface.descriptors import Descriptors

        return Descriptors(self.sample, self.names, rate=1.0, head=self.head, name="level")

    def on(self, names: Sequence[str]) -> SignerLevel:
        """The level of these columns only, in this order.

        Raises
        ------
        ValueError
            It does not know one of them.
        """
        place = [self.names.index(name) for name in names]
        sample = None if self.sample is None else self.sample[:, place]
        return SignerLevel(tuple(names), self.mean[place], self.spread[place], self.solve, sample, self.head)

    def plain(self) -> dict[str, Any]:
        """As plain values, for JSON."""
        content: dict[str, Any] = {
            "names": list(self.names),
            "mean": self.mean.tolist(),
            "spread": self.spread.tolist(),
            "solve": dict(self.solve),
        }
        if self.sample is not None:
            content["sample"] = self.sample.tolist()
        if self.head is not None:
            content["head"] = self.head[:, :3].reshape(-1, 12).tolist()
        return content

    @classmethod
    def from_plain(cls, content: Mapping[str, Any]) -> SignerLevel:
        """What `plain` gave.

        Raises
        ------
        ValueError
            The numbers do not match the names.
        """
        names = tuple(str(name) for name in content["names"])
        mean, spread = (np.array(content[key], dtype=np.float64) for key in ("mean", "spread"))
        if mean.shape != (len(names),) or spread.shape != mean.shape or not np.isfinite([mean, spread]).all():
            raise ValueError("the level does not match its names")
        sample = head = None
        if "sample" in content:
            sample = np.array(content["sample"], dtype=np.float64).reshape(-1, len(names))
        if "head" in content:
            head = np.tile(np.eye(4), (len(content["head"]), 1, 1))
            head[:, :3] = np.array(content["head"], dtype=np.float64).reshape(-1, 3, 4)
        return cls(names, mean, spread, dict(content.get("solve") or {}), sample, head)


def signer_range(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The low end of a signal's range over a signer's frames, and half its width: the fifth and 95th percentile.

    The low end, and not the middle, is where a face rests: signers hold raised brows for a third of the time and more.

    Parameters
    ----------
    values : (S, ...) array
        NaN is passed over.

    Returns
    -------
    low, half : arrays without the first axis

    Examples
    --------
    >>> low, half = signer_range(np.arange(101.0))
    >>> float(low), float(half)
    (5.0, 45.0)
    """
    low, high = np.nanpercentile(values, RANGE, axis=0)
    return low, (high - low) / 2


def signer_middle(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The median of a signal over a signer's frames, and half the span of its middle two thirds.

    Parameters and shapes are those of `signer_range`.

    Examples
    --------
    >>> middle, half = signer_middle(np.arange(101.0))
    >>> float(middle), float(half)
    (50.0, 34.0)
    """
    low, middle, high = np.nanpercentile(values, (MIDDLE[0], 50.0, MIDDLE[1]), axis=0)
    return middle, (high - low) / 2


def signer_level(takes: Sequence[Descriptors]) -> SignerLevel:
    """Mean and spread of the weights of a signer over some takes, and some frames; every frame counts the same time.

    No label is looked at, so that takes that are to be labelled can be used.

    Raises
    ------
    SignfaceError
        There is no take, none has a frame with weights, or they have other bases.
    """
    if not takes:
        raise SignfaceError("there is no take of the signer to normalise by")
    names = takes[0].names
    seconds, total, squares = 0.0, np.zeros(len(names)), np.zeros(len(names))
    for take in takes:
        if set(take.names) != set(names):
            raise SignfaceError(f"{take.name} was solved with other bases than {takes[0].name}")
        weights = take.on(names).weights
        weights = weights[np.isfinite(weights).all(axis=1)]
        seconds += len(weights) / take.rate
        total += weights.sum(axis=0) / take.rate
        squares += (weights**2).sum(axis=0) / take.rate
    if not seconds:
        raise SignfaceError(f"{takes[0].name}: no frame has weights", hint="look at the markers: signface take info")
    mean = total / seconds
    solves = [{} if take.settings is None else take.settings.as_dict() for take in takes]
    alike = all(not take.settings.differences(solves[0]) for take in takes if take.settings is not None)
    spread = np.sqrt((squares / seconds - mean**2).clip(0))
    return SignerLevel(names, mean, spread, solves[0] if alike else {}, *_sample(takes, names, seconds))


def _sample(
    takes: Sequence[Descriptors], names: tuple[str, ...], seconds: float
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """(S, N) weights and (S, 4, 4) poses of frames that are evenly spaced over all takes, of which all is known."""
    step, passed = seconds / SAMPLE, 0.0
    weights, heads = [], []
    for take in takes:
        assert take.head is not None
        values = take.on(names).weights
        known = np.flatnonzero(np.isfinite(values).all(axis=1) & np.isfinite(take.head).all(axis=(1, 2)))
        times = passed + (np.arange(len(known)) + 0.5) / take.rate
        first = np.diff(np.floor(times / step), prepend=np.floor(passed / step)) > 0
        passed += len(known) / take.rate
        weights.append(values[known[first]])
        heads.append(take.head[known[first]])
    if not sum(map(len, weights)):
        return None, None
    return np.round(np.concatenate(weights), 4), np.round(np.concatenate(heads), 5)
