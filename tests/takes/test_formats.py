"""The registry of formats: what is declared is read, also from outside the package, and the content decides."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from signface.cli.main import main
from signface.descriptors import Descriptors
from signface.errors import SignfaceError, SignfaceWarning
from signface.takes.formats import registry
from signface.takes.formats.c3d import write_c3d
from signface.takes.formats.registry import SHIPPED, FileHead, register_format, supported_formats
from signface.takes.formats.table import write_table
from signface.takes.reading import open_recording, read_recording, read_take, recognise
from signface.takes.recording import TakeFile
from signface.takes.take import Take
from tests.fixtures.takes_files import moving_face

TAKE, _ = moving_face(0.2, 60.0, face_markers=3, seed=1)
RECORDINGS_PAGE = Path(__file__).parents[2] / "docs" / "recordings.md"


@pytest.fixture(autouse=True)
def only_shipped_formats_remain(monkeypatch):
    supported_formats()
    monkeypatch.setattr(registry, "_formats", dict(registry._formats))


def documented_blocks():
    """The blocks of code of the page on recordings."""
    blocks = re.findall(r"((?:^ {4}.*\n|^\n)+)", RECORDINGS_PAGE.read_text("utf-8"), re.MULTILINE)
    return [re.sub(r"^ {4}", "", block, flags=re.MULTILINE).strip("\n") + "\n" for block in blocks if block.strip()]


def documented(sign):
    """The one block of the page that has this in it."""
    (block,) = (block for block in documented_blocks() if sign in block)
    return block


def installed(folder, name, reader):
    """A package with a reader in `folder`, as pip leaves it there."""
    package = folder / f"{name}-1.0.dist-info"
    package.mkdir()
    (folder / f"{name}.py").write_text(reader)
    (package / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}-package\nVersion: 1.0\n")
    (package / "entry_points.txt").write_text(f"[{registry.ENTRY_POINTS}]\n{name} = {name}\n")


def command(folder, *words, before=""):
    """What the command line prints where the packages of `folder` are installed."""
    program = f"import sys; sys.path.insert(0, {str(folder)!r}); {before}from signface.cli.main import main; main()"
    return subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True, check=True)


@pytest.fixture
def facedots(tmp_path, monkeypatch):
    """A file of the documented format, and its reader as a module that can be imported."""
    (tmp_path / "facedots.py").write_text(documented("@register_format"))
    (tmp_path / "smile.dots").write_text(next(block for block in documented_blocks() if block.startswith("FACEDOTS")))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "facedots", raising=False)
    return tmp_path / "smile.dots"


def test_the_documented_reader_reads_the_documented_file(facedots):
    with pytest.raises(SignfaceError, match=r"of no format that signface reads.* must be installed"):
        read_take(facedots)
    __import__("facedots")
    assert recognise(facedots) == "facedots"
    opened = open_recording(facedots)
    assert isinstance(opened, TakeFile)  # read in pieces, as the others are
    take = read_take(facedots)
    assert take.labels == ("LBRO", "RBRO")
    assert take.rate == 100.0
    np.testing.assert_allclose(take.positions[0], [[-31.2, 40.1, 80.0], [30.8, 40.3, 80.2]])
    assert np.isnan(take.positions[1, 1]).all()
    assert read_take(facedots, unit="m").positions[0, 0, 2] == 80000.0
    assert take.history[0] == "read smile.dots (Facedots)"


def test_the_documented_reader_refuses_damaged_files_with_one_clear_line(facedots, capsys):
    __import__("facedots")
    lines = facedots.read_text().splitlines()
    for damaged in (lines[:1], lines[:2], [*lines, "3 4"], [*lines[:2], "a b c d e f"], ["FACEDOTS words", *lines[1:]]):
        facedots.write_text("\n".join(damaged))
        assert main(["take", "info", str(facedots)]) == 2
        printed = capsys.readouterr().err
        assert printed.startswith(f"signface: {facedots}: "), printed
        assert printed.count("\n") == 1


@pytest.mark.slow
def test_the_command_line_reads_a_format_that_an_installed_package_brings(facedots, tmp_path):
    project = tomllib.loads(documented("[build-system]"))
    assert project["project"]["entry-points"][registry.ENTRY_POINTS] == {"facedots": "facedots"}
    assert project["tool"]["setuptools"]["py-modules"] == ["facedots"]
    installed(tmp_path, "facedots", documented("@register_format"))
    assert "3 frames at 100 Hz" in command(tmp_path, "take", "info", str(facedots)).stdout
    assert "written by our lab's own program" in command(tmp_path, "take", "info", "--formats").stdout


CLAIMS_TABLES = """
from signface.takes.formats.registry import register_format
from signface.takes.take import Take

