"""The descriptors of a corpus on disk: exact, never stale, open to pandas and SQL, safe among several writers."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import threading
from dataclasses import replace

import duckdb
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from signface.cli.main import main
from signface.corpus.examples import solve_corpus
from signface.corpus.manifest import Corpus, TakeEntry, read_corpus, write_takes
from signface.corpus.origin import Origin, find_origin, make_recipe, take_name
from signface.corpus.store import DescriptorStore, open_store, read_provenance
from signface.descriptors import Descriptors
from signface.descriptors_files import read_weights, write_weights
from signface.elan.writing import write_eaf
from signface.errors import SignfaceError
from signface.files import bundled_corpus, shipped
from signface.settings.solve import SolveSettings
from tests.fixtures.hand_made import BASES, example, moving_face
from tests.fixtures.settings import different_settings


@pytest.fixture(scope="module")
def recipe():
    return make_recipe()


@pytest.fixture(scope="module")
def origin(recipe):
    return Origin("S1/laugh", "laugh.c3d", "S1", "EU", "0" * 64, None, None, recipe)


@pytest.fixture(scope="module")
def laugh():
    descriptors, _ = moving_face([np.zeros(12), np.full(12, 0.5)], noise=0.01, start=1 / 3, name="laugh")
    return replace(descriptors, history=("read laugh.c3d", "solved"))


def doubles(*shape):
    """Doubles of any bits: NaN of any payload, both zeros, infinities, the smallest."""
    return arrays.arrays(np.uint64, shape).map(lambda bits: bits.view(np.float64))


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    weights=doubles(7, 3),
    residual=doubles(7),
    head=doubles(7, 4, 4),
    rate=st.floats(1e-3, 1e5),
    start=st.floats(-1e6, 1e6),
    history=st.lists(st.text(max_size=20), max_size=3),
    names=st.sampled_from([("jawOpen", "a", "b"), ("take", "time_s", "head_00"), ("Ä", "residual_mm", "x y")]),
)
def test_what_is_stored_comes_back_to_the_last_bit(
    origin, tmp_path_factory, weights, residual, head, rate, start, history, names
):
    store = DescriptorStore(tmp_path_factory.mktemp("bits"))
    given_ = Descriptors(weights, names, rate, start, residual, head, "laugh", tuple(history))
    store.write(origin, given_)
    found = store.read(origin)
    for array in ("weights", "residual", "head"):
        assert getattr(found, array).tobytes() == getattr(given_, array).tobytes()
    assert (found.names, found.rate, found.start, found.name, found.history) == (
        names,
        rate,
        start,
        "laugh",
        tuple(history),
    )


def test_a_store_of_the_first_version_is_read(origin, nodding, tmp_path):
    """Its columns stood in another order, and its metadata said nothing of settings."""
    store = DescriptorStore(tmp_path)
    table = {"take": "S1/laugh", "signer": "S1", "kind": "EU", "time_s": nodding.time}
    table |= dict(zip(nodding.names, nodding.weights.T, strict=True)) | {"residual_mm": nodding.residual}
    table |= {f"head_{n // 4}{n % 4}": nodding.head.reshape(-1, 16)[:, n] for n in range(16)}
    about = {"format": 1, "key": origin.key, "bases": nodding.names, "rate": nodding.rate.hex()}
    about |= {"start": nodding.start.hex(), "name": nodding.name, "history": ["made"], "versions": {}}
    old = pa.Table.from_pandas(pd.DataFrame(table), preserve_index=False)
    store.path(origin).parent.mkdir(parents=True)
    pq.write_table(old.replace_schema_metadata({"signface": json.dumps(about)}), store.path(origin))
    assert store.read(origin) == nodding
    assert store.read(origin).history == ("made",)
    assert read_weights(store.path(origin)) == nodding


def test_the_same_descriptors_are_the_same_bytes(origin, laugh, tmp_path):
    files = [DescriptorStore(tmp_path / name).write(origin, laugh) for name in ("one", "other")]
    assert files[0].read_bytes() == files[1].read_bytes()


def test_one_line_of_pandas_and_one_of_sql_open_the_store(origin, laugh, tmp_path):
    store = DescriptorStore(tmp_path)
    cry = replace(origin, take="S2/cry", signer="S2", kind="IE")
    for own in (origin, cry):
        store.write(own, laugh)
    (store.path(origin).parent / ".cry-~elsewhere@1-abc.part").write_bytes(b"half wri")
    (folder,) = store.recipes()
    table = pd.read_parquet(folder)
    assert table["take"].value_counts().to_dict() == {"S1/laugh": laugh.n_frames, "S2/cry": laugh.n_frames}
    np.testing.assert_array_equal(table.loc[table["take"] == "S2/cry", list(BASES)], laugh.weights)
    rows = duckdb.sql(f"FROM '{folder}/**/*.parquet' SELECT signer, kind, max(time_s) GROUP BY ALL ORDER BY signer")
    assert rows.fetchall() == [("S1", "EU", laugh.time[-1]), ("S2", "IE", laugh.time[-1])]
    answer = store.query("SELECT count(*) AS frames FROM descriptors WHERE base0 > 0.2")
    assert answer["frames"].item() == 2 * int((laugh.weights[:, 0] > 0.2).sum())


@pytest.mark.parametrize(
    "change",
    [
        {"recording": "1" * 64},
        {"neutral_s": 0.5},
        {"start_s": 2.0},
        {"signer": "S2"},
        {"kind": "IE"},
        {"file": "laugh.trc"},
    ],
)
def test_descriptors_of_another_origin_are_never_used(origin, laugh, tmp_path, change):
    store = DescriptorStore(tmp_path)
    store.write(origin, laugh)
    assert store.read(replace(origin, **change)) is None
    assert store.read(origin) is not None


@pytest.mark.parametrize(
    "change",
    [
        *({item.name: value} for item, value in different_settings()),
        {"face_digest": "other"},
        {"layout_digest": "other"},
        {"solver": "other"},
    ],
    ids=lambda change: next(iter(change)),
)
def test_another_recipe_has_a_folder_of_its_own(origin, laugh, tmp_path, change):
    recipe = origin.recipe
    if next(iter(change)) in recipe.settings.as_dict():
        change = {"settings": recipe.settings.changed(**change)}
    other = replace(origin, recipe=replace(recipe, **change))
    store = DescriptorStore(tmp_path)
    store.write(origin, laugh)
    assert store.read(other) is None
    assert store.path(other).parents[1] != store.path(origin).parents[1]


def test_a_recipe_is_known_by_content_not_by_name(tmp_path):
    copy = tmp_path / "mine.csv"
    shutil.copy(shipped("layouts", ".csv")["default-40"], copy)
    assert make_recipe(SolveSettings(layout=str(copy))).digest == make_recipe(SolveSettings(layout="default-40")).digest
    copy.write_text(copy.read_text() + "\n")
    assert make_recipe(SolveSettings(layout=str(copy))).digest != make_recipe(SolveSettings(layout="default-40")).digest
    for missing in ({"face": "nobody"}, {"layout": "nobody"}):
        with pytest.raises(SignfaceError, match="nobody"):
            make_recipe(SolveSettings(**missing))


def test_a_recording_that_was_exported_again_is_another_origin(tmp_path, recipe, laugh):
    entry = TakeEntry(tmp_path / "S1" / "laugh.csv", "S1", "EU")
    write_weights(laugh, entry.path)
    before = find_origin(entry, tmp_path, recipe)
    write_weights(replace(laugh, weights=laugh.weights * 0.9), entry.path)
    after = find_origin(entry, tmp_path, recipe)
    assert before.key != after.key
    assert DescriptorStore(tmp_path).path(before) == DescriptorStore(tmp_path).path(after)
    assert before.recipe.settings is None  # weights have nothing to do with a face


def test_a_take_outside_the_corpus_has_a_place_in_the_store(tmp_path):
    assert take_name(TakeEntry(tmp_path / "x" / "a.c3d", "S", "K"), tmp_path / "corpus") == "up/x/a"


@pytest.mark.parametrize("harm", ["cut", "flipped", "foreign", "empty"])
def test_a_damaged_file_is_solved_again(origin, laugh, tmp_path, harm):
    store = DescriptorStore(tmp_path)
    file = store.write(origin, laugh)
    good = bytearray(file.read_bytes())
    middle = len(good) // 3
    harmed = {"cut": good[:-50], "flipped": good, "foreign": b"PAR1 nothing", "empty": b""}[harm]
    if harm == "flipped":
        good[middle] ^= 0xFF
    file.write_bytes(harmed)
    assert store.read(origin) is None
    with pytest.raises(SignfaceError, match=r"laugh\.parquet"):
        read_weights(file)
    store.write(origin, laugh)
    assert store.read(origin) is not None


def test_a_store_of_a_newer_version_is_refused_and_left_alone(origin, laugh, tmp_path):
    store = DescriptorStore(tmp_path)
    file = store.write(origin, laugh)
    table = pq.read_table(file, partitioning=None)
    about = json.loads(pq.read_metadata(file).metadata[b"signface"]) | {"format": 99}
    pq.write_table(table.replace_schema_metadata({"signface": json.dumps(about)}), file)
    newer = file.read_bytes()
    for attempt in (lambda: store.read(origin), lambda: DescriptorStore(tmp_path), lambda: open_store(tmp_path)):
        with pytest.raises(SignfaceError, match=r"newer signface.*nothing was changed|newer signface.*Update"):
            attempt()
    assert file.read_bytes() == newer


def test_a_reader_never_meets_half_a_file_among_several_writers(origin, tmp_path):
    store = DescriptorStore(tmp_path)
    made = [Descriptors(np.full((400, 20), value), tuple("abcdefghijklmnopqrst"), 100) for value in (1.0, 2.0)]
    store.write(origin, made[0])
    done = threading.Event()
    seen = []

    def read():
        while not done.is_set():
            found = store.read(origin)
            seen.append(None if found is None else set(np.unique(found.weights)))

    def write(descriptors):
        for _ in range(15):
            store.write(origin, descriptors)

    reader = threading.Thread(target=read)
    writers = [threading.Thread(target=write, args=[descriptors]) for descriptors in made]
    for thread in (reader, *writers):
        thread.start()
    for writer in writers:
        writer.join()
    done.set()
    reader.join()
    assert seen
    assert all(values in ({1.0}, {2.0}) for values in seen)
    assert [path.name for path in store.path(origin).parent.iterdir()] == ["laugh.parquet"]


def test_what_a_killed_writer_left_is_removed_and_what_a_living_one_writes_is_not(origin, laugh, tmp_path):
    import os
    import socket

    store = DescriptorStore(tmp_path)
    folder = store.write(origin, laugh).parent
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    left = folder / f".laugh-~{socket.gethostname()}@{dead.pid}-a1_b2c3d.part"
    living = folder / f".laugh-~{socket.gethostname()}@{os.getpid()}-a1_b2c3d.part"
    for part in (left, living):
        part.write_bytes(b"PAR1")
    store.clean()
    assert (left.exists(), living.exists()) == (False, True)


def test_training_and_evaluation_take_what_is_stored(tmp_path, laugh):
    made = example(["N", "J", "N"], take="joy", signer="S1", kind="EU")
    entry = TakeEntry(tmp_path / "joy.csv", "S1", "EU", annotation=tmp_path / "joy.eaf")
    write_weights(made.descriptors, entry.path)
    write_eaf(made.reference, entry.annotation, signer="S1")
    (first,) = solve_corpus(Corpus(tmp_path, (entry,)))
    store = open_store(tmp_path)
    own = find_origin(entry, tmp_path, make_recipe())
    assert store.read(own).weights.tobytes() == first.descriptors.weights.tobytes()
    store.write(own, replace(first.descriptors, history=("from the store",)))
    (second,) = solve_corpus(Corpus(tmp_path, (entry,)))
    assert second.descriptors.history == ("from the store",)
    assert read_provenance(store.path(own))["origin"]["recording"] == own.recording


@pytest.mark.slow
def test_a_solved_take_is_stored_exactly(mini, tmp_path):
    from signface.solver.solving import solve
    from signface.takes.reading import read_take

    take = mini.takes[1]
    for file in (take.path, take.annotation):
        (tmp_path / file.relative_to(mini.folder)).parent.mkdir(exist_ok=True)
        shutil.copy(file, tmp_path / file.relative_to(mini.folder))
    entry = replace(take, path=tmp_path / take.path.name, annotation=tmp_path / "reference" / take.annotation.name)
    write_takes(tmp_path, [entry])
    corpus = read_corpus(tmp_path)
    (solved,) = solve_corpus(corpus)
    (stored,) = solve_corpus(corpus)
    plain = solve(read_take(take.path), settings=SolveSettings(neutral=corpus.takes[0].neutral_s))
    for array in ("weights", "residual", "head"):
        expected = getattr(plain, array).tobytes()
        assert getattr(solved.descriptors, array).tobytes() == expected
        assert getattr(stored.descriptors, array).tobytes() == expected
    assert stored.descriptors.history == plain.history


def test_the_corpus_that_ships_is_never_written():
    assert open_store(bundled_corpus()) is None


def test_info_prints_the_lines_that_open_the_store_and_query_answers(tmp_path, laugh, capsys):
    entry = TakeEntry(tmp_path / "laugh.csv", "S1", "EU")
    write_weights(laugh, entry.path)
    write_takes(tmp_path, [entry])
    assert main(["corpus", "info", str(tmp_path)]) == 0
    assert "no descriptors are stored yet" in capsys.readouterr().out
    assert main(["corpus", "query", str(tmp_path), "SELECT 1"]) == 2
    assert "corpus run" in capsys.readouterr().err
    own = find_origin(entry, tmp_path, make_recipe())
    DescriptorStore(tmp_path).write(own, laugh)
    assert main(["corpus", "info", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    line = next(line for line in shown.splitlines() if "pandas.read_parquet" in line).split(": ", 1)[1]
    assert len(eval(line, {"pandas": pd})) == laugh.n_frames
    line = next(line for line in shown.splitlines() if "duckdb.sql" in line).split(": ", 1)[1]
    assert len(eval(line, {"duckdb": duckdb}).df()) == laugh.n_frames
    assert (
        main(["corpus", "query", str(tmp_path), "SELECT signer, count(*) AS n FROM descriptors GROUP BY signer"]) == 0
    )
    assert capsys.readouterr().out == f"signer,n\nS1,{laugh.n_frames}\n"
    assert main(["corpus", "query", str(tmp_path), "SELECT nonsense FROM descriptors"]) == 2
    assert "nonsense" in capsys.readouterr().err
