"""The main job: a recording in, an ELAN file out, from the command line and from Python."""

import itertools
import shutil

import numpy as np
import pympi
import pytest
from lxml import etree

from signface.cli.main import main
from signface.label.vocabulary import AFFECT, UNKNOWN


@pytest.fixture(scope="module")
def signer_eaf(signer_pose, tmp_path_factory):
    """The real signer's clip, annotated by the command line."""
    folder = tmp_path_factory.mktemp("signer")
    assert main(["annotate", str(signer_pose), "-o", str(folder / "out.eaf"), "--signer", "S1", "--figure"]) == 0
    return folder / "out.eaf"


def test_a_real_signer_becomes_a_valid_eaf_with_labelled_segments(signer_eaf, eaf_schema):
    eaf_schema.assertValid(etree.parse(str(signer_eaf)))
    rows = sorted(pympi.Eaf(str(signer_eaf)).get_annotation_data_for_tier("affect@S1"))
    known = AFFECT.including(UNKNOWN)
    assert all(row[2] in known.values or known.is_transition(row[2]) for row in rows)
    assert rows[0][0] == 0
    assert rows[-1][1] == pytest.approx(130 / 30 * 1000, abs=1)
    assert all(end == start for (_, end, *_), (start, *_) in itertools.pairwise(rows))


def test_of_a_real_signer_no_affect_is_named(signer_eaf):
    """The classifier that ships has met none: whatever it sees but rest, it does not know."""
    rows = pympi.Eaf(str(signer_eaf)).get_annotation_data_for_tier("affect@S1")
    stable = {row[2] for row in rows} & {*AFFECT.values, UNKNOWN}
    assert stable <= {"N", UNKNOWN}


def test_every_label_of_a_real_signer_has_a_confidence(signer_eaf):
    eaf = pympi.Eaf(str(signer_eaf))
    confidences = [float(row[2]) for row in eaf.get_ref_annotation_data_for_tier("affect-confidence@S1")]
    assert len(confidences) == len(eaf.get_annotation_data_for_tier("affect@S1"))
    assert all(0 <= confidence <= 1 for confidence in confidences)


def test_the_eaf_says_tool_model_take_and_residual(signer_eaf):
    properties = dict((name, value) for name, value in pympi.Eaf(str(signer_eaf)).properties)
    told = {name.removeprefix("signface:"): value for name, value in properties.items()}
    assert told["take"] == "dgs_example"
    assert told["model"] == "default"
    assert told["version"]
    assert 0 < float(told["residual_mm"]) < 10


