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
from signface.signer_level import SignerRest
from signface.solver.adaptation import MorphologicalAdaptation, SimilarityAdaptation
from signface.solver.base import Solution
from signface.solver.creep import Creep
from signface.solver.displacements import Displacements, neutral_places
from signface.solver.layout_fit import check_fit
from signface.solver.resting import resting_time
from signface.takes.cleaning import Kept, Progress, cleaning_stages, silently
from signface.takes.recording import PIECE, Recording
from signface.takes.rigid import apply
from signface.takes.stabilisation import HeadMotion, NeutralAlignment, rigid_transform
from signface.takes.stages import Block, Stage, View, block_of
from signface.takes.take import Take

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
    recording : signface.takes.cleaning.Kept
        Cleaned.
    stages : tuple of Stage
        All that a frame goes through, in this order; see `signface.takes.stages`.
    layout : MarkerLayout
        The given layout without the markers that the neutral frame does not show; displacements follow it.
    adaptation : SimilarityAdaptation or MorphologicalAdaptation
        From the signer's face, in its neutral pose, to the avatar's.
    neutral_s : float
        Time of the neutral frame; NaN where the signer's rest stands for it.
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
        cleaning = _cleaning(layout, settings, face)
        # What lies in one piece is read once: the check of markers goes over it to learn.
        source = Kept(recording) if recording.n_frames <= piece else recording
        self.recording = clean = Kept(View(source).through(*cleaning).recording)
        labels = [label for label in layout.face_labels if label in clean.labels]
        head = [label for label in layout.head_labels if label in clean.labels]
        if len(labels) < 4:
            raise SignfaceError(
                f"has {len(labels)} of the face markers of the layout {layout.name}, and at least 4 are needed",
                file=clean.name,
                hint="use a layout with more of its face markers",
            )
        rest = None if signer is None or settings.neutral != "auto" else signer.rest
        if settings.neutral != "auto":
            clean.frame_at(float(settings.neutral))
        glance = clean.glance(VIEW_FRAMES, piece=piece, progress=progress)
        time, seen, places = self._neutral(glance, face, layout, labels, settings, rest)
        self.neutral_s = time
        target = layout.points(face, seen)
        try:
            check_fit(places, target, layout.name, seen)
        except SignfaceError as error:
            raise error.at(clean.name) from error
        self.layout = layout.restricted([*seen, *head])
        bases = None if signer is None else signer.bases
        self.signer_bases = None if bases is None else bases.at(face, self.layout)
        view = View(clean, Block(glance.positions, range(clean.n_frames)[:: round(clean.rate / glance.rate)]))
        aligned = known = None
        if rest is not None:
            onto = rigid_transform(places, target)[None]
            known = dict(zip(rest.labels, apply(onto, rest.places[None])[0], strict=True))
            aligned = np.array([known[label] for label in seen])
        alignment = NeutralAlignment(seen, target, time, rest=None if rest is None else places)
        motion = HeadMotion(head, neutral_s=time, fallback=settings.head_fallback, rest=known)
        still = view.through(alignment, motion)
        displacements = Displacements(seen, face, layout, kind=settings.adaptation, neutral_s=time, rest=aligned)
        creep: list[Stage] = []
        # Landmarks do not creep on the skin. What stays the same through a short take of them is what the face does.
        if settings.takes_creep_away and not layout.of_landmarks:
            creep = [Creep(face, self.layout, signer_bases=self.signer_bases)]
        self._still = still.recording
        self._prepared = still.through(displacements, *creep).recording
        self.stages = (*cleaning, alignment, motion, displacements, *creep)
        self.adaptation = displacements.adaptation
        how = "found" if settings.neutral == "auto" else "given"
        notes = [
            f"neutral frame {how} at {time:.3f} s" if rest is None else f"rest of the signer over {rest.takes} takes"
        ]
        notes += [displacements.note]
        notes += [] if bases is None else [f"bases of the signer in {Path(bases.source).name}"]
        self.note = "; ".join([*notes, *(stage.note for stage in creep)])

    def _neutral(
        self,
        glance: Take,
        face: FaceModel,
        layout: MarkerLayout,
        labels: list[str],
        settings: SolveSettings,
        rest: SignerRest | None,
    ) -> tuple[float, tuple[str, ...], np.ndarray]:
        """Time of the neutral frame, and which markers are where in it; the signer's rest, where that is known."""
        if rest is not None:
            shown = np.isfinite(glance.positions[..., 0]).any(axis=0)
            seen, places = rest.of([label for label in labels if shown[glance.labels.index(label)]])
            if len(seen) < 4:
                raise SignfaceError(
                    f"the signer's rest knows {len(seen)} of the face markers of the layout {layout.name}",
                    file=glance.name,
                    hint="learn the signer anew from takes with these markers: signface corpus signers",
                )
            return float("nan"), seen, places
        if settings.neutral == "auto":
            time = resting_time(glance, face, layout, adaptation=settings.adaptation)
        else:
            time = float(settings.neutral)
        seen, places = neutral_places(self.recording, labels, time)
        if len(seen) < 4:
            raise SignfaceError(
                f"only {len(seen)} face markers are seen at the neutral time {time:.3f} s",
                file=glance.name,
                hint="give another neutral time: --neutral SECONDS",
            )
        return time, seen, places

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
        block = block_of(self._prepared, begin, end)
        assert block.head is not None
        return block.positions, block.head

    @property
    def history(self) -> tuple[str, ...]:
        """What was done to the recording until now, without `note`."""
        return self._still.history


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


def _cleaning(layout: MarkerLayout, settings: SolveSettings, face: FaceModel) -> tuple[Stage, ...]:
    """The stages that give the layout's markers in their right places, without gaps and jitter."""
    known = dict(zip(layout.labels, layout.points(face, layout.labels), strict=True))
    given = {name: getattr(settings, name) for name in ("short_gap_s", "long_gap_s", "cutoff_hz", "filter_method")}
    chosen = {name: value for name, value in given.items() if value is not None}
    return cleaning_stages(layout.labels, check=settings.check_markers, known=known, **chosen)
