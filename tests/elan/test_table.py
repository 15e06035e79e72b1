"""Every annotation is a row of one table, with the times that ELAN shows and the values of what it hangs on."""

from __future__ import annotations

import pandas as pd
import pytest
from lxml import etree

from signface.cli.main import main
from signface.elan.document import read_document
from signface.elan.table import annotation_table
from signface.elan.times import annotation_spans
from signface.elan.writing import write_eaf
from signface.errors import SignfaceError, SignfaceWarning
from tests.elan.test_templates import LAB
from tests.fixtures.elan_files import labelled

STEREOTYPES = ("Time_Subdivision", "Included_In", "Symbolic_Subdivision", "Symbolic_Association")


def annotation(identifier: str, value: str, **references: str) -> str:
    tag = "REF_ANNOTATION" if "ANNOTATION_REF" in references else "ALIGNABLE_ANNOTATION"
    attributes = "".join(f' {name}="{text}"' for name, text in references.items())
    return (f'<ANNOTATION><{tag} ANNOTATION_ID="{identifier}"{attributes}><ANNOTATION_VALUE>{value}</ANNOTATION_VALUE>'
            f"</{tag}></ANNOTATION>")  # fmt: skip


def between(start: str, end: str) -> dict[str, str]:
    return {"TIME_SLOT_REF1": start, "TIME_SLOT_REF2": end}


def document(times: list[int | None], tiers: dict[str, tuple[str | None, str, list[str]]]) -> str:
    """Slots t0, t1, ... and tiers: parent, stereotype ("" for none) and annotations."""
    slots = "".join(
        f'<TIME_SLOT TIME_SLOT_ID="t{number}"' + ("/>" if time is None else f' TIME_VALUE="{time}"/>')
        for number, time in enumerate(times)
    )
    text = f'<ANNOTATION_DOCUMENT VERSION="3.0" FORMAT="3.0"><HEADER/><TIME_ORDER>{slots}</TIME_ORDER>'
    for name, (parent, stereotype, held) in tiers.items():
        above = "" if parent is None else f' PARENT_REF="{parent}"'
        text += f'<TIER TIER_ID="{name}" LINGUISTIC_TYPE_REF="{stereotype or "root"}"{above}>{"".join(held)}</TIER>'
    text += '<LINGUISTIC_TYPE LINGUISTIC_TYPE_ID="root"/>'
    for name in STEREOTYPES:
        text += f'<LINGUISTIC_TYPE LINGUISTIC_TYPE_ID="{name}" CONSTRAINTS="{name}"/>'
    return text + "</ANNOTATION_DOCUMENT>"


#: An utterance from 1000 to 4000 ms cut into three words of no times, between whose slots those of another tier lie.
DEEP = document(
    [0, 1000, None, 1400, None, 4000, 4200],
    {
        "Utt": (None, "", [annotation("u1", "hello", **between("t1", "t5")),
                annotation("u0", "", **between("t0", "t1"))]),
        "Words": ("Utt", "Time_Subdivision", [annotation("w1", "a", **between("t1", "t2")),
                  annotation("w2", "b", **between("t2", "t4")), annotation("w3", "c", **between("t4", "t5"))]),
        "Parts": ("Words", "Symbolic_Subdivision", [
                  annotation("p2", "right", ANNOTATION_REF="w2", PREVIOUS_ANNOTATION="p1"),
                  annotation("p1", "left", ANNOTATION_REF="w2")]),
        "Sure": ("Parts", "Symbolic_Association", [annotation("s1", "yes", ANNOTATION_REF="p2")]),
        "Brows": ("Utt", "Included_In", [annotation("b1", "up", **between("t3", "t5"))]),
        "Other": (None, "", [annotation("o1", "x", **between("t3", "t6"))]),
    },
)  # fmt: skip


@pytest.fixture
def deep(tmp_path):
    (tmp_path / "deep.eaf").write_text(DEEP)
    return tmp_path / "deep.eaf"


def test_annotations_without_times_are_spread_over_their_own_chain(deep):
    spans = annotation_spans(read_document(deep).getroot())
    assert [spans[name] for name in ("w1", "w2", "w3")] == [(1000, 2000), (2000, 3000), (3000, 4000)]
    assert [spans[name] for name in ("p1", "p2", "s1")] == [(2000, 2500), (2500, 3000), (2500, 3000)]


def test_a_chain_that_a_converter_wrote_with_two_slots_at_each_boundary_is_one(tmp_path):
    held = [annotation(f"a{k}", "x", **between(f"t{2 * k}", f"t{2 * k + 1}")) for k in range(3)]
    (tmp_path / "a.eaf").write_text(document([0, None, None, 700, None, 1000], {"T": (None, "", held)}))
    spans = annotation_spans(read_document(tmp_path / "a.eaf").getroot())
    assert spans == {"a0": (0, 350), "a1": (350, 700), "a2": (700, 1000)}


def test_a_row_has_the_values_of_all_that_it_hangs_on(deep):
    table = annotation_table([deep]).set_index("annotation")
    assert len(table) == etree.parse(deep).xpath("count(//ANNOTATION)")
    sure = table.loc["s1"]
    above = [(sure[f"parent_tier{level}"], sure[f"parent_value{level}"]) for level in ("", "_2", "_3")]
    assert above == [("Parts", "right"), ("Words", "b"), ("Utt", "hello")]
    assert (table.loc["b1", "parent_tier"], table.loc["b1", "parent_value"]) == ("Utt", "hello")
    assert (table.loc["o1", "parent_tier"], table.loc["b1", "parent_tier_2"]) == ("", "")
    assert list(table.index[:2]) == ["u0", "u1"]  # in the order of time


def test_the_command_writes_what_can_be_read_again(deep, tmp_path, capsys):
    write_eaf(labelled(), tmp_path / "take.eaf", signer="S1")
    out = tmp_path / "out" / "all.csv"
    assert main(["elan", "table", str(tmp_path), "-o", str(out), "--tier", "affect", "--tier", "Brows"]) == 0
    assert "6 annotations on 2 tiers of 2 files" in capsys.readouterr().out
    table = pd.read_csv(out, keep_default_na=False)
    assert table["value"].tolist() == ["up", "N", "NJ", "J", "JN", "N"]
    assert table["start_s"].tolist() == [1.4, 0.0, 0.5, 1.0, 1.5, 2.0]
    assert main(["elan", "table", str(deep), "-o", str(out), "--tier", "Eyes"]) == 2
    assert "no file has a tier Eyes" in capsys.readouterr().err
    assert main(["elan", "table", str(tmp_path / "out"), "-o", str(out)]) == 2
    assert main(["elan", "table", str(deep), "-o", str(tmp_path / "all.xlsx")]) == 2
    assert main(["elan", "table", str(deep), "-o", str(tmp_path / "all.parquet")]) == 0
    assert len(pd.read_parquet(tmp_path / "all.parquet")) == 10


def test_faults_are_said_and_the_rest_is_given(tmp_path):
    (tmp_path / "bad.eaf").write_text(LAB.replace('ANNOTATION_REF="a5"', 'ANNOTATION_REF="a50"'), "utf-8")
    with pytest.warns(SignfaceWarning, match="refers to a50"):
        table = annotation_table([tmp_path / "bad.eaf"])
    assert table["start_s"].isna().tolist() == [False, False, True]
    with pytest.raises(SignfaceError, match="no such file"):
        annotation_table([tmp_path / "none.eaf"])
