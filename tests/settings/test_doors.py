"""Every door knows every setting, and all doors give one answer for the same take, model, signer and settings."""

from __future__ import annotations

import argparse
import importlib
import io
import json
import sys
from dataclasses import fields

import numpy as np
import pandas as pd
import pytest
from lxml import etree

from signface.annotation import annotate
from signface.cli.main import main
from signface.cli.options import settings_from
from signface.corpus.examples import solve_corpus
from signface.corpus.levels import learn_signers
from signface.corpus.manifest import TakeEntry, read_corpus, write_takes
from signface.elan.recogniser import read_parameters
from signface.elan.reference import read_reference
from signface.files import bundled_corpus
from signface.label.persistence import load_model, save_model
from signface.learn.examples import signer_levels
from signface.learn.training import train
from signface.settings.eaf import EafOptions
from signface.settings.laboratory import read_settings
from signface.settings.solve import SolveSettings
from signface.settings.training import TrainingSettings
from signface.signer import Signer
from signface.solver.solving import solve
from signface.takes.reading import read_take
from tests.conftest import REPOSITORY
from tests.fixtures.settings import another_value, different_settings

#: Command and action, and what of a decision it states otherwise.
SOLVING = [
    ("annotate", None, ()),
    ("solve", None, ()),
    ("segment", None, ()),
    ("calibrate", None, ()),
    ("train", None, ()),
    ("evaluate", None, ()),
    ("corpus", "run", ()),
    ("corpus", "check", ()),
    ("corpus", "signers", ()),
    ("elan", "learn", ()),
    ("study", "render", ("method", "alpha")),  # --methods names several of both
]
TRAINING = [
    ("train", None, ()),
    ("evaluate", None, ("classifier",)),  # --classifiers names several
    ("elan", "learn", ()),
]
WRITING = [("annotate", None, ()), ("corpus", "run", ())]


def parser_of(command: str, action: str | None) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser()
    importlib.import_module(f"signface.cli.{command}").add_arguments(parser)
    if action is None:
        return parser
    (actions,) = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    return actions.choices[action]


@pytest.mark.parametrize(
    ("command", "action", "without", "kind"),
    [(*door, SolveSettings) for door in SOLVING]
    + [(*door, TrainingSettings) for door in TRAINING]
    + [(*door, EafOptions) for door in WRITING],
)
def test_every_door_knows_every_setting(command, action, without, kind):
    known = {option.dest: option for option in parser_of(command, action)._actions}
    assert "settings" in known
    for item in fields(kind):
        if item.name not in without:
            assert f"{kind.TABLE}_{item.name}" in known, f"{command} {action or ''} has no option for {item.name}"


@pytest.mark.parametrize(("item", "value"), [(i.name, v) for i, v in different_settings(without=())])
def test_a_setting_of_the_command_line_counts_before_the_laboratorys(tmp_path, item, value):
    plain = SolveSettings()
    file = tmp_path / "lab.toml"
    written = SolveSettings(**{item: value})
    file.write_text(f"[solve]\n{item} = {json.dumps(written.as_dict()[item])}\n")
    assert read_settings(file).solve == written
    parser = parser_of("solve", None)
    (option,) = (a for a in parser._actions if a.dest == f"solve_{item}")
    text = ",".join(value) if isinstance(value, tuple) else str(value)
    words = [option.option_strings[0]] + ([] if option.nargs == 0 else [text])
    common = ["take.c3d", "-o", "w.csv"]
    assert settings_from(parser.parse_args([*common, *words]), SolveSettings) == written
    assert settings_from(parser.parse_args([*common, "--settings", str(file)]), SolveSettings) == written
    assert settings_from(parser.parse_args(common), SolveSettings) == plain
    other = {"neutral": "1.25"}.get(item)
    if other is not None:
        both = parser.parse_args([*common, "--settings", str(file), option.option_strings[0], other])
        assert settings_from(both, SolveSettings).neutral == 1.25


@pytest.mark.parametrize("kind", [SolveSettings, TrainingSettings, EafOptions])
def test_settings_go_through_plain_values_and_tell_each_other_apart(kind):
    plain = kind()
    digests = {plain.digest}
    for item, value in different_settings(kind, without=()):
        other = plain.changed(**{item.name: value})
        assert other != plain
        assert list(other.chosen) == [item.name]
        assert kind.from_dict(json.loads(json.dumps(other.as_dict()))) == other
        digests.add(other.digest)
    assert len(digests) == 1 + len(fields(kind))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[solve]\nalhpa = 1", "did you mean alpha"),
        ("[solve]\nalpha = 'much'", "alpha is no number"),
        ("[slove]\nalpha = 1", "no table"),
        ("alpha = 1", "no table"),
        ("[solve", "TOML"),
        ("[train]\nclassifier = 'forrest'", "did you mean forest"),
        ("[eaf]\ndoubtful = 2", "from 0 to 1"),
    ],
)
def test_a_wrong_laboratory_file_is_one_clear_line(tmp_path, capsys, text, said):
    file = tmp_path / "lab.toml"
    file.write_text(text)
    assert main(["solve", "take.c3d", "-o", str(tmp_path / "w.csv"), "--settings", str(file)]) == 2
    error = capsys.readouterr().err
    assert "lab.toml" in error
    assert said.lower() in error.lower()
    assert error.count("\n") == 1


