"""What markers a take has, and which of them are wrong, before it is solved.

- `recognise_layout`: which shipped layout they are, and which of its markers the take has.
- `wrong_markers`: ghosts, swapped and frozen ones.
"""

from __future__ import annotations

from typing import Any

from signface.errors import SignfaceError
from signface.face.layout_files import choose_layout
from signface.face.model import FaceModel
from signface.marker_names import SeveralSigners, signers_among
from signface.settings.solve import SolveSettings
from signface.solver.layout_fit import check_take
from signface.takes.labels import match_labels, rename_to
from signface.takes.marker_check import Finding, check_markers
from signface.takes.selecting import selected
from signface.takes.take import Take


def recognise_layout(take: Take, face: FaceModel) -> dict[str, Any]:
    """The shipped layout that fits a take's labels best, as plain values for a report.

    Returns
    -------
    dict
        `layout` (its name, or None where none fits, and then a `note` why), `face_markers` (how many of them the take
        has), `head_markers` (which), `missing` (markers of the layout that the take has not), `signers` (whose markers
        there are, "" where they have no prefix; the rest is of one of them). A `note` beside a layout says that the
        markers do not lie where it says.

    Examples
    --------
    >>> import signface as sf
    >>> recognise_layout(sf.datasets.mini_take(), sf.read_face())["missing"]
    []
    """
    try:
        layout = choose_layout(take.labels, face)
    except SignfaceError as error:
        return {
            "layout": None,
            "face_markers": 0,
            "head_markers": [],
            "missing": [],
            "signers": [],
            "note": error.problem,
        }
    present = match_labels(take.labels, layout.labels)
    try:
        check_take(take, layout, face)
        notes = {}
    except SignfaceError as error:
        notes = {"note": f"{error.problem}. {(error.hint or '')[:1].upper()}{(error.hint or '')[1:]}"}
    return {
        **notes,
        "layout": layout.name,
        "face_markers": sum(1 for label in layout.face_labels if label in present),
        "head_markers": [label for label in layout.head_labels if label in present],
        "signers": list(signers_among(take.labels, layout.labels)),
        "missing": [label for label in layout.labels if label not in present],
    }


def wrong_markers(take: Take, face: FaceModel) -> list[Finding]:
    """Ghosts, swapped and frozen markers of a take, as the check before a solve finds them.

    The markers are those of the shipped layout that fits the take best; all of its markers where none does.

    See Also
    --------
    signface.takes.marker_check.check_markers : also mends them.

    Examples
    --------
    >>> import signface as sf
    >>> wrong_markers(sf.datasets.mini_take(), sf.read_face())
    []
    """
    try:
        layout = choose_layout(take.labels, face)
        renamed = rename_to(take, layout.labels)
    except SeveralSigners as several:
        each = [selected(take, SolveSettings(subject=signer)) for signer in several.signers]
        return [finding for one in each for finding in wrong_markers(one, face)]
    except SignfaceError:
        return check_markers(take)[1]
    return check_markers(renamed, dict(zip(layout.labels, layout.points(face, layout.labels), strict=True)))[1]
