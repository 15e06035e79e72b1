"""Labels of single frames as an annotation: the `*_targets.txt` of UCI's Grammatical Facial Expressions.

Beside `a_affirmative_datapoints.txt`, whose rows have times, lies `a_affirmative_targets.txt`: a line a row, 1 where
the expression of the file's name is shown, 0 elsewhere. Rows of 1 that follow each other are one annotation on the
tier `expression`, with the name as its value; it begins and ends half way to the rows beside it.

- `is_frame_labels`: whether a file is one of these.
- `frame_label_document`: it as the document of an EAF, for all that reads annotations.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from lxml import etree

from signface.errors import SignfaceError
from signface.files import reading
from signface.frames import runs
from signface.takes.formats.kinect import kinect_lines, kinect_times

TIER = "expression"
TARGETS, POINTS = "_targets.txt", "_datapoints.txt"


def is_frame_labels(file: Path) -> bool:
    """Whether a file has the name of frame labels.

    Examples
    --------
    >>> is_frame_labels(Path("a_affirmative_targets.txt")), is_frame_labels(Path("take.eaf"))
    (True, False)
    """
    return file.name.endswith(TARGETS)


def signer_and_expression(file: Path) -> tuple[str, str]:
    """What the name of a file of points or of frame labels says.

    Examples
    --------
    >>> signer_and_expression(Path("a_wh_question_targets.txt"))
    ('a', 'wh_question')
    """
    stem = file.name.removesuffix(TARGETS).removesuffix(POINTS)
    signer, _, expression = stem.partition("_")
    return signer, expression or signer


def frame_label_document(file: Path) -> etree._Element:
    """Frame labels as the root of an EAF.

    Its vocabulary is closed: the expressions of all files of frame labels in the folder.

    Parameters
    ----------
    file : Path
        Its points lie beside it.

    Raises
    ------
    SignfaceError
        A line is neither 0 nor 1, the points are missing or broken, or the two have different numbers of rows.
    """
    with reading(file):
        cells = file.read_text("utf-8", errors="replace").split()
    wrong = next((row for row, cell in enumerate(cells, 1) if cell not in ("0", "1")), None)
    if wrong is not None:
        raise SignfaceError(f"row {wrong} is neither 0 nor 1: {cells[wrong - 1][:20]!r}", file=file, hint="correct it")
    points = file.with_name(file.name.removesuffix(TARGETS) + POINTS)
    if not points.is_file():
        raise SignfaceError(f"has no {points.name} beside it, which has the times", file=file, hint="put it there")
    times = kinect_times(kinect_lines(points)[1], points)
    if len(times) != len(cells):
        problem = f"has {len(cells)} rows for the {len(times)} of {points.name}"
        raise SignfaceError(problem, file=file, hint="one of them may be cut short")
    between = (times[:-1] + times[1:]) / 2
    borders = np.round(1000 * np.concatenate([times[:1], between, times[-1:]])).astype(int)
    shown = np.array(cells) == "1"
    spans = [(borders[begin], borders[end]) for begin, end in runs(shown) if borders[begin] < borders[end]]
    values = sorted({signer_and_expression(one)[1] for one in file.parent.glob(f"*{TARGETS}")})
    return _document(spans, signer_and_expression(file)[1], values)


def _document(spans: list[tuple[int, int]], label: str, values: list[str]) -> etree._Element:
    """An EAF of one tier, from spans in milliseconds."""
    root = etree.Element("ANNOTATION_DOCUMENT", VERSION="3.0", FORMAT="3.0")
    etree.SubElement(root, "HEADER", TIME_UNITS="milliseconds")
    order = etree.SubElement(root, "TIME_ORDER")
    tier = etree.SubElement(root, "TIER", TIER_ID=TIER, LINGUISTIC_TYPE_REF=TIER)
    for number, span in enumerate(spans):
        slots = [f"ts{2 * number + end}" for end in (1, 2)]
        for slot, time in zip(slots, span, strict=True):
            etree.SubElement(order, "TIME_SLOT", TIME_SLOT_ID=slot, TIME_VALUE=str(time))
        annotation = etree.SubElement(
            etree.SubElement(tier, "ANNOTATION"),
            "ALIGNABLE_ANNOTATION",
            ANNOTATION_ID=f"a{number + 1}",
            TIME_SLOT_REF1=slots[0],
            TIME_SLOT_REF2=slots[1],
        )
        etree.SubElement(annotation, "ANNOTATION_VALUE").text = label
    etree.SubElement(
        root, "LINGUISTIC_TYPE", LINGUISTIC_TYPE_ID=TIER, TIME_ALIGNABLE="true", CONTROLLED_VOCABULARY_REF=TIER
    )
    etree.SubElement(root, "LANGUAGE", LANG_ID="und", LANG_LABEL="undetermined")
    vocabulary = etree.SubElement(root, "CONTROLLED_VOCABULARY", CV_ID=TIER)
    for number, value in enumerate(values, 1):
        entry = etree.SubElement(vocabulary, "CV_ENTRY_ML", CVE_ID=f"cve{number}")
        etree.SubElement(entry, "CVE_VALUE", LANG_REF="und").text = value
    return root
