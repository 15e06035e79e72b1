"""What a recording needs to be brought to the avatar, found once; then any of its frames are.

- `Preparation`: neutral frame, alignment, head motion and adaptation of a recording; its `frames`, ready to be solved.
- `PreparedTake`, `prepare_take`: all frames at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from signface.content import Content
from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.face.layout import MarkerLayout
from signface.face.model import FaceModel
from signface.settings.solve import SolveSettings
from signface.signer import Signer
from signface.solver.adaptation import MorphologicalAdaptation, SimilarityAdaptation, make_adaptation
from signface.solver.base import Solution
from signface.solver.creep import RATE_HZ, Creep
from signface.solver.resting import resting_time
from signface.takes.cleaning import CleanRecording, Progress, silently
from signface.takes.filtering import CUTOFF_HZ
from signface.takes.gaps import LONG_S, SHORT_S
from signface.takes.recording import PIECE, Recording
from signface.takes.rigid import apply, inverse
from signface.takes.stabilisation import SAMPLE_FRAMES, HeadMotion, neutral_alignment

#: The neutral place of a marker is its median within this time of the neutral frame (s): one frame's jitter would
#: otherwise be carried into every frame of the take.
NEUTRAL_WINDOW_S = 0.05

#: The neutral frame is looked for among all frames of takes up to this length (five minutes at 200 Hz), and among so
#: many evenly spaced ones of longer takes.
VIEW_FRAMES = 60000


class Preparation:
    """How a recording is brought to the avatar (Reverdy 2019, 5.2.1 and 5.2.2).

    What holds for the whole recording is found when this is made, for which the recording is gone through once, in
    pieces; `frames` then works on the frames asked for.

    Parameters
    ----------
    recording, face, layout, settings, signer
        As for `signface.solver.solving.solve`.
    piece : int
        Frames worked on at a time.
    progress : callable, optional
        See `signface.takes.cleaning.Progress`.

    Attributes
    ----------
    recording : CleanRecording
    layout : MarkerLayout
        The given layout without the markers that the neutral frame does not show; displacements follow it.
    adaptation : SimilarityAdaptation or MorphologicalAdaptation
        From the signer's face, in its neutral pose, to the avatar's.
    neutral_s : float
        Time of the neutral frame.
    signer_bases : (N, P, 3) array or None
        The signer's bases at the layout's markers; None where the avatar's serve.
    note : str
        What was done, for the history.

    Raises
    ------
    SignfaceError
        As `signface.solver.solving.solve`.
    """

    def __init__(
        self,
        recording: Recording,
        face: FaceModel,
        layout: MarkerLayout,
        *,
        settings: SolveSettings | None = None,
        signer: Signer | None = None,
        piece: int = PIECE,
        progress: Progress = silently,
    ) -> None:
        settings = SolveSettings() if settings is None else settings
        clean = CleanRecording(
            recording,
            layout.labels,
            short_gap_s=SHORT_S if settings.short_gap_s is None else settings.short_gap_s,
            long_gap_s=LONG_S if settings.long_gap_s is None else settings.long_gap_s,
            cutoff_hz=CUTOFF_HZ if settings.cutoff_hz is None else settings.cutoff_hz,
            filter_method=settings.filter_method,
        )
        self.recording = clean
        labels = [label for label in layout.face_labels if label in clean.labels]
        head = [label for label in layout.head_labels if label in clean.labels]
        if len(labels) < 4:
            raise SignfaceError(
                f"has {len(labels)} of the face markers of the layout {layout.name}, and at least 4 are needed",
                file=clean.name,
                hint="use a layout with more of its face markers",
            )
        if settings.neutral != "auto":
            clean.frame_at(float(settings.neutral))
        view = clean.view(VIEW_FRAMES, piece=piece, progress=progress)
        if settings.neutral == "auto":
            time, how = resting_time(view, face, layout, adaptation=settings.adaptation), "found"
        else:
            time, how = float(settings.neutral), "given"
        self.neutral_s, frame = time, clean.frame_at(time)
        around = self._around(frame)
        shown, _ = _median_places(clean.frames(*around), labels, clean.labels)
        if len(shown) < 4:
            raise SignfaceError(
                f"only {len(shown)} face markers are seen at the neutral time {time:.3f} s",
                file=clean.name,
                hint="give another neutral time: --neutral SECONDS",
            )
        self.layout = layout.restricted([*shown, *head])
        self._columns = [clean.labels.index(label) for label in shown]
        target = self.layout.points(face, shown)
        neutral_frame = clean.frames(frame, frame + 1)[0]
        self._onto = neutral_alignment(neutral_frame[self._columns], target, clean.name, time)
        self._aligned_note = f"align_neutral {len(shown)} markers at {time:.3f} s"
        sample = view.positions[:: max(1, view.n_frames // SAMPLE_FRAMES)]
        self._head = HeadMotion(
            clean.labels,
            apply(self._onto, neutral_frame),
            apply(self._onto, sample),
            clean.rate,
            head=head,
            fallback=settings.head_fallback,
            name=clean.name,
            neutral_s=time,
        )
        still, _ = self._still(*around)
        _, places = _median_places(still, shown, shown)
        self.adaptation = make_adaptation(settings.adaptation, places, target)
        self._rest = self.adaptation.transform(places)
        dropped = [label for label in layout.face_labels if label not in shown]
        self.note = f"neutral frame {how} at {time:.3f} s; adapted to {face.name}"
        self.note += f" ({self.adaptation.description}) by {len(shown)} markers of {layout.name}"
        self.note += f" without {', '.join(dropped[:5])}{' ...' * (len(dropped) > 5)}" if dropped else ""
        bases = None if signer is None else signer.bases
        self.signer_bases = None if bases is None else bases.at(face, self.layout)
        self.note += "" if bases is None else f"; bases of the signer in {Path(bases.source).name}"
        self._creep: Creep | None = None
        if settings.takes_creep_away:
            step = max(1, round(view.rate / RATE_HZ))
            rate = view.rate / step
            self._creep = Creep(
                self._moved(view.positions[::step]), rate, face, self.layout, signer_bases=self.signer_bases
            )
            self._creep_step = rate / clean.rate
            self.note += f"; creep of {self._creep.size_mm:.2f} mm taken away"

    def _around(self, frame: int) -> tuple[int, int]:
        """First frame, and frame after the last, of the window that neutral places are medians of."""
        half = int(NEUTRAL_WINDOW_S * self.recording.rate)
        return max(0, frame - half), min(self.recording.n_frames, frame + half + 1)

    def _still(self, begin: int, end: int, *, noted: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """(F, P, 3) face markers without head motion, in the neutral frame's place, and the (F, 4, 4) head poses."""
        first = max(0, begin - self._head.reach)
        last = min(self.recording.n_frames, end + self._head.reach)
        own = slice(begin - first, end - first)
        aligned = apply(self._onto, self.recording.frames(first, last))
        poses = self._head.poses(aligned, own if noted else slice(0))[own]
        return apply(inverse(poses), aligned[own][:, self._columns]), poses

    def _moved(self, positions: np.ndarray) -> np.ndarray:
        """(F, P, 3) displacements on the avatar in (F, M, 3) single frames, NaN where the head is not seen."""
        aligned = apply(self._onto, positions)
        poses = self._head.poses(aligned, slice(0))
        seen = np.isfinite(aligned[:, [self.recording.labels.index(label) for label in self._head.labels], 0])
        poses[seen.sum(axis=1) < 3] = np.nan  # a pose bridged between frames so far apart says nothing
        return self.adaptation.transform(apply(inverse(poses), aligned[:, self._columns])) - self._rest

    def frames(self, begin: int, end: int) -> tuple[np.ndarray, np.ndarray]:
        """Frames of the recording, ready to be solved.

        Returns
        -------
        displacements : (F, P, 3) array
            Displacements of the face markers from their neutral places (eq. 5.21), adapted to the avatar,
            millimetres; NaN where a marker is missing.
        head : (F, 4, 4) array
            Poses of the head.
        """
        still, poses = self._still(begin, end, noted=True)
        # Against the adapted neutral, not the avatar's: where the map passes by the markers, rest must still be rest.
        displacements = self.adaptation.transform(still) - self._rest
        if self._creep is not None:
            displacements -= self._creep.at(np.arange(begin, end) * self._creep_step)
        return displacements, poses

    @property
    def history(self) -> tuple[str, ...]:
        """What was done to the recording until now, without `note`."""
        return (*self.recording.history, self._aligned_note, self._head.note)