# One answer: a model that normalises signers needs the signer's level, whichever door the take comes through.


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    """A corpus of the bundled takes, a model that normalises signers, settings and a signer's file."""
    folder = tmp_path_factory.mktemp("laboratory")
    mini = read_corpus(bundled_corpus())
    for name in ("M2_EU_04.c3d", "M2_SE_A.c3d"):
        (folder / name).write_bytes((bundled_corpus() / name).read_bytes())
    write_takes(folder, [TakeEntry(folder / name, "M2", "EU") for name in ("M2_EU_04.c3d", "M2_SE_A.c3d")])
    settings = SolveSettings(alpha=0.4, cutoff_hz=9.0)
    examples = solve_corpus(mini, settings=settings)
    model = train(
        examples,
        TrainingSettings(normalise="signer", calibrate=False),
        solve=settings,
        name="normalised",
    )
    save_model(model, folder / "model.skops")
    (folder / "lab.toml").write_text("[solve]\nalpha = 0.4\ncutoff_hz = 9.0\n")
    corpus = read_corpus(folder)
    for signer in learn_signers(corpus, settings):
        signer.save(folder / "M2.json")
    return folder


def labels(path) -> list[tuple[float, float, str]]:
    table = read_reference(path, "M2").table
    return [(round(row.start_s, 3), round(row.end_s, 3), row.label) for row in table.itertuples()]


@pytest.mark.slow
def test_all_doors_give_one_answer(laboratory, tmp_path):
    take, model, settings = laboratory / "M2_EU_04.c3d", laboratory / "model.skops", laboratory / "lab.toml"
    common = ["--classifier", str(model), "--settings", str(settings)]
    signer = Signer.read(laboratory / "M2.json")
    found = annotate(read_take(take), load_model(model), settings=read_settings(settings).solve, signer=signer)
    script = [(round(r.start_s, 3), round(r.end_s, 3), r.label) for r in found.segments.table.itertuples()]

    alone = tmp_path / "alone.eaf"
    file = ["--signer", "M2", "--signer-file", str(laboratory / "M2.json")]
    assert main(["annotate", str(take), "-o", str(alone), *common, *file]) == 0
    both = [str(take), str(laboratory / "M2_SE_A.c3d")]
    assert main(["annotate", *both, "-o", str(tmp_path / "both"), "--signer", "M2", *common]) == 0
    assert main(["corpus", "run", str(laboratory), "-o", str(tmp_path / "run"), "--workers", "1", *common]) == 0
    weights = tmp_path / "weights.parquet"
    assert main(["solve", str(take), "-o", str(weights), "--settings", str(settings), *file[2:]]) == 0
    solved = tmp_path / "solved.eaf"
    assert main(["annotate", str(weights), "-o", str(solved), *common, *file]) == 0

    for path in (alone, tmp_path / "both" / "M2_EU_04.eaf", tmp_path / "run" / "M2_EU_04.eaf", solved):
        assert labels(path) == script, path
    assert recognised(laboratory, tmp_path) == [label for _, _, label in script]


def recognised(laboratory, tmp_path) -> list[str]:
    """Labels that the recogniser writes for ELAN."""
    parameters = {
        "take": laboratory / "M2_EU_04.c3d",
        "classifier": laboratory / "model.skops",
        "settings": laboratory / "lab.toml",
        "signer_file": laboratory / "M2.json",
        "tiers": tmp_path / "tiers.xml",
    }
    xml = "".join(f'<param name="{name}">{value}</param>' for name, value in parameters.items())
    document = f"<PARAM>{xml}</PARAM>".encode()
    assert read_parameters(document)[0]["take"] == str(parameters["take"])
    stdin = sys.stdin
    sys.stdin = io.TextIOWrapper(io.BytesIO(document))
    try:
        assert main(["elan", "recognise"]) == 0
    finally:
        sys.stdin = stdin
    tiers = etree.parse(str(tmp_path / "tiers.xml")).getroot()
    return [span.findtext("v") for span in tiers.iter("span")]


@pytest.mark.slow
def test_a_model_that_meets_another_solve_says_so(laboratory, tmp_path, capsys):
    take, model = laboratory / "M2_EU_04.c3d", laboratory / "model.skops"
    assert main(["annotate", str(take), "-o", str(tmp_path / "a.eaf"), "--classifier", str(model)]) == 0
    said = capsys.readouterr().err
    assert "solved otherwise" in said
    assert "alpha the usual instead of 0.4" in said
    same = ["--alpha", "0.4", "--cutoff", "9"]
    assert main(["annotate", str(take), "-o", str(tmp_path / "b.eaf"), "--classifier", str(model), *same]) == 0
    assert "otherwise" not in capsys.readouterr().err