def test_the_curves_lie_beside_the_eaf_and_are_linked(signer_eaf):
    assert (signer_eaf.parent / "out.curves.csv").is_file()
    assert (signer_eaf.parent / "out_tsconf.xml").is_file()
    linked = [row["LINK_URL"] for row in pympi.Eaf(str(signer_eaf)).linked_file_descriptors]
    assert len(linked) == 2
    assert (signer_eaf.parent / "out.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_several_takes_go_into_a_folder_and_a_bad_one_does_not_stop_the_others(mini, tmp_path, capsys):
    good = mini.takes[0].path
    bad = tmp_path / "bad.c3d"
    bad.write_bytes(good.read_bytes()[:700])
    status = main(["annotate", str(bad), str(good), "-o", str(tmp_path / "out")])
    shown = capsys.readouterr()
    assert status == 2
    assert "bad.c3d" in shown.err
    assert "1 of 2" in shown.err
    assert not (tmp_path / "out" / "bad.eaf").exists()
    assert pympi.Eaf(str(tmp_path / "out" / f"{good.stem}.eaf")).get_tier_names()


@pytest.mark.slow
def test_python_and_the_command_line_find_the_same(mini, tmp_path):
    from signface.annotation import annotate
    from signface.elan.reference import read_reference
    from signface.label.persistence import load_model
    from signface.takes.reading import read_recording

    take = mini.takes[0].path
    found = annotate(read_recording(take), load_model("default")).segments.table
    assert main(["annotate", str(take), "-o", str(tmp_path / "a.eaf")]) == 0
    written = read_reference(tmp_path / "a.eaf").table
    assert list(written["label"]) == list(found["label"])
    np.testing.assert_allclose(written["start_s"], found["start_s"], atol=0.5001e-3)


@pytest.mark.slow
def test_a_corrected_file_is_not_overwritten(mini, tmp_path, capsys):
    take, file = str(mini.takes[0].path), tmp_path / "a.eaf"
    assert main(["annotate", take, "-o", str(file)]) == 0
    assert main(["annotate", take, "-o", str(file)]) == 0  # our own, untouched: may be written again
    eaf = etree.parse(str(file))
    next(eaf.iter("ANNOTATION_VALUE")).text = "J"
    eaf.write(str(file))
    corrected, curves = file.read_bytes(), (tmp_path / "a.curves.csv").read_bytes()
    capsys.readouterr()
    assert main(["annotate", take, "-o", str(file)]) == 2
    assert "--replace" in capsys.readouterr().err
    assert file.read_bytes() == corrected
    assert (tmp_path / "a.curves.csv").read_bytes() == curves
    assert main(["annotate", take, "-o", str(file), "--replace"]) == 0
    assert any(path.read_bytes() == corrected for path in tmp_path.glob("a*bak*"))


def test_solve_then_segment_by_files(mini, tmp_path):
    take = str(mini.takes[0].path)
    assert main(["solve", take, "-o", str(tmp_path / "w.csv")]) == 0
    assert main(["segment", str(tmp_path / "w.csv"), "-o", str(tmp_path / "s.csv")]) == 0
    from signface.segmentation.segments import read_segments

    segments = read_segments(tmp_path / "s.csv")
    assert set(segments.table["kind"]) == {"stable", "transition"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--neutral", "500"], "outside the take"),
        (["--classifier", "nobody"], "nobody"),
        (["--face", "nobody"], "nobody"),
        (["--layout", "nobody"], "nobody"),
        (["--alpha", "2"], "alpha"),
        (["--alpha", "nan"], "alpha"),
        (["--method", "magic"], "magic"),
        (["--video", "missing.mp4"], "missing.mp4"),
    ],
)
def test_a_bad_option_is_one_clear_line_and_nothing_is_written(mini, tmp_path, capsys, words, said):
    status = main(["annotate", str(mini.takes[0].path), "-o", str(tmp_path / "out.eaf"), *words])
    shown = capsys.readouterr().err.strip()
    assert status == 2
    assert said in shown
    assert "\n" not in shown
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_an_output_folder_that_cannot_be_written_is_one_clear_line(mini, tmp_path, capsys):
    (tmp_path / "file").write_text("in the way")
    status = main(["annotate", str(mini.takes[0].path), "-o", str(tmp_path / "file" / "out.eaf")])
    assert status == 2
    assert "cannot be written" in capsys.readouterr().err


def test_two_takes_of_one_name_are_refused_before_anything_is_solved(mini, tmp_path, capsys):
    take = mini.takes[0].path
    (tmp_path / "other").mkdir()
    shutil.copy(take, tmp_path / "other" / take.name)
    status = main(["annotate", str(take), str(tmp_path / "other" / take.name), "-o", str(tmp_path / "out")])
    assert status == 2
    assert take.stem in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_start_of_the_recording_is_honoured(mini, tmp_path):
    """A take whose frame 0 is not the film's first: times in the EAF are the film's."""
    import dataclasses

    from signface.annotation import annotate
    from signface.label.persistence import load_model
    from signface.takes.reading import read_take

    take, model = read_take(mini.takes[0].path), load_model("default")
    early = annotate(take, model).segments.table
    late = annotate(dataclasses.replace(take, start=take.start + 12.5), model).segments.table
    assert list(late["label"]) == list(early["label"])
    np.testing.assert_allclose(late["start_s"], early["start_s"] + 12.5, atol=1e-6)