@dataclass(frozen=True, eq=False)
class PreparedTake(Content):
    """A take brought to the avatar, ready to be solved.

    Parameters
    ----------
    displacements, head : (F, P, 3) and (F, 4, 4) arrays
        What `Preparation.frames` gives, of all frames.
    preparation : Preparation
    """

    displacements: np.ndarray
    head: np.ndarray
    preparation: Preparation

    @property
    def layout(self) -> MarkerLayout:
        """The layout that `displacements` follows."""
        return self.preparation.layout

    @property
    def adaptation(self) -> SimilarityAdaptation | MorphologicalAdaptation:
        """From the signer's face to the avatar's."""
        return self.preparation.adaptation

    @property
    def note(self) -> str:
        """What was done, for the history."""
        return self.preparation.note

    def described(self, face: FaceModel, solution: Solution, *notes: str) -> Descriptors:
        """The descriptors of the take, from what a solver made of its displacements; `notes` end the history."""
        recording = self.preparation.recording
        return Descriptors(
            weights=solution.weights,
            names=face.names,
            rate=recording.rate,
            start=recording.start,
            residual=solution.residual,
            head=self.head,
            name=recording.name,
            history=(*self.preparation.history, *notes),
        )


def prepare_take(
    recording: Recording,
    face: FaceModel,
    layout: MarkerLayout,
    *,
    settings: SolveSettings | None = None,
    signer: Signer | None = None,
) -> PreparedTake:
    """Clean a take, take the head's motion away and adapt it to the avatar (Reverdy 2019, 5.2.1 and 5.2.2).

    Parameters and errors are those of `Preparation`.
    """
    preparation = Preparation(recording, face, layout, settings=settings, signer=signer)
    return PreparedTake(*preparation.frames(0, recording.n_frames), preparation)


def _median_places(
    window: np.ndarray, labels: list[str], among: list[str] | tuple[str, ...]
) -> tuple[list[str], np.ndarray]:
    """The markers of `labels` that a window of frames of the markers `among` shows, and their median places.

    Returns
    -------
    (list of str, (K, 3) array)
        Labels in the order given, and places in millimetres.
    """
    own = window[:, [among.index(label) for label in labels]]
    seen = np.isfinite(own[..., 0]).any(axis=0)
    return [label for label, here in zip(labels, seen, strict=True) if here], np.nanmedian(own[:, seen], axis=0)
