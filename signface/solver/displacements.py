"""From markers without head motion to displacements on the avatar: what the solver is given.

- `Displacements`: the stage that carries the face markers over.
- `neutral_places`: where markers are in a neutral frame.
- `steady_places`: the same over as long as the face keeps still, where they jitter.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.solver.adaptation import make_adaptation
from signface.takes.recording import Recording
from signface.takes.stages import Block, Stage, View
from signface.takes.take import columns_of

#: The neutral place of a marker is its median within this time of the neutral frame (s): one frame's jitter would
#: otherwise be carried into every frame of the take.
NEUTRAL_WINDOW_S = 0.05
#: Where jitter leaves more than this of their mean in that window (mm, by coordinate), a longer rest is looked for.
STEADY_MM = 0.3
#: Times around the neutral frame over which places may be averaged (s), and after which jitter is forgotten: what is
#: filtered at 12 Hz is alike for about so long.
LONGER_S, FORGOTTEN_S = (0.1, 0.2, 0.35, 0.5, 0.75), 0.05
#: Two means are of one rest when they differ by no more than this many times their variance by jitter.
SAME_REST = 2.0


class Displacements(Stage):
    """Displacements of the face markers from their neutral places (eq. 5.21), adapted to the avatar (eq. 5.18 to 5.20).

    It stands behind `signface.takes.stabilisation.HeadMotion`, and gives blocks whose positions are displacements.

    Parameters
    ----------
    labels : sequence of str
        Face markers of the layout that the neutral frame shows.
    face : FaceModel
    layout : MarkerLayout
    kind : str
        See `signface.solver.adaptation.make_adaptation`.
    neutral_s : float
        Time of the neutral frame in seconds.
    rest : (P, 3) array, optional
        In its place: where the markers are on the signer's resting face, as the recording is aligned.

    Attributes
    ----------
    adaptation : SimilarityAdaptation or MorphologicalAdaptation
        From the signer's face, in its neutral pose, to the avatar's; once it has learnt.

    Raises
    ------
    SignfaceError
        The neutral markers do not allow an adaptation, or there is none of that name; when it learns.
    """

    def __init__(
        self,
        labels: Sequence[str],
        face: FaceModel,
        layout: MarkerLayout,
        *,
        kind: str,
        neutral_s: float,
        rest: np.ndarray | None = None,
    ) -> None:
        self._labels, self._face, self._layout = tuple(labels), face, layout
        self._kind, self._neutral_s, self._rest_places = kind, neutral_s, rest

    def learn(self, view: View) -> None:
        """The adaptation, from the neutral places of the markers."""
        self._columns = columns_of(view.recording, self._labels)
        places = self._rest_places
        if places is None:
            places = steady_places(view.recording, self._labels, self._neutral_s)
        self.adaptation = make_adaptation(self._kind, places, self._layout.points(self._face, self._labels))
        # Against the adapted neutral, not the avatar's: where the map passes by the markers, rest must still be rest.
        self._rest = self.adaptation.transform(places)

    def labels_of(self, labels: tuple[str, ...]) -> tuple[str, ...]:
        """The face markers."""
        return self._labels

    def apply(self, block: Block) -> Block:
        """The block's displacements, millimetres on the avatar."""
        return block.changed(self.adaptation.transform(block.positions[:, self._columns]) - self._rest)

    @property
    def note(self) -> str:
        """To which face, how, and by which markers."""
        dropped = [label for label in self._layout.face_labels if label not in self._labels]
        without = f" without {', '.join(dropped[:5])}{' ...' * (len(dropped) > 5)}" if dropped else ""
        by = f"by {len(self._labels)} markers of {self._layout.name}"
        return f"adapted to {self._face.name} ({self.adaptation.description}) {by}{without}"


def neutral_places(recording: Recording, labels: Sequence[str], neutral_s: float) -> tuple[tuple[str, ...], np.ndarray]:
    """The markers of `labels` that are seen around a neutral frame, and their median places there.

    Returns
    -------
    (tuple of str, (K, 3) array)
        Labels in the order given, and places in millimetres.

    Raises
    ------
    SignfaceError
        The time is outside the recording.

    Examples
    --------
    >>> import signface as sf
    >>> seen, places = neutral_places(sf.datasets.mini_take(), ["LBROI", "RBROI"], neutral_s=0.1)
    >>> seen, places.shape
    (('LBROI', 'RBROI'), (2, 3))
    """
    frame, half = recording.frame_at(neutral_s), int(NEUTRAL_WINDOW_S * recording.rate)
    window = recording.frames(max(0, frame - half), min(recording.n_frames, frame + half + 1))
    window = window[:, columns_of(recording, labels)]
    seen = np.isfinite(window[..., 0]).any(axis=0)
    return tuple(label for label, here in zip(labels, seen) if here), np.nanmedian(window[:, seen], axis=0)


def steady_places(recording: Recording, labels: Sequence[str], neutral_s: float) -> np.ndarray:
    """Places of markers around a neutral frame, averaged over a longer rest where they jitter.

    What jitter leaves in the neutral places is carried into every frame as an expression that is not there: landmarks
    of a film that jitter by 2 mm are still 1 mm off in the median of a tenth of a second. Means over longer and longer
    times are tried, and the longest is taken from which none of the shorter ones differs by more than the jitter
    explains: a window that reaches into a movement gives itself away (the rule of O. Lepski, 1990).

    Parameters
    ----------
    recording : Recording
        Without head motion.
    labels : sequence of str
        Markers that are seen around the neutral frame, at least within `NEUTRAL_WINDOW_S` of it.
    neutral_s : float

    Returns
    -------
    (K, 3) array
        Millimetres; those of `neutral_places` where jitter is small.

    Examples
    --------
    >>> import signface as sf
    >>> take = sf.datasets.mini_take()
    >>> steady_places(take, ["LBROI", "RBROI"], neutral_s=0.1).shape
    (2, 3)
    """
    _, places = neutral_places(recording, labels, neutral_s)
    frame, reach = recording.frame_at(neutral_s), int(LONGER_S[-1] * recording.rate)
    first = max(0, frame - reach)
    window = recording.frames(first, min(recording.n_frames, frame + reach + 1))[:, columns_of(recording, labels)]
    lag = max(1, round(2 * FORGOTTEN_S * recording.rate))
    if len(window) < 3 * lag:
        return places
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # markers that are not seen for a while
        changes = np.nanmean((window[lag:] - window[:-lag]) ** 2, axis=(1, 2)) / 2
        # A quarter of the time is rest: over many markers, the mean square of jitter hardly differs between frames.
        variance = float(np.nanquantile(changes, 0.25)) if np.isfinite(changes).any() else 0.0
        spread = variance * FORGOTTEN_S / (2 * NEUTRAL_WINDOW_S)
        if not spread > STEADY_MM**2:
            return places
        kept = [(places, spread)]
        for longer in LONGER_S:
            half = int(longer * recording.rate)
            mean = np.nanmean(window[max(0, frame - first - half) : frame - first + half + 1], axis=0)
            if any(np.nanmean((mean - other) ** 2) > SAME_REST * least for other, least in kept):
                break
            kept.append((mean, variance * FORGOTTEN_S / (2 * longer)))
    return kept[-1][0]
