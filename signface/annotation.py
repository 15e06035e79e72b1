"""The main job as one function: a recording in, everything that is found in it out.

- `annotate`: recording to `Annotation`.
- `Annotation`: descriptors, labelled segments, channels, curves, and what found them.

The steps themselves live in their rooms; this module only puts them in a row. `signface.elan.writing.write_eaf` writes
an annotation for ELAN.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from signface.columns import joined_sides
from signface.content import Content
from signface.descriptors import Descriptors
from signface.errors import counted
from signface.signer import Signer
from signface.trust import Stretch, untrusted, worst

if TYPE_CHECKING:
    import pandas as pd
    from pympi.Elan import Eaf

    from signface.channels.events import ChannelEvents
    from signface.face.layout import MarkerLayout
    from signface.face.model import FaceModel
    from signface.label.model import Card, TrainedModel
    from signface.label.vocabulary import Vocabulary
    from signface.segmentation.noise import Jitter
    from signface.segmentation.segments import Segments
    from signface.settings.eaf import EafOptions
    from signface.settings.solve import SolveSettings
    from signface.takes.recording import Recording


@dataclass(frozen=True, eq=False)
class Clause(Content):
    """What one more model found in a take: questions, negation, raised brows, whatever it was trained on.

    Parameters
    ----------
    tier : str
        `clause`, or the tier that the model was trained on.
    segments : Segments
        Labelled, with confidence; what the model calls blank is not among them.
    vocabulary : Vocabulary
        What the labels stand for.
    model : str
        Its name.
    """

    tier: str
    segments: Segments
    vocabulary: Vocabulary
    model: str


def find_clause(
    recording: Recording | Descriptors,
    model: TrainedModel,
    *,
    signer: Signer | None = None,
    settings: SolveSettings | None = None,
) -> Clause:
    """The segments that a model finds in a recording, which is solved as the model's own takes were.

    Parameters
    ----------
    recording : Take, TakeFile or Descriptors
        Descriptors are taken as they are. For a model of action units, read them as such:
        `signface.open_recording(path, read_as="aus")`.
    model : TrainedModel
        Of any tier.
    signer : Signer, optional
        Whose level is used where it is of the model's columns.
    settings : SolveSettings, optional
        Whose markers, from when to when and where in the film: only that counts of them
        (`signface.settings.solve.OF_THE_TAKE`), and only for a recording that is not solved yet.

    Raises
    ------
    SignfaceError
        The recording does not have the model's columns.

    Examples
    --------
    >>> import signface as sf
    >>> find_clause(sf.datasets.mini_weights(), sf.load_model("default")).tier
    'affect'
    """
    from signface.label.labelling import find_segments
    from signface.settings.solve import SolveSettings
    from signface.solver.solving import solve

    own = SolveSettings.from_dict(model.card.solve or {}).for_take_of(settings)
    descriptors = solve(recording, settings=own, signer=signer)
    level = None if signer is None else signer.level
    if level is not None and not set(model.card.bases) <= set(level.names):
        level = None
    found = find_segments(descriptors, model, level=None if level is None else level.on(model.card.bases))
    blank = model.card.vocabulary.blank
    table = found.table.drop(columns="intensity", errors="ignore")  # of the affect, which has its tier
    table = table[table["label"] != blank].reset_index(drop=True) if blank else table
    return Clause(model.card.tier, found.changed("find_clause", table), model.card.vocabulary, model.name)


@dataclass(frozen=True, eq=False, repr=False)
class Annotation(Content):
    """Everything that was found in one take. `print` says it in plain words, on one line.

    Parameters
    ----------
    descriptors : Descriptors
        Blendshape weights, residual and head motion.
    segments : Segments
        Stable segments and transitions with `label` and `confidence`, and `intensity` where it was sought.
    model : str
        Name of the trained model that gave the labels.
    channels : mapping of str to ChannelEvents, optional
        Events of the further channels (brows, eyes, head, ...), by name; None where they were not sought.
    signer : Signer
        Whose take it is.
    card : Card, optional
        What the model is and where it comes from.
    clauses : tuple of Clause
        What further models found, each on its tier.
    unseen : mapping of str to tuple of str
        By channel, the values that the markers cannot show (`signface.channels.rules.unseen_values`): that they were
        not found says nothing. A channel none of whose values can be seen is not among `channels`.

    See Also
    --------
    signface.elan.writing.write_eaf : writes all of it for ELAN.

    Examples
    --------
    >>> import signface as sf
    >>> annotation = sf.annotate(sf.datasets.mini_take("M1_IE_J"), sf.load_model("default"), channels=True)
    >>> annotation
    <Annotation of M1_IE_J: 5 stable segments, 7 channels, by default>
    >>> annotation.channels["head"].table["value"].tolist()
    []
    >>> annotation.curves.columns[:3].tolist()
    ['time_s', 'velocity_energy', 'acceleration_energy']
    """

    descriptors: Descriptors
    segments: Segments
    model: str
    channels: Mapping[str, ChannelEvents] | None = None
    signer: Signer = field(default_factory=Signer)
    card: Card | None = field(default=None, compare=False)
    clauses: tuple[Clause, ...] = ()
    unseen: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The take's name."""
        return self.descriptors.name

    @property
    def settings(self) -> SolveSettings | None:
        """How the take was solved; None where it was not (weights of a phone), or nobody knows."""
        return self.descriptors.settings

    @property
    def tier(self) -> str:
        """What was labelled: `affect`, or the tier that the model was trained on."""
        return "affect" if self.card is None else self.card.tier

    @property
    def vocabulary(self) -> Vocabulary:
        """What the labels stand for; with `unknown`, where the model abstained."""
        from signface.label.vocabulary import AFFECT, UNKNOWN

        vocabulary = AFFECT if self.card is None else self.card.vocabulary
        return vocabulary.including(UNKNOWN) if (self.segments.table["label"] == UNKNOWN).any() else vocabulary

    @property
    def unlike(self) -> str:
        """That the take is unlike what the model knows, in words; empty where it is like it, or nothing tells."""
        from signface.label.familiarity import UNLIKE

        return next((step for step in self.segments.history if step.startswith(UNLIKE)), "")

    @cached_property
    def curves(self) -> pd.DataFrame:
        """Energies, confidence, some weights and the residual, every 10 ms (`segmentation.curves.curves_table`).

        Raises
        ------
        SignfaceError
            The take has fewer than three frames or ends before time 0.
        """
        from signface.segmentation.curves import curves_table

        return curves_table(self.descriptors, self.segments)

    @property
    def residual_mm(self) -> float | None:
        """Median over the frames of the solve's residual in millimetres; None where there was nothing to solve."""
        assert self.descriptors.residual is not None
        return median_known(self.descriptors.residual)

    @property
    def _residuals(self) -> np.ndarray:
        assert self.descriptors.residual is not None
        return self.descriptors.residual

    @cached_property
    def untrusted(self) -> tuple[Stretch, ...]:
        """The stretches in which the solved face lies too far from the markers (`signface.trust.untrusted`)."""
        return tuple(untrusted(self._residuals, self.descriptors.rate, self.descriptors.start))

    @property
    def _untrusted(self) -> str:
        return ", ".join(f"{one.start_s:.3f} to {one.end_s:.3f} s" for one in self.untrusted)

    @property
    def wrong_markers(self) -> str:
        """Ghosts, swapped and frozen markers, in words; empty where there were none, or nobody looked."""
        return self.descriptors.wrong_markers

    @cached_property
    def jitter(self) -> Jitter | None:
        """What of the motion is jitter of the tracker; None for a take of fewer than three frames."""
        from signface.segmentation.noise import jitter

        return jitter(self.descriptors) if self.descriptors.n_frames >= 3 else None

    @property
    def facts(self) -> dict[str, str]:
        """What the header of an EAF says of it: `model`, `take`, `residual_mm`.

        And, where there are any, the bases that the markers cannot see (`unobserved`), the values of channels that
        they cannot show (`unseen`), that the take is unlike what the model knows (`unlike`), the stretches that cannot
        be trusted (`untrusted`) and the markers that were wrong (`markers`).
        """
        residual = "unknown" if self.residual_mm is None else f"{self.residual_mm:.2f}"
        more = {"unobserved": joined_sides(self.descriptors.unobserved), "unseen": self._unseen, "unlike": self.unlike}
        more |= {"untrusted": ", ".join(map(str, self.untrusted)), "markers": self.wrong_markers}
        told = {name: text for name, text in more.items() if text}
        return {"model": self.model, "take": self.name, "residual_mm": residual, **told}

    @property
    def _unseen(self) -> str:
        """The values that cannot be seen, in words: `blinks; eyes (wide, closed)`, a whole channel by its name."""
        whole = set(self.unseen) - set(self.channels or {})
        return "; ".join(name if name in whole else f"{name} ({', '.join(of)})" for name, of in self.unseen.items())

    def to_pympi(self, *, options: EafOptions | None = None) -> Eaf:
        """The tiers as an object of pympi-ling, for scripts (`signface.elan.writing.to_pympi`)."""
        from signface.elan.writing import to_pympi

        return to_pympi(self, options=options)

    def __repr__(self) -> str:
        stable = counted((self.segments.table["kind"] == "stable").sum(), "stable segment")
        channels = "" if self.channels is None else f", {counted(len(self.channels), 'channel')}"
        return f"<Annotation of {self.name}: {stable}{channels}, by {self.model}>"

    def __str__(self) -> str:
        table = self.segments.table
        stable = table[table["kind"] == "stable"]
        seconds = (stable["end_s"] - stable["start_s"]).rename("seconds")
        labels = []
        for label, total in seconds.groupby(stable["label"]).sum().sort_values(ascending=False).items():
            rows = stable["label"] == label
            confidence = np.average(stable.loc[rows, "confidence"], weights=seconds[rows])
            labels.append(f"{self.vocabulary.describe(str(label))} {total:.1f} s (confidence {confidence:.0%})")
        residual = self.residual_mm
        fit = "" if residual is None else f"; the solved face lies {residual:.2f} mm from the markers (median residual)"
        at_worst = worst(self._residuals, self.descriptors.rate, self.descriptors.start)
        fit += f", at worst {at_worst}" if at_worst is not None else ""
        fit += f"; do not trust {self._untrusted}" if self.untrusted else ""
        fit += f"; {self.wrong_markers}" if self.wrong_markers else ""
        fit += "" if self.jitter is None else f"; {self.jitter}"
        duration = f"{self.descriptors.duration:.1f} s"
        blind = joined_sides(self.descriptors.unobserved)
        fit += f"; no marker shows {blind}" if blind else ""
        fit += f"; cannot be seen: {self._unseen}" if self.unseen else ""
        fit += f"; the take is {self.unlike}" if self.unlike else ""
        return f"{duration}, {counted(len(stable), 'stable segment')}: {', '.join(labels) or 'none'}{fit}"

    def _repr_html_(self) -> str:
        return f"<p>{self.name}: {self}</p>{self.segments.table.to_html(index=False)}"


