"""The main job as one function: a recording in, labelled segments out, and an ELAN file on request.

- `annotate`: recording to `Annotation` (descriptors, labelled segments, which model).
- `describe`, `describe_pieces`: its first half, recording to descriptors.
- `write_annotation`: an `Annotation` to `TAKE.eaf`, with its curves beside it.
- `summarise`: what was found, in plain words.

The steps themselves live in their rooms; this module only puts them in a row.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from signface.descriptors import Descriptors

if TYPE_CHECKING:
    from signface.face.layout import MarkerLayout
    from signface.face.model import FaceModel
    from signface.label.model import TrainedModel
    from signface.segmentation.segments import Segments
    from signface.signer import SignerLevel
    from signface.takes.recording import Recording


@dataclass(frozen=True)
class Annotation:
    """What was found in one recording.

    Parameters
    ----------
    descriptors : Descriptors
        Blendshape weights, residual and head motion.
    segments : Segments
        Stable segments and transitions with `label` and `confidence`.
    classifier : str
        Name of the trained model that gave the labels.
    """

    descriptors: Descriptors
    segments: Segments
    classifier: str


def annotate(
    recording: Recording | Descriptors,
    *,
    model: TrainedModel,
    face: FaceModel | None = None,
    layout: MarkerLayout | None = None,
    neutral: str | float = "auto",
    method: str = "thin-shell",
    alpha: float | None = None,
    level: SignerLevel | None = None,
    **options: Any,
) -> Annotation:
    """Solve, segment and label one recording (Reverdy 2019, chapters 4 and 5).

    Parameters
    ----------
    recording : Take, TakeFile or Descriptors
        What `signface.takes.reading.open_recording` returns; descriptors (weights from a phone) are not solved.
    model : TrainedModel
        What `signface.label.persistence.load_model` returns.
    face : FaceModel, optional
        The face to solve for; the shipped one by default.
    layout : MarkerLayout, optional
        Where the markers stand on that face; by default the shipped layout that fits the take's labels.
    neutral : float or "auto"
        Time in seconds of a frame with a neutral face.
    method : str
        One of `signface.solver.methods.METHODS`.
    alpha : float, optional
        Weight of the thin shell, 0 to 1; the method's own default when not given.
    level : SignerLevel, optional
        What a model that normalises signers normalises by (`signface.signer.signer_level` of takes of the
        signer); the level of this take alone when not given.
    **options
        More of `signface.solver.solving.solve_take`.

    Raises
    ------
    SignfaceError
        The recording does not fit the layout, or the model was trained on other bases.

    Examples
    --------
    >>> from signface.label.persistence import load_model
    >>> from signface.takes.reading import read_recording
    >>> found = annotate(read_recording("take.c3d"), model=load_model("default"))  # doctest: +SKIP
    >>> found.segments.table[["start_s", "end_s", "label"]]  # doctest: +SKIP
    """
    from signface.label.labelling import find_segments

    descriptors = describe(recording, face=face, layout=layout, neutral=neutral, method=method, alpha=alpha, **options)
    segments = find_segments(descriptors, model, level=level)
    return Annotation(descriptors, segments, model.name)


def describe(
    recording: Recording | Descriptors,
    *,
    face: FaceModel | None = None,
    layout: MarkerLayout | None = None,
    neutral: str | float = "auto",
    method: str = "thin-shell",
    alpha: float | None = None,
    **options: Any,
) -> Descriptors:
    """Descriptors of a recording: solved from markers, or passed through when they came from a phone.

    Parameters and errors are those of `annotate` and, for `options`, of `signface.solver.solving.solve_take`.
    """
    if isinstance(recording, Descriptors):
        return recording
    from signface.solver.solving import solve_take

    face, layout = _face_and_layout(recording, face, layout)
    return solve_take(recording, face, layout, neutral=neutral, method=method, alpha=alpha, **options)


def describe_pieces(
    recording: Recording | Descriptors,
    *,
    face: FaceModel | None = None,
    layout: MarkerLayout | None = None,
    **options: Any,
) -> Iterator[Descriptors]:
    """Descriptors of a recording of any length, piece by piece; see `describe` and `solving.solve_pieces`."""
    if isinstance(recording, Descriptors):
        yield recording
        return
    from signface.solver.solving import solve_pieces

    face, layout = _face_and_layout(recording, face, layout)
    yield from solve_pieces(recording, face, layout, **options)


def _face_and_layout(
    recording: Recording, face: FaceModel | None, layout: MarkerLayout | None
) -> tuple[FaceModel, MarkerLayout]:
    """The face and layout given, or the shipped ones."""
    from signface.face.layout_files import choose_layout
    from signface.face.reading import read_face

    face = read_face("default") if face is None else face
    return face, choose_layout(recording.labels, face) if layout is None else layout


def write_annotation(
    annotation: Annotation,
    path: str | PathLike[str],
    *,
    properties: Mapping[str, str] | None = None,
    **options: Any,
) -> list[Path]:
    """Write `TAKE.eaf`, its curves and their description for ELAN's timeseries viewer.

    Parameters
    ----------
    annotation : Annotation
    path : path
        The `.eaf`; `TAKE.curves.csv` and `TAKE_tsconf.xml` appear beside it.
    properties : mapping, optional
        What the header of the `.eaf` says besides model, take and residual.
    **options
        `signer`, `video`, `channels`, `doubtful_below`, `template`, `into`, `mapping`, `date`, `replace`: see
        `signface.elan.output.write_take`.

    Returns
    -------
    list of Path
        The files written, the `.eaf` first.

    Raises
    ------
    SignfaceError
        The `.eaf` exists and is not our own untouched output, the mapping does not fit the template, or the folder
        cannot be written. Nothing is written then.
    """
    from signface.elan.output import write_take

    residual = median_residual(annotation.descriptors)
    told = {
        "model": annotation.classifier,
        "take": annotation.descriptors.name,
        "residual_mm": "unknown" if residual is None else f"{residual:.2f}",
    }
    return write_take(
        path, annotation.descriptors, annotation.segments, properties={**told, **(properties or {})}, **options
    )


def median_residual(descriptors: Descriptors) -> float | None:
    """Median over the frames of the solve's residual in millimetres; None where there was nothing to solve."""
    assert descriptors.residual is not None
    return median_known(descriptors.residual)


def median_known(values: np.ndarray) -> float | None:
    """Median of the values that are known; None where none is."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else None


def summarise(annotation: Annotation) -> str:
    """What was found in a take, in plain words, on one line.

    Examples
    --------
    `4.3 s, 5 stable segments: joy 2.1 s (80 %), neutral 1.4 s (95 %); markers fit the face to 0.9 mm`
    """
    from signface.label.vocabulary import AFFECTS

    descriptors, table = annotation.descriptors, annotation.segments.table
    stable = table[table["kind"] == "stable"]
    seconds = (stable["end_s"] - stable["start_s"]).rename("seconds")
    found = []
    for label, total in seconds.groupby(stable["label"]).sum().sort_values(ascending=False).items():
        own = stable["label"] == label
        confidence = np.average(stable.loc[own, "confidence"], weights=seconds[own])
        found.append(f"{AFFECTS.get(str(label), str(label))} {total:.1f} s (confidence {confidence:.0%})")
    count = f"{len(stable)} stable segment" + ("" if len(stable) == 1 else "s")
    residual = median_residual(descriptors)
    fit = "" if residual is None else f"; the solved face lies {residual:.2f} mm from the markers (median residual)"
    return f"{descriptors.duration:.1f} s, {count}: {', '.join(found) or 'none'}{fit}"
