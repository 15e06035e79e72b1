"""Labels of a take are matched with a layout's: prefixes, case, two signers, and clear words where they do not fit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.errors import SignfaceError
from signface.marker_names import SeveralSigners, by_subject, signers_among
from signface.settings.solve import SolveSettings
from signface.takes.labels import clean_labels, match_labels, rename_to
from signface.takes.selecting import selected
from signface.takes.take import Take


def take_of(labels):
    """A take of two frames in which the x of every marker is its place in the list."""
    positions = np.zeros((2, len(labels), 3))
    positions[..., 0] = np.arange(len(labels))
    return Take(positions, labels, 100.0, name="t")


LAYOUT = ["LBRO1", "LBRO2", "RBRO1", "RBRO2", "NOSE", "CHIN"]


def test_the_take_gets_the_layouts_names_and_order():
    renamed = rename_to(take_of(["CHIN", "NOSE", "RBRO2", "RBRO1", "LBRO2", "LBRO1", "ELBOW"]), LAYOUT)
    assert renamed.labels == tuple(LAYOUT)
    assert renamed.positions[0, :, 0].tolist() == [5, 4, 3, 2, 1, 0]
    assert "rename_to 6 of 6 markers; not in the layout: ELBOW" in renamed.history[-1]


@pytest.mark.parametrize("written", ["Anna:{}", "Anna:face:{}", "{}", " {} ", "lower", "L_BRO", "Anna: {}"])
def test_prefixes_case_and_separators_do_not_matter(written):
    labels = {
        "lower": [label.lower() for label in LAYOUT],
        "L_BRO": [f"{label[0]}_{label[1:]}" for label in LAYOUT],
    }.get(written, [written.format(label) for label in LAYOUT])
    assert rename_to(take_of(labels), LAYOUT).labels == tuple(LAYOUT)


def test_of_two_signers_the_one_who_fits_best_is_taken():
    labels = ["Bea:LBRO1", "Bea:NOSE", *(f"Anna:{label}" for label in LAYOUT)]
    assert rename_to(take_of(labels), LAYOUT).positions[0, :, 0].tolist() == [2, 3, 4, 5, 6, 7]


def test_an_exact_name_wins_over_a_prefixed_one():
    labels = ["Wand:NOSE", *LAYOUT]
    assert rename_to(take_of(labels), LAYOUT).positions[0, 4, 0] == 5


def test_missing_markers_are_left_out_and_named_with_close_names():
    renamed = rename_to(take_of(["LBRO1", "LBRO2", "RBROW1", "NOSE"]), LAYOUT)
    assert renamed.labels == ("LBRO1", "LBRO2", "NOSE")
    assert "missing: RBRO1 (close: RBROW1)" in renamed.history[-1]


def test_a_take_of_another_marker_set_is_refused_with_the_names():
    with pytest.raises(SignfaceError) as refused:
        rename_to(take_of(["LBRW1", "LBRW2", "RBRW1", "RBRW2", "NOSE"]), LAYOUT)
    line = str(refused.value)
    assert "only 1 of the layout's 6 markers are in the take" in line
    assert "LBRO1 (close: LBRW1" in line
    assert "the take also has LBRW1, LBRW2" in line
    assert "Choose the layout" in line


def test_a_take_with_a_small_part_of_a_large_layout_is_renamed():
    layout = [str(number) for number in range(468)]
    contours = layout[::4]
    assert rename_to(take_of(contours), layout).labels == tuple(contours)


PREFIXES = ["{}:{}", "{}_{}", "{}.{}", "{} {}", "{}-{}", "Session:{}:{}", "{}:face:{}"]


@pytest.mark.parametrize("written", PREFIXES)
def test_two_signers_in_one_file_are_never_mixed(written):
    anna = [written.format("Anna", label) for label in LAYOUT if label != "CHIN"]
    ben = [written.format("Ben", label) for label in LAYOUT if label != "NOSE"]
    with pytest.raises(SeveralSigners, match=r"2 signers: Anna, Ben.*--subject Anna") as several:
        rename_to(take_of(anna + ben), LAYOUT)
    assert several.value.signers == ("Anna", "Ben")
    for subject, own, lacks in (("Anna", anna, "CHIN"), ("Ben", ben, "NOSE")):
        part = selected(take_of(anna + ben), SolveSettings(subject=subject))
        assert part.labels == tuple(own)
        assert rename_to(part, LAYOUT).labels == tuple(label for label in LAYOUT if label != lacks)


def test_a_second_signer_of_few_markers_lends_none():
    labels = [f"Anna:{label}" for label in LAYOUT if label != "CHIN"] + ["Ben:CHIN"]
    renamed = rename_to(take_of(labels), LAYOUT)
    assert "CHIN" not in renamed.labels
    assert "left out markers of other subjects: 1 of Ben" in renamed.history[-1]


def test_two_signers_without_names_are_refused():
    kept, names, _ = clean_labels([*LAYOUT, *LAYOUT[:-1]])
    assert len(kept) == 11
    with pytest.raises(SignfaceError, match="two signers without names"):
        rename_to(take_of(names), LAYOUT)


def test_sides_and_numbers_before_a_separator_are_no_subjects():
    labels = ["L_BROW", "R_BROW", "L_LIP", "R_LIP"]
    assert match_labels(labels, ["LBROW", "RBROW", "LLIP", "RLIP"]) == dict(
        zip(["LBROW", "RBROW", "LLIP", "RLIP"], labels, strict=True)
    )
    assert signers_among(["HEAD_1", "HEAD_2", "HEAD_3", "CHIN_1", "CHIN_2", "CHIN_3"], ["1", "2", "3"]) == ()


def test_a_subject_that_is_not_there_is_named_with_those_who_are():
    with pytest.raises(SignfaceError, match=r"no subject called 'Cleo'.*Anna, Ben"):
        selected(take_of(["Anna:NOSE", "Ben:NOSE"]), SolveSettings(subject="Cleo"))


def test_parts_of_a_marker_are_joined_under_one_name():
    positions = np.zeros((6, 3, 3))
    positions[..., 0] = np.arange(6)[:, None]
    positions[3:, 0] = positions[:3, 1] = np.nan
    take = Take(positions, ("NOSE", "M12", "CHIN"), 100.0, name="t")
    joined = selected(take, SolveSettings(join=("NOSE=NOSE+M12",)))
    assert joined.labels == ("NOSE", "CHIN")
    assert joined.positions[:, 0, 0].tolist() == [0, 1, 2, 3, 4, 5]
    assert "joined NOSE and M12 as NOSE" in joined.history
    with pytest.raises(SignfaceError, match="no marker M99"):
        selected(take, SolveSettings(join=("NOSE=NOSE+M99",)))
    positions[:, 2, 1] = 30
    with pytest.raises(SignfaceError, match="two markers, not parts of NOSE"):
        selected(Take(positions, take.labels, 100.0), SolveSettings(join=("NOSE=NOSE+CHIN",)))
    with pytest.raises(SignfaceError, match="joins no markers"):
        SolveSettings(join=("NOSE",))


def test_unlabelled_points_have_no_label():
    kept, names, notes = clean_labels(["*1", "A", "Anna:*12", "", "unlabeled_7", "U_3", "B", "Unnamed"])
    assert kept == [1, 6]
    assert names == ["A", "B"]
    assert notes == ["ignored 6 unlabelled points"]


@given(labels=st.lists(st.text(alphabet="AaBb*:1_ ~2", max_size=5), max_size=12))
@settings(max_examples=200, deadline=None)
def test_clean_labels_are_unique_and_in_order(labels):
    kept, names, _ = clean_labels(labels)
    assert len(set(names)) == len(names) == len(kept)
    assert kept == sorted(kept)


@given(
    take=st.lists(st.text(alphabet="AaB:_1", min_size=1, max_size=4), unique=True, max_size=10),
    wanted=st.lists(st.text(alphabet="AaB_1", min_size=1, max_size=3), unique=True, max_size=8),
)
@settings(max_examples=200, deadline=None)
def test_no_marker_is_matched_twice_and_exact_names_always_are(take, wanted):
    found = match_labels(take, wanted)
    assert len(set(found.values())) == len(found)
    assert set(found.values()) <= set(take)
    assert set(found) <= set(wanted)
    if by_subject(take, wanted).keys() <= {""}:  # else a subject's own come first
        for label in set(take) & set(wanted):
            assert found.get(label) == label
