"""Annotators compared wherever their tiers stand."""

from __future__ import annotations

import pytest

import signface as sf
from signface.cli.main import main
from signface.elan.annotators import read_annotators
from signface.elan.checking import check_file
from signface.errors import SignfaceError, SignfaceWarning
from tests.elan.test_times import aligned, hanging, labelled, rows, tier, write

SLOTS = "t1=0 t2=1000 t3=1200 t4=3000"


def two(name, border, first="neg", second="wh", **how):
    """A tier of two annotations that meet at a slot."""
    return tier(name, "top", aligned(f"{name}1", "t1", border, first), aligned(f"{name}2", border, "t4", second), **how)


def test_dependent_tiers_are_compared_where_named(tmp_path, capsys):
    for name, border in (("eva", "t2"), ("tom", "t3")):
        whole = tier("Utt", "top", aligned("u", "t1", "t4", "u"))
        write(tmp_path / f"{name}.eaf", SLOTS, whole, two("NMM", border, parent="Utt"))
    files = [str(tmp_path / f"{name}.eaf") for name in ("eva", "tom")]
    assert main(["elan", "agree", *files, "--tier", "NMM"]) == 0
    assert "0.93         0.86" in capsys.readouterr().out  # scikit-learn on frames of 10 ms: 0.9333, 0.8571


def test_two_tiers_of_one_file_are_two_annotators(tmp_path, capsys):
    file = write(tmp_path / "both.eaf", SLOTS, two("brows_R1", "t2"), two("brows_R2", "t3"))
    assert main(["elan", "agree", str(file), "--tier", "brows_R1", "--tier", "brows_R2"]) == 0
    named = capsys.readouterr().out
    assert "brows_R1 / brows_R2" in named
    assert main(["elan", "agree", str(file), "--match", "suffix"]) == 0
    matched = capsys.readouterr().out
    assert matched.startswith("brows\n")
    assert "R1 / R2" in matched
    assert "0.93         0.86" in named
    assert "0.93         0.86" in matched


def test_annotators_are_told_by_prefix_and_participant(tmp_path):
    file = write(tmp_path / "a.eaf", SLOTS, two("R1-brows", "t2"), two("R2-brows", "t3"))
    held = read_annotators([file], match="prefix", separator="-")
    assert {name: list(tiers) for name, tiers in held.items()} == {"R1": ["brows"], "R2": ["brows"]}
    text = file.read_text("utf-8")
    for who in ("R1", "R2"):
        text = text.replace(f'TIER_ID="{who}-brows"', f'TIER_ID="brows {who}" PARTICIPANT="{who}"')
    file.write_text(text, "utf-8")
    held = read_annotators([file], match="participant")
    assert {name: list(tiers) for name, tiers in held.items()} == {"R1": ["brows"], "R2": ["brows"]}


@pytest.mark.parametrize("again", [2, 3])
def test_a_file_named_twice_is_said(tmp_path, capsys, again):
    file = write(tmp_path / "a.eaf", SLOTS, two("affect", "t2"))
    assert main(["elan", "agree", *[str(file)] * again]) == 2
    error = capsys.readouterr().err
    assert "is named twice" in error
    assert error.count("\n") == 1


def test_a_tier_with_a_fault_does_not_block_another(tmp_path):
    context = tier("context", "top", aligned("c1", "t1", "t3", "x"), aligned("c2", "t2", "t4", "y"))
    file = write(tmp_path / "a.eaf", SLOTS, two("affect", "t2", "N", "J"), context)
    with pytest.warns(SignfaceWarning, match="overlap at 1000 ms on the tier context"):
        assert list(sf.read_tiers(file)) == ["affect"]
    with pytest.raises(SignfaceError, match="overlap at 1000 ms on the tier context"):
        sf.read_tiers(file, tiers=["context"])


def test_blanks_at_the_ends_of_labels_make_no_labels(tmp_path):
    file = write(tmp_path / "a.eaf", SLOTS, two("affect", "t2", " N", "J\t"))
    assert sf.read_tiers(file)["affect"]["label"].tolist() == ["N", "J"]


