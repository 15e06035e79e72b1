"""The timeline of a take."""

import numpy as np
import pandas as pd
import pytest

from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.label.vocabulary import AFFECT
from signface.report.colours import colour_of, ink_on
from signface.report.timeline import draw_timeline, save_figure
from signface.segmentation.segments import Segments


@pytest.fixture
def take():
    time = np.arange(200) / 50
    return Descriptors(np.clip(time - 1, 0, 1)[:, None], ("jawOpen",), 50.0, start=10.0)


@pytest.fixture
def segments():
    table = pd.DataFrame(
        [(10.0, 11.0, "stable", "N"), (11.0, 12.0, "transition", "NSa"), (12.0, 14.0, "stable", "Sa")],
        columns=["start_s", "end_s", "kind", "label"],
    )
    return Segments(table)


def test_the_timeline_shows_every_label_in_its_place(take, segments):
    figure = draw_timeline(take, segments, reference=segments)
    below = figure.axes[1]
    assert sorted(text.get_text() for text in below.texts) == ["N", "N", "Sa", "Sa"]
    assert [tick.get_text() for tick in below.get_yticklabels()] == ["reference", "automatic"]
    assert below.get_xlim() == (10.0, 14.0)


@pytest.mark.parametrize("ending", [".png", ".svg", ".pdf"])
def test_one_figure_gives_the_same_bytes_twice(take, segments, tmp_path, ending):
    for name in ("a", "b"):
        save_figure(draw_timeline(take, segments), tmp_path / f"{name}{ending}")
    assert (tmp_path / f"a{ending}").read_bytes() == (tmp_path / f"b{ending}").read_bytes()


def test_another_ending_is_refused(take, segments, tmp_path):
    with pytest.raises(SignfaceError, match=r"\.png, \.svg or \.pdf"):
        save_figure(draw_timeline(take, segments), tmp_path / "a.doc")


def test_colours_are_distinct_and_their_ink_is_legible():
    colours = [colour_of(label) for label in AFFECT.values]
    assert len(set(colours)) == len(AFFECT.values)
    assert {ink_on(label) for label in AFFECT.values} <= {"black", "white"}
    assert ink_on("Su") == "black"  # on yellow
    assert ink_on("J") == "white"  # on dark blue
    assert colour_of("NA") == colour_of("SaSu") != colour_of("odd")
