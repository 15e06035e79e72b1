"""Sheets of stills: one picture a second, a row for each method, as in figures 5.4 to 5.6 of the thesis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike

import numpy as np

from signface.errors import SignfaceError
from signface.files import whole_file

#: Height of the captions, as a share of a picture's height.
CAPTION = 0.13
PAPER, INK = (255, 255, 255), (20, 22, 26)


def make_sheet(rows: Mapping[str, Sequence[np.ndarray]], times: Sequence[float], *, columns: int = 8) -> np.ndarray:
    """One sheet.

    Parameters
    ----------
    rows : mapping of name to (K,) sequence of (height, width, 3) uint8 pictures
        One entry a method; all of one size.
    times : (K,) sequence of float
        Seconds, written under the pictures.
    columns : int
        Pictures in a row; what is longer goes on below.

    Returns
    -------
    (H, W, 3) uint8 array

    Raises
    ------
    SignfaceError
        There is nothing to show.
    """
    from PIL import Image, ImageDraw, ImageFont

    if not rows or not times:
        raise SignfaceError("a sheet without pictures")
    height, width = next(iter(rows.values()))[0].shape[:2]
    caption = max(14, round(CAPTION * height))
    font = ImageFont.load_default(size=max(10, round(0.62 * caption)))
    longest = max(font.getlength(name) for name in rows)
    margin = round(longest) + caption
    across = min(columns, len(times))
    bands = -(-len(times) // across)
    band = len(rows) * height + caption + caption // 2
    sheet = Image.new("RGB", (margin + across * width, bands * band), PAPER)
    draw = ImageDraw.Draw(sheet)
    for row, (name, pictures) in enumerate(rows.items()):
        for place, picture in enumerate(pictures):
            x, y = margin + (place % across) * width, (place // across) * band
            sheet.paste(Image.fromarray(picture), (x, y + row * height))
            if place % across == 0:
                draw.text((caption // 2, y + row * height + height // 2), name, fill=INK, font=font, anchor="lm")
            if row == len(rows) - 1:
                below = y + len(rows) * height + caption // 2
                draw.text((x + width // 2, below), f"{times[place]:g} s", fill=INK, font=font, anchor="mm")
    return np.asarray(sheet)


def write_picture(path: str | PathLike[str], picture: np.ndarray) -> None:
    """Write a (height, width, 3) uint8 picture as PNG, whole or not at all.

    Raises
    ------
    SignfaceError
        The folder cannot be written.
    """
    from PIL import Image

    with whole_file(path) as temporary:
        Image.fromarray(picture).save(temporary, format="PNG", optimize=True)