@register_format({name!r}, recognise=lambda head: 0.7 * bool(head.cells))
def open_it(path, *, unit=None):
    return Take([[[0.0, 0, 0]]] * {frames}, ("NOSE",), 25.0)
"""


@pytest.mark.slow
@pytest.mark.parametrize("before", ["", "import ours; "], ids=["installed", "and imported"])
def test_among_equals_a_scripts_reader_goes_before_an_installed_one_and_that_before_a_shipped_one(tmp_path, before):
    write_table(TAKE, tmp_path / "take.csv")
    installed(tmp_path, "ours", CLAIMS_TABLES.format(name="ours", frames=5))
    words = ("take", "info", str(tmp_path / "take.csv"))
    assert "5 frames at 25 Hz" in command(tmp_path, *words, before=before).stdout
    (tmp_path / "script.py").write_text(CLAIMS_TABLES.format(name="theirs", frames=7))
    assert "7 frames at 25 Hz" in command(tmp_path, *words, before=f"import script; {before}").stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    "reader",
    ["import absent_module", "this is no Python", r"raise RuntimeError('two\nlines')"],
    ids=["absent", "syntax", "error"],
)
def test_an_installed_reader_that_is_broken_is_named_and_other_files_are_read(tmp_path, reader):
    write_table(TAKE, tmp_path / "take.csv")
    installed(tmp_path, "broken", reader)
    for words in (("take", "info", str(tmp_path / "take.csv")), ("take", "info", "--formats")):
        result = command(tmp_path, *words)
        assert result.stdout
        assert result.stderr.startswith("signface: note: the reader broken of the installed package broken-package")
        assert result.stderr.count("\n") == 1


def test_the_scripts_of_the_page_run():
    names = {"__name__": "script"}
    for sign in ("stabilise(take", "cleaning_stages("):
        exec(compile(documented(sign), "docs/recordings.md", "exec"), names)
    assert names["still"].n_frames == len(names["head_poses"]) == 1184
    assert names["positions"].shape == (200, len(names["layout"].labels), 3)


def test_the_surest_format_opens_a_file_and_among_equals_the_one_declared_last(tmp_path):
    write_table(TAKE, tmp_path / "take.csv")

    def declare(name, certainty):
        @register_format(name, recognise=lambda head: certainty * bool(head.cells), written_by="a test")
        def read(path, *, unit=None):
            return TAKE.changed(name)

    for name, certainty, expected in (
        ("doubtful", 0.1, "table"),
        ("sure", True, "sure"),
        ("equally-sure", 1.0, "equally-sure"),
        ("impossible", False, "equally-sure"),
    ):
        declare(name, certainty)
        assert recognise(tmp_path / "take.csv") == expected
    assert read_take(tmp_path / "take.csv").history[-1] == "equally-sure"
    write_c3d(TAKE, tmp_path / "take.c3d")
    assert recognise(tmp_path / "take.c3d") == "c3d"


def test_a_format_declared_again_replaces_the_shipped_one(tmp_path):
    @register_format("c3d", recognise=lambda head: head.content[1:2] == b"\x50", title="our C3D")
    def read_ours(path, *, unit=None):
        return TAKE

    write_c3d(TAKE, tmp_path / "take.c3d")
    assert read_recording(tmp_path / "take.c3d") is TAKE
    assert [format.title for format in supported_formats()].count("our C3D") == 1
    assert "C3D" not in [format.title for format in supported_formats()]


def test_one_careless_recogniser_does_not_keep_other_files_from_being_read(tmp_path):
    @register_format("careless", recognise=lambda head: int(head.lines[7].split()[3]))
    def read(path, *, unit=None):
        raise AssertionError

    write_c3d(TAKE, tmp_path / "take.c3d")
    assert recognise(tmp_path / "take.c3d") == "c3d"


def test_a_recogniser_with_a_defect_is_named_and_other_files_are_read(tmp_path):
    @register_format("defective", recognise=lambda head: head.no_such_thing)
    def read(path, *, unit=None):
        raise AssertionError

    write_c3d(TAKE, tmp_path / "take.c3d")
    with pytest.warns(SignfaceWarning, match="the reader of defective cannot look at .*take.c3d"):
        assert recognise(tmp_path / "take.c3d") == "c3d"


def test_a_format_that_holds_weights_is_not_solved_in_a_corpus(tmp_path):
    from signface.corpus.manifest import TakeEntry
    from signface.corpus.origin import find_origin, make_recipe, weights_recipe

    @register_format("words", recognise=lambda head: head.text.startswith("WEIGHTS"), holds="weights")
    def read(path, *, unit=None):
        return Descriptors(np.zeros((2, 1)), ("jawOpen",), 25.0)

    (tmp_path / "laugh.txt").write_text("WEIGHTS 0 0\n")
    origin = find_origin(TakeEntry(tmp_path / "laugh.txt", "S1", "EU"), tmp_path, make_recipe())
    assert origin.recipe == weights_recipe()


def test_every_shipped_format_says_what_it_is_and_errors_and_help_list_them(tmp_path, capsys):
    formats = supported_formats()
    assert list(dict.fromkeys(format.open.__module__ for format in formats)) == list(SHIPPED)
    assert all(format.title and format.written_by and format.endings for format in formats)
    with pytest.raises(SystemExit) as left:
        main(["take", "info", "--formats"])
    assert left.value.code == 0
    listed = capsys.readouterr().out
    (tmp_path / "diary.txt").write_text("Dear diary,\n")
    with pytest.raises(SignfaceError) as refused:
        recognise(tmp_path / "diary.txt")
    for format in formats:
        assert f"{format.name} " in listed
        assert format.written_by in listed
        assert format.title in str(refused.value)


def test_no_reader_is_surest_of_another_readers_file(tmp_path):
    """Of the shipped formats exactly one is surest of each file: the order of declaring decides nothing."""
    heads = [
        b"PathFileType\t4\t(X/Y/Z)\tx.trc\nNO_OF_MARKERS\t2\n",
        b"NO_OF_MARKERS\t2\nMARKER_NAMES\ta\tb\n",
        b"time_s,a_x,a_y,a_z,residual_mm\n",
        b"Trajectories\n100\n,,a,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n1,0,1,2,3\n",
        b"Format Version,1.23,Capture Frame Rate,100,Length Units,Meters\n\n,Type,Marker\n,Name,a\n",
        b"Timecode,BlendshapeCount,a_x,b_y,residual_mm\n",
        b"\nPathFileType\t4\n",
        b"\x02\x50" + bytes(100),
    ]
    for content in heads:
        certainties = sorted(format.certainty(FileHead(Path("x"), content)) for format in supported_formats())
        assert certainties[-1] > certainties[-2]


def test_listing_formats_imports_nothing_that_only_one_of_them_needs():
    program = (
        "import sys; from signface.takes.formats.registry import supported_formats; supported_formats();"
        "print([name for name in ('ezc3d', 'pose_format', 'pandas', 'pyarrow', 'scipy') if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_a_take_is_a_valid_answer_of_a_reader(tmp_path):
    @register_format("still", recognise=lambda head: head.text.startswith("STILL"))
    def read(path, *, unit=None):
        return Take(np.zeros((3, 2, 3)), ("a", "b"), 25.0)

    (tmp_path / "x.bin").write_text("STILL")
    assert read_take(tmp_path / "x.bin").n_frames == 3