@pytest.mark.slow
def test_a_signers_bases_count_at_every_door(laboratory, tmp_path):
    face_bases = pd.DataFrame(
        [("jawOpen", f"M{i:02d}", 0.0, -9.0, 1.0) for i in range(40)], columns=["base", "marker", "x", "y", "z"]
    )
    take = read_take(laboratory / "M2_EU_04.c3d")
    face_bases["marker"] = [label for label in take.labels if not label.startswith("HEAD")][:40]
    file = tmp_path / "bases.csv"
    face_bases.to_csv(file, index=False)
    signer = Signer.read(file, name="M2")
    plain, with_bases = solve(take), solve(take, signer=signer)
    assert np.abs(plain.weights - with_bases.weights).max() > 1e-3
    output = tmp_path / "w.parquet"
    assert main(["solve", str(laboratory / "M2_EU_04.c3d"), "-o", str(output), "--signer-bases", str(file)]) == 0
    np.testing.assert_allclose(
        pd.read_parquet(output)[list(plain.names)].to_numpy(), with_bases.weights, rtol=0, atol=1e-9
    )
    folder = tmp_path / "corpus"
    (folder / "signers").mkdir(parents=True)
    (folder / "t.c3d").write_bytes((laboratory / "M2_EU_04.c3d").read_bytes())
    (folder / "signers" / "M2.csv").write_bytes(file.read_bytes())
    (folder / "t.eaf").write_bytes((bundled_corpus() / "reference" / "M2_EU_04.eaf").read_bytes())
    write_takes(folder, [TakeEntry(folder / "t.c3d", "M2", "EU", annotation=folder / "t.eaf")])
    (example,) = solve_corpus(read_corpus(folder))
    np.testing.assert_allclose(example.descriptors.weights, with_bases.weights, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_a_signers_file_is_read_to_the_last_bit(laboratory, tmp_path):
    signer = Signer.read(laboratory / "M2.json")
    again = Signer.read(signer.save(tmp_path / "again.json"))
    assert again.level_digest == signer.level_digest != ""
    np.testing.assert_array_equal(again.level.mean, signer.level.mean)
    for text in ("", "[]", "{}", '{"name": 1, "level": {"names": ["a"], "mean": [1, 2], "spread": [0]}}'):
        (tmp_path / "bad.json").write_text(text)
        with pytest.raises(Exception, match="no signer's file"):
            Signer.read(tmp_path / "bad.json")


@pytest.mark.slow
def test_another_value_is_another(laboratory):
    for kind in (SolveSettings, TrainingSettings, EafOptions):
        for item in fields(kind):
            assert getattr(kind(), item.name) != another_value(item)


@pytest.mark.slow
def test_the_level_of_a_corpuss_signer_counts_where_its_takes_are_learnt_from(laboratory, tmp_path):
    folder = tmp_path / "corpus"
    (folder / "signers").mkdir(parents=True)
    (folder / "t.c3d").write_bytes((laboratory / "M2_EU_04.c3d").read_bytes())
    (folder / "t.eaf").write_bytes((bundled_corpus() / "reference" / "M2_EU_04.eaf").read_bytes())
    write_takes(folder, [TakeEntry(folder / "t.c3d", "M2", "EU", annotation=folder / "t.eaf")])
    (alone,) = solve_corpus(read_corpus(folder))
    (folder / "signers" / "M2.json").write_bytes((laboratory / "M2.json").read_bytes())
    (known,) = solve_corpus(read_corpus(folder))
    level = Signer.read(laboratory / "M2.json").level
    assert alone.level is None
    np.testing.assert_array_equal(signer_levels([known])["M2"].mean, level.mean)
    assert np.abs(signer_levels([alone])["M2"].mean - level.mean).max() > 1e-3


def test_the_manual_lists_every_setting():
    text = (REPOSITORY / "docs" / "files.md").read_text(encoding="utf-8")
    for kind in (SolveSettings, TrainingSettings, EafOptions):
        for item in fields(kind):
            flag = item.metadata["flag"] or f"--{item.name.replace('_', '-')}"
            assert f"| `[{kind.TABLE}]` | `{item.name}` | `{flag}` |" in text
            assert item.metadata["help"] in text


@pytest.mark.slow
def test_what_makes_labels_differ_is_said(laboratory, tmp_path, capsys):
    take, known = str(laboratory / "M2_EU_04.c3d"), str(laboratory / "M2.json")
    common = [
        "annotate",
        take,
        "--classifier",
        str(laboratory / "model.skops"),
        "--replace",
        "-o",
        str(tmp_path / "a.eaf"),
    ]
    lab = ["--settings", str(laboratory / "lab.toml")]
    assert main([*common, *lab]) == 0
    assert "of this signer only M2_EU_04 is known" in capsys.readouterr().err
    assert main([*common, *lab, "--signer-file", known]) == 0
    assert "note" not in capsys.readouterr().err
    assert main([*common, "--signer-file", known, "--signer", "Eva"]) == 0
    notes = capsys.readouterr().err
    assert "M2.json is of M2, and the tiers will be called after Eva" in notes
    assert "the signer's level is of takes solved otherwise" in notes
