"""Curves for ELAN's timeseries viewer: `TAKE.curves.csv` and its description `TAKE_tsconf.xml`.

- `write_curves`: the csv, from the table of `signface.segmentation.curves.curves_table`.
- `write_tsconf`: names, units, ranges and colours of the curves, in ELAN's own format.
- `joined_curves`: those of several signers as one table.
- `panels`: which curves are drawn together (`preferences.write_preferences`).

How ELAN reads the csv (`CSVReader` in its sources) decides its form: lines starting with `#` are skipped, any other
line counts as a sample, so the header starts with `#`. The rate is taken from the first twenty rows, times in whole
milliseconds, and rounded to whole Hz, so the rows stand every 10 ms whatever the rate of the take; a missing value is
written `NaN`, because an empty cell at the end of a row would be read as 0.
"""

from __future__ import annotations

import contextlib
import datetime
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pandas as pd
from lxml import etree

from signface.elan.document import iso_date, link_urls, parse_xml, write_document
from signface.elan.links import CURVES_ENDING
from signface.errors import SignfaceError, SignfaceWarning
from signface.files import whole_file

PROVIDER = "mpi.eudico.client.annotator.timeseries.csv.CSVServiceProvider"


@dataclass(frozen=True)
class Curve:
    """How a curve is drawn.

    Parameters
    ----------
    name : str
        What the viewer calls it: up to some 14 letters fit beside a panel.
    description, units : str
    colour : (3,) tuple of int
        Red, green, blue, 0 to 255.
    panel : int
        Which panel of the viewer it belongs to, from 1.
    span : (2,) tuple of float, optional
        Lowest and highest value drawn; found from the values when None.
    """

    name: str
    description: str
    units: str
    colour: tuple[int, int, int]
    panel: int
    span: tuple[float, float] | None = None


#: The panels of the weights: the confidence with brows and lids, and the mouth.
UPPER, LOWER = 3, 4

#: How many curves a panel can hold whose names and values can still be read.
TRACKS = 5

SHARE = (0.0, 1.0)

#: Column of the csv: how it is drawn.
CURVES = {
    "velocity_energy": Curve(
        "velocity", "Sum of the absolute velocities of the weights (eq. 4.4)", "1/s", (0, 158, 115), 1
    ),
    "acceleration_energy": Curve(
        "acceleration", "Sum of the absolute accelerations of the weights (eq. 4.5)", "1/s2", (213, 94, 0), 2
    ),
    "confidence": Curve("confidence", "Confidence of the label of the segment", "", (0, 0, 0), UPPER, SHARE),
    "brows_up": Curve("brows up", "Brows raised", "", (230, 159, 0), UPPER, SHARE),
    "brows_down": Curve("brows down", "Brows lowered", "", (213, 94, 0), UPPER, SHARE),
    "lids_closed": Curve("lids closed", "Lids closed", "", (86, 180, 233), UPPER, SHARE),
    "lip_corners_up": Curve("corners up", "Lip corners up", "", (0, 114, 178), LOWER, SHARE),
    "lip_corners_down": Curve("corners down", "Lip corners down", "", (204, 121, 167), LOWER, SHARE),
    "jaw_open": Curve("jaw open", "Jaw open", "", (0, 158, 115), LOWER, SHARE),
    "residual_mm": Curve("residual", "Distance of the solved face from the markers", "mm", (153, 153, 153), 5),
}

#: Colours of the weights of bases that have no curve of their own above.
OTHER_COLOURS = tuple(
    curve.colour for name, curve in CURVES.items() if curve.panel in (UPPER, LOWER) and name != "confidence"
)


def write_curves(table: pd.DataFrame, path: str | PathLike[str]) -> None:
    """Write curves as csv for ELAN. Its header starts with `#`, so the first column reads `#time_s`.

    Parameters
    ----------
    table : DataFrame
        `time_s` and a column for each curve (`signface.segmentation.curves.curves_table`).
    path : path

    Raises
    ------
    SignfaceError
        The folder cannot be written.
    """
    row = ",".join(["%.4f"] * table.shape[1])  # ten times as fast as pandas, and the same bytes
    rows = "\n".join(row % tuple(values) for values in table.to_numpy(dtype=float).tolist()).replace("nan", "NaN")
    with whole_file(path) as temporary:
        temporary.write_text(f"#{','.join(table.columns)}\n{rows}\n", encoding="utf-8", newline="\n")


