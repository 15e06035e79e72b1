"""The synthetic corpus: what it holds, that it is repeatable, and that it destroys nothing."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from signface.cli.main import main
from signface.corpus.manifest import read_corpus
from signface.descriptors_files import read_weights
from signface.elan.reference import read_reference
from signface.errors import SignfaceError
from signface.segmentation.segments import read_segments
from signface.synth.corpus import (
    MINI_SEED,
    RATE,
    TakeRequest,
    make_plan,
    make_signer,
    make_take,
    plan_corpus,
    plan_mini,
    synthesise,
)
from signface.synth.expressions import AFFECTS, Spread
from signface.synth.programme import UTTERANCES
from signface.takes.reading import read_take


@pytest.fixture(scope="module")
def mini(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("mini")
    synthesise(folder, mini=True)
    return folder


def files(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes(mini, tmp_path):
    make_signer.cache_clear()
    synthesise(tmp_path / "again", mini=True)
    first, second = files(mini), files(tmp_path / "again")
    assert first.keys() == second.keys()
    assert [name for name in first if first[name] != second[name]] == []


def test_the_shipped_corpus_is_what_the_command_makes(mini):
    shipped = Path(__file__).parents[2] / "corpora" / "mini"
    made = files(mini)
    assert set(made) <= set(files(shipped))
    for name in made:
        if name.endswith((".csv", ".json")):
            assert made[name].split() == (shipped / name).read_bytes().split()
        # Another processor may round the last bit of a position otherwise; what is shown must be the same.
        elif name.endswith(".c3d"):
            np.testing.assert_allclose(read_take(mini / name).positions, read_take(shipped / name).positions, atol=1e-2)


@pytest.mark.slow
def test_another_seed_gives_other_signers():
    takes = [make_take(TakeRequest(seed, 0, "EU", 5)).take for seed in (0, 1)]
    assert takes[0].n_frames != takes[1].n_frames
    heads = [make_signer(seed, signer, Spread()).head.face.mesh.vertices for seed, signer in [(0, 0), (0, 1), (1, 0)]]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        assert np.linalg.norm(heads[i] - heads[j], axis=1).mean() > 1.0


def test_more_signers_or_fewer_kinds_do_not_change_a_take():
    two, three = plan_corpus(signers=2), plan_corpus(signers=3)
    assert set(two) < set(three)
    assert set(plan_corpus(signers=2, kinds=["EU"])) < set(two)
    assert MINI_SEED not in {request.seed for request in two}


def test_a_corpus_has_the_takes_of_the_protocol():
    names = [request.name for request in plan_corpus(signers=2)]
    assert len(set(names)) == len(names) == 2 * (6 + 6 + 18)
    assert names[0] == "S1_IE_A"
    assert names[-1] == "S2_EU_18"


def test_isolated_expressions_return_to_neutral_five_times():
    for number, affect in enumerate(AFFECTS):
        request = TakeRequest(4, 0, "IE", number)
        plan = make_plan(request, make_signer(4, 0, Spread()).habits)
        assert [phase.affect for phase in plan.phases] == ["N", *[affect, "N"] * 5]
        assert {phase.intensity for phase in plan.phases if phase.affect != "N"} == {1, 2, 3}


def test_a_sequence_alternates_one_expression_with_each_other_one():
    plan = make_plan(TakeRequest(4, 0, "SE", 2), make_signer(4, 0, Spread()).habits)
    affects = [phase.affect for phase in plan.phases]
    assert affects[0] == affects[-1] == "N"
    assert affects[1:-1:2] == ["F"] * 6
    assert sorted(affects[2:-1:2]) == sorted(set(AFFECTS) - {"F"})


def test_an_utterance_is_signed_three_times_with_its_affects():
    for number, utterance in enumerate(UTTERANCES):
        plan = make_plan(TakeRequest(4, 1, "EU", number), make_signer(4, 1, Spread()).habits)
        once = [affect for affect, _ in utterance.affects]
        assert [phase.affect for phase in plan.phases] == ["N", *[*once, "N"] * 3]
        assert len(plan.clauses) == 3


@pytest.mark.slow
def test_recordings_come_back_from_c3d_in_millimetres(mini):
    for request in plan_mini():
        made = make_take(request).take
        read = read_take(mini / f"{request.name}.c3d")
        assert read.labels == made.labels
        assert read.rate == made.rate == RATE
        np.testing.assert_array_equal(np.isnan(read.positions), np.isnan(made.positions))
        np.testing.assert_allclose(read.positions, made.positions, atol=1e-3)


def test_forty_markers_on_the_face_and_six_on_the_head():
    from signface.face.layout_files import read_layout
    from signface.face.reading import read_face

    layout = read_layout("default-40", read_face("default"))
    take = make_take(plan_mini()[0]).take
    assert (len(layout.face_labels), len(layout.head_labels)) == (40, 6)
    assert set(take.labels) == set(layout.labels)


def test_reference_annotations_say_affect_and_intensity(mini):
    corpus = read_corpus(mini)
    for entry, request in zip(corpus, plan_mini()):
        table = read_reference(entry.annotation, entry.signer).table
        plan = make_plan(request, make_signer(request.seed, request.signer, Spread()).habits)
        stable = table[table["kind"] == "stable"]
        labels = [phase.affect for phase in plan.phases]
        merged = [label for i, label in enumerate(labels) if i == 0 or label != labels[i - 1]]
        assert list(stable["label"]) == merged
        moving = table[table["kind"] == "transition"]
        assert list(moving["label"]) == [a + b for a, b in itertools.pairwise(merged)]
        assert set(stable.loc[stable["label"] != "N", "intensity"]) <= {1, 2, 3}
        assert stable.loc[stable["label"] == "N", "intensity"].isna().all()


@pytest.mark.slow
def test_the_annotator_is_uncertain_by_tens_of_milliseconds():
    errors = []
    for request in plan_corpus(signers=1, seed=3, kinds=["IE"]):
        made = make_take(request)
        errors.extend(made.reference.table["start_s"][1:] - made.boundaries.table["start_s"][1:])
    assert 0.025 < np.std(errors) < 0.085
    assert np.abs(errors).max() < 0.25


def test_the_neutral_frame_is_at_rest_and_seen_by_all_cameras(mini):
    for entry in read_corpus(mini):
        take = read_take(entry.path)
        assert np.isfinite(take.positions[take.frame_at(entry.neutral_s)]).all()
        truth = read_weights(mini / "truth" / f"{entry.name}.parquet")
        assert truth.weights[take.frame_at(entry.neutral_s)].max() < 0.25
        label = read_reference(entry.annotation, entry.signer).table.iloc[0]
        assert label["label"] == "N"
        assert label["start_s"] <= entry.neutral_s <= label["end_s"]


def test_the_truth_is_kept_beside_every_take(mini):
    for entry in read_corpus(mini):
        take = read_take(entry.path)
        for ending in (".parquet", ".signer.parquet"):
            truth = read_weights(mini / "truth" / f"{entry.name}{ending}")
            assert truth.n_frames == take.n_frames
            assert len(truth.names) == 51
        boundaries = read_segments(mini / "truth" / f"{entry.name}.segments.csv")
        assert len(boundaries) == len(read_reference(entry.annotation, entry.signer))


@pytest.mark.slow
def test_the_command_writes_a_corpus_and_says_so(tmp_path, capsys):
    folder = tmp_path / "small"
    assert main(["synth", str(folder), "--mini"]) == 0
    assert "4 takes of 2 signers" in capsys.readouterr().out
    assert main(["synth", str(folder), "--mini"]) == 0  # its own corpus is made again
    assert len(read_corpus(folder)) == 4


def test_the_corpus_that_ships_has_its_own_seed_and_signers(tmp_path, capsys):
    assert main(["synth", str(tmp_path / "x"), "--mini", "--seed", "3"]) == 2
    assert "--mini has its own seed" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_a_folder_with_other_things_is_left_alone(tmp_path, capsys):
    (tmp_path / "thesis.tex").write_text("years of work")
    assert main(["synth", str(tmp_path), "--mini"]) == 2
    assert "is not empty and no synthetic corpus" in capsys.readouterr().err
    assert files(tmp_path) == {"thesis.tex": b"years of work"}


def test_a_corpus_of_other_settings_is_left_alone(mini):
    before = files(mini)
    with pytest.raises(SignfaceError, match="made with other settings"):
        synthesise(mini, signers=1, seed=5)
    assert files(mini) == before


@pytest.mark.slow
def test_what_an_annotator_corrected_is_never_overwritten(tmp_path):
    synthesise(tmp_path, mini=True)
    annotation = read_corpus(tmp_path).takes[0].annotation
    text = annotation.read_text(encoding="utf-8")
    annotation.write_text(text.replace(">J<", ">Su<", 1), encoding="utf-8")
    before = files(tmp_path)
    with pytest.raises(SignfaceError, match="was corrected since it was made"):
        synthesise(tmp_path, mini=True)
    assert files(tmp_path) == before


@pytest.mark.parametrize(
    ("settings", "part"),
    [
        ({"signers": 0}, "holds nothing"),
        ({"seed": -1}, "is negative"),
        ({"kinds": ["IE", "XX"]}, "unknown kind of take: XX"),
        ({"kinds": []}, "unknown kind of take: none"),
    ],
)
def test_impossible_settings_are_refused_before_anything_is_written(tmp_path, settings, part):
    with pytest.raises(SignfaceError, match=part):
        synthesise(tmp_path / "corpus", **settings)
    assert not (tmp_path / "corpus").exists()