def annotate(
    recording: Recording | Descriptors,
    model: TrainedModel,
    *,
    settings: SolveSettings | None = None,
    signer: Signer | None = None,
    channels: bool | str | PathLike[str] | Mapping[str, Mapping[str, Any]] = False,
    clauses: Sequence[TrainedModel | Clause] = (),
    face: FaceModel | None = None,
    layout: MarkerLayout | None = None,
) -> Annotation:
    """Solve, segment and label one recording (Reverdy 2019, chapters 4 and 5).

    Parameters
    ----------
    recording : Take, TakeFile or Descriptors
        What `signface.takes.reading.open_recording` returns; descriptors are not solved again.
    model : TrainedModel
        What `signface.label.persistence.load_model` returns.
    settings : SolveSettings, optional
        How the recording is solved.
    signer : Signer, optional
        Whose take it is: names the tiers. A model that normalises signers does so by the signer's level, and by this
        take alone where none is known.
    channels : bool, path or mapping
        Also find the further channels and, where the model gives no intensity, the intensity of the affect by its
        rule: True for the shipped thresholds, or a file of one's own, or what `signface.channels.rules.read_channels`
        returns.
    clauses : sequence of TrainedModel or Clause
        Further models, whose segments get tiers of their own; or what `find_clause` found by them.
    face, layout : optional
        In place of those that the settings name.

    Raises
    ------
    SignfaceError
        The recording does not fit the layout, the model was trained on other bases, or the thresholds are wrong.

    See Also
    --------
    signface.elan.writing.write_eaf : writes what was found.

    Examples
    --------
    >>> import signface as sf
    >>> annotation = sf.annotate(sf.datasets.mini_take("M1_IE_J"), sf.load_model("default"))
    >>> annotation.segments.table["label"].tolist()[:3]
    ['N', 'NJ', 'J']
    """
    from signface.label.labelling import find_segments
    from signface.solver.solving import solve

    descriptors = solve(recording, face, layout, settings=settings, signer=signer)
    signer = Signer() if signer is None else signer
    segments = find_segments(descriptors, model, level=signer.level)
    events, unseen = None, {}
    if channels is not False:
        from signface.channels.rules import find_channels, find_intensities, read_channels, unseen_values

        name = "default" if channels is True else channels
        thresholds = name if isinstance(name, Mapping) else read_channels(name)
        events = {event.channel: event for event in find_channels(descriptors, thresholds, level=signer.level)}
        unseen = unseen_values(descriptors, thresholds)
        if "intensity" in thresholds and "intensity" not in segments.table and model.card.tier == "affect":
            segments = find_intensities(descriptors, segments, thresholds)
    found = tuple(
        one if isinstance(one, Clause) else _clause_of(one, descriptors, recording, signer, settings) for one in clauses
    )
    taken, named = {model.card.tier, *(events or {})}, []
    for one in found:
        named.append(replace(one, tier=f"{one.tier}-{one.model}") if one.tier in taken else one)
        taken.add(named[-1].tier)
    return Annotation(descriptors, segments, model.name, events, signer, model.card, tuple(named), unseen)


def _clause_of(
    model: TrainedModel,
    descriptors: Descriptors,
    recording: Recording | Descriptors,
    signer: Signer,
    settings: SolveSettings | None,
) -> Clause:
    """From the descriptors where they have the model's columns, or else the recording, solved as the model wants."""
    if set(model.card.bases) <= set(descriptors.names):
        return find_clause(descriptors, model, signer=signer)
    return find_clause(recording, model, signer=signer, settings=settings)


def median_known(values: np.ndarray) -> float | None:
    """Median of the values that are known; None where none is."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else None