def write_tsconf(
    curves: str | PathLike[str], path: str | PathLike[str], *, date: datetime.datetime | str | None = None
) -> None:
    """Write the description of a curves file for ELAN's timeseries viewer.

    ELAN itself gives the tracks that an annotator adds to the description of this name: those of other files stay, and
    so do the colours she gave to ours.

    The `source-url` is the absolute URL that the EAF's LINKED_FILE_DESCRIPTOR holds: when both move to another
    folder, ELAN finds the csv by its relative URL and maps the old absolute one to the new.

    Parameters
    ----------
    curves : path
        What `write_curves` wrote.
    path : path
        `TAKE_tsconf.xml`; ELAN knows the file by this ending.
    date : datetime or str, optional
        As in `writing.write_eaf`.

    Raises
    ------
    SignfaceError
        The curves cannot be read, or the folder cannot be written.

    Warns
    -----
    SignfaceWarning
        The file is there and no description of curves: it is left as it is.
    """
    table = _read_curves(curves)
    root = _described(Path(path))
    if root is None:
        warnings.warn(
            f"{path}: is no description of curves, and is left as it is: ELAN will not show ours; move it away",
            SignfaceWarning,
            stacklevel=2,
        )
        return
    root.set("date", iso_date(date))
    source = etree.Element("tracksource")
    # Those of another name are of the file that this one is a copy of
    same = [one for one in root.iterfind("tracksource") if _file_name(one).endswith(CURVES_ENDING)]
    chosen = {track.get("name"): track.findtext("color") for one in same for track in one.iterfind("track")}
    for old in same:
        root.remove(old)
    root.insert(0, source)
    source.set("source-url", link_urls(curves, path)[0])
    source.set("sample-type", "Continuous Rate")
    source.set("time-column", "0")
    etree.SubElement(source, "property", key="provider", value=PROVIDER)
    for column, name in enumerate(table.columns[1:], start=1):
        curve = _curve(name, column, table.columns)
        low, high = curve.span or _span(table[name].to_numpy(float))
        track = etree.SubElement(source, "track", name=curve.name, derivative="0")
        etree.SubElement(track, "property", key="detect-range", value="false")
        position = etree.SubElement(track, "sample-position")
        etree.SubElement(position, "pos", row="0", col=str(column))
        etree.SubElement(track, "description").text = curve.description
        etree.SubElement(track, "units").text = curve.units
        etree.SubElement(track, "range", min=f"{low:g}", max=f"{high:g}")
        etree.SubElement(track, "color").text = chosen.get(curve.name) or ",".join(map(str, curve.colour))
    write_document(etree.ElementTree(root), path)


def _described(file: Path) -> etree._Element | None:
    """The description that is there, or an empty one; None where the file is something else."""
    if not file.exists():
        return etree.Element("timeseries", version="1.0")
    with contextlib.suppress(SignfaceError):
        root = parse_xml(file).getroot()
        if root.tag == "timeseries":
            return root
    return None


def _file_name(source: etree._Element) -> str:
    """Name of the file that a description's tracks come from."""
    return unquote((source.get("source-url") or "").replace("\\", "/").rpartition("/")[2])


def panels(curves: str | PathLike[str]) -> dict[int, list[str]]:
    """The viewer's names of the curves of a file that are drawn together, by panel; never more than `TRACKS`.

    Raises
    ------
    SignfaceError
        The curves cannot be read.
    """
    drawn: dict[int, list[str]] = {}
    columns = _read_curves(curves, nrows=0).columns
    for column, name in enumerate(columns[1:], start=1):
        curve = _curve(name, column, columns)
        panel = curve.panel
        if name.partition("@")[0] not in CURVES and len(drawn.get(panel, ())) >= TRACKS:
            panel += LOWER - UPPER
        drawn.setdefault(panel, []).append(curve.name)
    return dict(sorted(drawn.items()))


def _read_curves(curves: str | PathLike[str], nrows: int | None = None) -> pd.DataFrame:
    try:
        return pd.read_csv(curves, nrows=nrows)
    except (OSError, ValueError) as error:
        raise SignfaceError("cannot be read as a file of curves", file=curves) from error


def _curve(name: str, column: int, columns: Sequence[str]) -> Curve:
    """How a column is drawn; `NAME@SIGNER` on panels of that signer's own."""
    bare, _, signer = name.partition("@")
    curve = CURVES.get(bare) or _other_curve(bare, column)
    if not signer:
        return curve
    signers = list(dict.fromkeys(other.partition("@")[2] for other in columns[1:]))
    below = signers.index(signer) * max(known.panel for known in CURVES.values())
    return replace(
        curve, name=f"{curve.name} {signer}", description=f"{curve.description} ({signer})", panel=curve.panel + below
    )


def joined_curves(curves: Sequence[pd.DataFrame], signers: Sequence[str]) -> pd.DataFrame:
    """The curves of the signers of one take in one table, whose columns are called `NAME@SIGNER`.

    Examples
    --------
    >>> one = pd.DataFrame({"time_s": [0.0], "confidence": [0.5]})
    >>> joined_curves([one, one], ["Anna", "Ben"]).columns.tolist()
    ['time_s', 'confidence@Anna', 'confidence@Ben']
    """
    named = [
        table.assign(time_s=table["time_s"].round(2)).set_index("time_s").add_suffix(f"@{signer}")
        for table, signer in zip(curves, signers, strict=True)
    ]
    return pd.concat(named, axis=1).sort_index().rename_axis("time_s").reset_index()


def _other_curve(name: str, column: int) -> Curve:
    short = name.replace("Left", "L").replace("Right", "R")  # bases of two sides are named so; others stay as they are
    return Curve(short, f"Weight of {name}", "", OTHER_COLOURS[column % len(OTHER_COLOURS)], UPPER, SHARE)


def _span(values: np.ndarray) -> tuple[float, float]:
    """From 0 to a little above the highest value, so that a curve does not touch the edge."""
    finite = values[np.isfinite(values)]
    top = float(finite.max()) if finite.size else 1.0
    return 0.0, 1.1 * top if top > 0 else 1.0