def test_a_reference_that_dangles_is_said_and_not_dropped(tmp_path):
    notes = tier("notes", "one", hanging("n", "gone", "x"), parent="affect")
    file = write(tmp_path / "a.eaf", SLOTS, two("affect", "t2"), notes)
    with pytest.raises(SignfaceError, match="'x' has no time on the tier notes"):
        sf.read_tiers(file, tiers=["notes"])


def test_what_is_undefined_is_said_and_why_kappa_is_low(tmp_path, capsys):
    for name in ("eva", "tom"):
        write(tmp_path / f"{name}.eaf", SLOTS, two("affect", "t2", "x", "x"))
    assert main(["elan", "agree", str(tmp_path / "eva.eaf"), str(tmp_path / "tom.eaf")]) == 0
    said = capsys.readouterr().out
    assert "modified_kappa" in said
    assert "undefined: with one label only" in said
    write(tmp_path / "long.eaf", SLOTS, tier("affect", "top", aligned("a", "t1", "t4", "x")))
    write(tmp_path / "many.eaf", SLOTS, two("affect", "t3", "y", "x"))
    assert main(["elan", "agree", str(tmp_path / "long.eaf"), str(tmp_path / "many.eaf"), "--overlap", "0.9"]) == 0
    said = capsys.readouterr().out
    assert "-0.00" not in said
    assert "no annotation is matched" in said
    assert "long never changes the label" in said


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (tier("Tr", "one", aligned("b", "t1", "t2", "x"), parent="Utt"), "has times and no parent"),
        (tier("W", "time", aligned("b", "t3", "t4", "x"), parent="Utt"), "lies in none of Utt"),
        (tier("Tr", "one", hanging("b", "a", "x")), "has no parent, its type wants one"),
        (tier("Tr", "top", hanging("b", "a", "x")), "has no times of its own"),
        (tier("O", "top", aligned("c", "t3", "t4", "o")) + tier("Tr", "one", hanging("b", "c", "x"), parent="Utt"),
         "hangs on O, not Utt"),
    ],
)  # fmt: skip
def test_check_names_what_breaks_the_hierarchy(tmp_path, made, said):
    file = write(tmp_path / "a.eaf", SLOTS, tier("Utt", "top", aligned("a", "t1", "t2", "u")), made)
    assert any(said in problem for problem in check_file(file).problems)


def test_check_names_references_that_lead_nowhere_the_unit_and_the_order(tmp_path):
    file = write(tmp_path / "a.eaf", SLOTS, tier("Utt", "top", aligned("a", "t1", "t2", "u")))
    text = file.read_text("utf-8").replace('ANNOTATION_ID="a"', 'ANNOTATION_ID="a" CVE_REF="c7" EXT_REF="er9"')
    text = text.replace('"milliseconds"', '"NTSC-frames"').replace(
        "</ANNOTATION_DOCUMENT>", '<TIER TIER_ID="late" LINGUISTIC_TYPE_REF="top"/></ANNOTATION_DOCUMENT>'
    )
    file.write_text(text, "utf-8")
    problems = " ".join(check_file(file).problems)
    for said in ("entry c7", "reference er9", "TIME_UNITS is NTSC-frames", "a TIER stands behind"):
        assert said in problems


def test_overlaps_on_a_labs_tier_do_not_keep_ours_out(tmp_path):
    context = tier("context", "top", aligned("c1", "t1", "t3", "x"), aligned("c2", "t2", "t4", "y"))
    file = write(tmp_path / "a.eaf", SLOTS, context)
    with pytest.warns(SignfaceWarning, match="overlap at 1000 ms"):
        sf.write_eaf(labelled([(0.1, 0.9, "N")]), into=file, signer="S1")
    assert rows(file, "context") == [(0, 1200, "x"), (1000, 3000, "y")]
    assert rows(file, "affect@S1") == [(100, 900, "N")]
