"""The manifest of a corpus: what it accepts, and that it reports every problem at once."""

from pathlib import Path

import pytest

from signface.corpus.manifest import TakeEntry, read_corpus, write_takes
from signface.errors import SignfaceError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with two recordings and an annotation, no manifest yet."""
    for name in ("a.c3d", "b.c3d", "a.eaf"):
        (tmp_path / name).write_bytes(b"x")
    return tmp_path


def manifest(folder: Path, text: str) -> Path:
    file = folder / "takes.csv"
    file.write_text(text, encoding="utf-8")
    return file


def test_a_manifest_names_takes_relative_to_itself(folder):
    file = manifest(
        folder, "take,signer,kind,annotation,neutral_s,intensity\na.c3d,S1,IE,a.eaf,0.5,2\nb.c3d,S2,EU,,,\n"
    )
    for path in (folder, file):
        corpus = read_corpus(path)
        first, second = corpus
        assert first == TakeEntry(folder / "a.c3d", "S1", "IE", folder / "a.eaf", 0.5, intensity=2)
        assert second == TakeEntry(folder / "b.c3d", "S2", "EU")
        assert (corpus.signers, corpus.kinds, first.name) == (("S1", "S2"), ("EU", "IE"), "a")


def test_what_is_written_is_read_back(folder):
    takes = [
        TakeEntry(folder / "a.c3d", "Zoé, la 1re", "IE", folder / "a.eaf", 1.25, intensity=3, layout="default-40"),
        TakeEntry(folder / "b.c3d", "S2", "EU", start_s=-2.5),
    ]
    write_takes(folder, takes)
    assert list(read_corpus(folder)) == takes


def test_semicolons_blank_lines_and_a_byte_order_mark_are_spreadsheet_habits(folder):
    manifest(folder, "\ufefftake; signer ;kind;note\na.c3d;S1;IE;my own column\n\n;;;\nb.c3d;S1;SE;\n")
    assert [take.kind for take in read_corpus(folder)] == ["IE", "SE"]


def test_every_problem_is_reported_at_once(folder):
    manifest(
        folder,
        "take,signer,kind,anotation,neutral_s,intensity\n"
        "a.c3d,S1,IE,,soon,\nmissing.c3d,S1,IE,,nan,4\na.c3d,S1,SE,,,\n,,,a.eaf,,\nb.c3d,,EU,,,\n",
    )
    with pytest.raises(SignfaceError) as caught:
        read_corpus(folder)
    message = str(caught.value)
    assert "takes.csv: 10 problems" in message
    for part in (
        "anotation is unknown, annotation seems meant",
        "line 2: neutral_s is no number of seconds: soon",
        "line 3: no such file: missing.c3d (take)",
        "line 3: neutral_s is no number of seconds: nan",
        "line 3: intensity is 1, 2 or 3, not 4",
        "line 4: the take a.c3d is already on line 2",
        "line 5: take is empty",
        "line 6: signer is empty",
    ):
        assert part in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "is empty"),
        ("take,signer,kind\n", "it has no take"),
        ("take,who\na.c3d,S1\n", "the column signer is missing; the column kind is missing"),
        ("take,signer,kind,kind\na.c3d,S1,IE,SE\n", "the column kind stands twice"),
        ("take,signer,kind\na.c3d,S1,IE,extra\n", "4 cells for 3 columns"),
    ],
)
def test_a_table_that_is_no_manifest_says_why(folder, text, part):
    manifest(folder, text)
    with pytest.raises(SignfaceError, match=part):
        read_corpus(folder)


def test_bytes_that_are_no_text_are_no_manifest(folder):
    (folder / "takes.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(SignfaceError, match="cannot be read as a table"):
        read_corpus(folder)


def test_a_folder_without_manifest_says_so(folder):
    with pytest.raises(SignfaceError, match=r"has no takes\.csv"):
        read_corpus(folder)
    with pytest.raises(SignfaceError, match="no such file"):
        read_corpus(folder / "nowhere.csv")
    with pytest.raises(SignfaceError, match="labb: no such folder"):
        read_corpus(folder / "labb")


def test_takes_are_chosen_by_kind_and_signer_and_unknown_ones_are_named(folder):
    manifest(folder, "take,signer,kind\na.c3d,S1,IE\nb.c3d,S2,EU\n")
    corpus = read_corpus(folder)
    assert [take.name for take in corpus.select(kinds=["EU"])] == ["b"]
    assert [take.name for take in corpus.select(signers=["S1"])] == ["a"]
    assert len(corpus.select(kinds=["EU"], signers=["S1"])) == 0
    with pytest.raises(SignfaceError, match=r"no take of the kind IU. Its kinds are EU, IE"):
        corpus.select(kinds=["IU"])


def test_a_take_outside_the_corpus_is_not_written(folder, tmp_path_factory):
    other = tmp_path_factory.mktemp("other") / "c.c3d"
    other.write_bytes(b"x")
    with pytest.raises(SignfaceError, match="lies outside the corpus"):
        write_takes(folder, [TakeEntry(other, "S1", "IE")])
    assert not (folder / "takes.csv").exists()
