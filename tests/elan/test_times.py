"""When annotations are: chains without times, subdivisions, and the clock of the film."""

from __future__ import annotations

import pandas as pd
import pytest

import signface as sf
from signface.elan.annotators import read_annotators
from signface.elan.document import read_document, tier_rows
from signface.errors import SignfaceError, SignfaceWarning
from signface.segmentation.segments import Segments

HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<ANNOTATION_DOCUMENT AUTHOR="" DATE="2020-01-01T00:00:00+00:00" FORMAT="3.0" VERSION="3.0"
    xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
    xsi:noNamespaceSchemaLocation="http://www.mpi.nl/tools/elan/EAFv3.0.xsd">
"""
TYPES = """<LINGUISTIC_TYPE LINGUISTIC_TYPE_ID="top" TIME_ALIGNABLE="true"/>
<LINGUISTIC_TYPE LINGUISTIC_TYPE_ID="time" TIME_ALIGNABLE="true" CONSTRAINTS="Time_Subdivision"/>
<LINGUISTIC_TYPE LINGUISTIC_TYPE_ID="parts" TIME_ALIGNABLE="false" CONSTRAINTS="Symbolic_Subdivision"/>
<LINGUISTIC_TYPE LINGUISTIC_TYPE_ID="one" TIME_ALIGNABLE="false" CONSTRAINTS="Symbolic_Association"/>
</ANNOTATION_DOCUMENT>
"""


def aligned(name, start, end, value):
    return (
        f'<ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="{name}" TIME_SLOT_REF1="{start}" TIME_SLOT_REF2="{end}">'
        f"<ANNOTATION_VALUE>{value}</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>"
    )


def hanging(name, parent, value, previous=None):
    before = f' PREVIOUS_ANNOTATION="{previous}"' if previous else ""
    return (
        f'<ANNOTATION><REF_ANNOTATION ANNOTATION_ID="{name}" ANNOTATION_REF="{parent}"{before}>'
        f"<ANNOTATION_VALUE>{value}</ANNOTATION_VALUE></REF_ANNOTATION></ANNOTATION>"
    )


def tier(name, kind, *annotations, parent=None):
    above = f' PARENT_REF="{parent}"' if parent else ""
    return f'<TIER TIER_ID="{name}" LINGUISTIC_TYPE_REF="{kind}"{above}>{"".join(annotations)}</TIER>'


def write(path, slots, *tiers, media=()):
    """An EAF; slots are `name=time` or a name without one, media `name=origin`."""
    order = ""
    for slot in slots.split():
        name, _, time = slot.partition("=")
        order += f'<TIME_SLOT TIME_SLOT_ID="{name}"' + (f' TIME_VALUE="{time}"/>' if time else "/>")
    films = ""
    for film in media:
        name, _, origin = film.partition("=")
        said = f' TIME_ORIGIN="{origin}"' if origin else ""
        films += f'<MEDIA_DESCRIPTOR MEDIA_URL="file:///films/{name}" MIME_TYPE="video/mp4"{said}/>'
    header = f'<HEADER MEDIA_FILE="" TIME_UNITS="milliseconds">{films}</HEADER><TIME_ORDER>{order}</TIME_ORDER>'
    path.write_text(HEAD + header + "".join(tiers) + TYPES, "utf-8")
    return path


def labelled(spans):
    table = pd.DataFrame(spans, columns=["start_s", "end_s", "label"])
    return Segments(table.assign(kind="stable"), name="take")


def rows(path, name):
    return tier_rows(read_document(path).getroot())[name]


CHAIN = (aligned("a2", "t1", "t2", "N"), aligned("a3", "t2", "t3", "J"), aligned("a4", "t3", "t4", "N"))
SLOTS = "t1=1000 o1=1200 t2 t3 o2=1600 t4=4000"
OTHER = tier("Other", "top", aligned("a5", "o1", "o2", "x"))
SPREAD = [(1000, 2000, "N"), (2000, 3000, "J"), (3000, 4000, "N")]


def test_a_time_subdivision_is_spread_in_its_parent_whatever_other_tiers_hold(tmp_path):
    whole = tier("Utt", "top", aligned("a1", "t1", "t4", "u"))
    file = write(tmp_path / "a.eaf", SLOTS, whole, tier("affect", "time", *CHAIN, parent="Utt"), OTHER)
    assert rows(file, "affect") == SPREAD
    assert sf.read_reference(file).table["start_s"].tolist() == [1.0, 2.0, 3.0]


def test_an_independent_tier_with_open_times_is_spread_along_its_own_chain(tmp_path):
    assert rows(write(tmp_path / "a.eaf", SLOTS, tier("affect", "top", *CHAIN), OTHER), "affect") == SPREAD


def test_children_may_stand_before_their_parent_and_have_slots_of_their_own(tmp_path):
    slots = "t1=1000 c1 c2 c3 c4 t4=4000"
    chain = (aligned("a2", "c1", "c2", "N"), aligned("a3", "c3", "c4", "J"))
    children = tier("affect", "time", *chain, parent="Utt")
    file = write(tmp_path / "a.eaf", slots, children, tier("Utt", "top", aligned("a1", "t1", "t4", "u")))
    assert rows(file, "affect") == [(1000, 2500, "N"), (2500, 4000, "J")]


def test_a_chain_in_a_chain_and_a_known_time_within_it(tmp_path):
    slots = "t1=0 m1 t2 m2=700 t3=900"
    words = tier("words", "time", aligned("w1", "t1", "t2", "a"), aligned("w2", "t2", "t3", "b"), parent="Utt")
    parts = (aligned("p1", "t1", "m1", "x"), aligned("p2", "m1", "t2", "y"), aligned("p3", "t2", "m2", "z"))
    parts = tier("parts", "time", *parts, aligned("p4", "m2", "t3", "v"), parent="words")
    file = write(tmp_path / "a.eaf", slots, tier("Utt", "top", aligned("u", "t1", "t3", "u")), words, parts)
    assert rows(file, "words") == [(0, 450, "a"), (450, 900, "b")]
    assert rows(file, "parts") == [(0, 225, "x"), (225, 450, "y"), (450, 700, "z"), (700, 900, "v")]


def test_a_symbolic_subdivision_divides_its_parent_in_the_order_of_its_references(tmp_path):
    parts = tier(
        "parts", "parts", hanging("p2", "u", "b", "p1"), hanging("p1", "u", "a"), hanging("p3", "u", "c", "p2"),
        parent="Utt",
    )  # fmt: skip
    notes = tier("notes", "one", hanging("n1", "p2", "middle"), parent="parts")
    file = write(tmp_path / "a.eaf", "t1=0 t2=3000", tier("Utt", "top", aligned("u", "t1", "t2", "u")), parts, notes)
    assert rows(file, "parts") == [(0, 1000, "a"), (1000, 2000, "b"), (2000, 3000, "c")]
    assert rows(file, "notes") == [(1000, 2000, "middle")]


def test_our_tiers_do_not_move_the_open_times_of_a_lab(tmp_path):
    file = write(tmp_path / "a.eaf", "t1=1000 t2 t3 t4=4000", tier("words", "top", *CHAIN))
    sf.write_eaf(labelled([(1.1, 1.3, "N"), (1.3, 2.9, "J")]), into=file, signer="S1")
    assert rows(file, "words") == SPREAD


BROWS = tier("affect", "top", aligned("a1", "t1", "t2", "J"), aligned("a2", "t3", "t4", "N"))
EARLY = "t1=200 t2=1000 t3=2000 t4=3000"
FILM = "t1=1200 t2=2000 t3=3000 t4=4000"


def test_references_are_in_the_clock_of_the_film(tmp_path):
    file = write(tmp_path / "a.eaf", EARLY, BROWS, media=["film.mp4=1000"])
    assert sf.read_reference(file).table["start_s"].tolist() == [1.2, 3.0]
    assert sf.read_tiers(file)["affect"]["end_s"].tolist() == [2.0, 4.0]


def test_annotators_of_one_film_agree_whatever_their_origins(tmp_path):
    eva = write(tmp_path / "eva.eaf", FILM, BROWS, media=["film.mp4"])
    tom = write(tmp_path / "tom.eaf", EARLY, BROWS, media=["film.mp4=1000", "side.mp4=20"])
    held = read_annotators([eva, tom])
    pd.testing.assert_frame_equal(held["eva"]["affect"], held["tom"]["affect"])


def test_films_that_disagree_are_asked_about(tmp_path):
    file = write(tmp_path / "a.eaf", EARLY, BROWS, media=["front.mp4=1000", "side.mp4"])
    with pytest.raises(SignfaceError, match=r"front.mp4 1000 ms, side.mp4 0 ms.*--video"):
        sf.read_reference(file)
    assert sf.read_reference(file, video="elsewhere/front.mp4").table["start_s"].tolist() == [1.2, 3.0]
    with pytest.raises(SignfaceError, match="TIME_ORIGIN"):
        sf.write_eaf(labelled([(3.0, 4.0, "N")]), into=file, signer="S1")
    with pytest.warns(SignfaceWarning, match="other.mp4 is not linked"):
        sf.read_reference(file, video="other.mp4")


def test_what_is_found_is_written_in_the_annotations_time(tmp_path):
    file = write(tmp_path / "a.eaf", EARLY, BROWS, media=["film.mp4=1000"])
    found = labelled([(0.0, 0.5, "N"), (0.5, 1.323, "D"), (3.008, 4.732, "J")])
    sf.write_eaf(found, into=file, signer="S1", video="film.mp4")
    assert rows(file, "affect@S1") == [(0, 323, "D"), (2008, 3732, "J")]
    back = sf.read_reference(file, "S1")
    assert isinstance(back, Segments)
    assert back.table["end_s"].tolist() == [1.323, 4.732]


def test_an_origin_that_is_no_number_is_said(tmp_path):
    file = write(tmp_path / "a.eaf", EARLY, BROWS, media=["film.mp4=soon"])
    with pytest.raises(SignfaceError, match="'soon', which is no count of milliseconds"):
        sf.read_reference(file)
