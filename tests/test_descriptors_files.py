"""Weights files: Parquet to the last bit, csv as its plain view, and the files of older versions."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from signface.cli.main import main
from signface.columns import POSE
from signface.descriptors import Descriptors
from signface.descriptors_files import WeightsWriter, read_weights, write_weights
from signface.elan.annotators import read_tiers
from signface.errors import SignfaceError
from signface.settings.solve import SolveSettings
from signface.takes.formats.c3d import write_c3d
from signface.takes.reading import read_take

WEIGHTS = arrays(np.float64, st.tuples(st.integers(2, 8), st.integers(1, 4)), elements=st.floats(-1, 2))


def descriptors(weights, rate=200.0, start=0.0, **fields):
    names = tuple(f"base{i}" for i in range(np.shape(weights)[1]))
    return Descriptors(np.asarray(weights), names, rate, start, **fields)


@settings(deadline=None, max_examples=25)
@given(WEIGHTS, st.sampled_from([24.0, 29.97, 30.0, 60.0, 120.0, 200.0]), st.floats(0, 4000))
@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_a_weights_file_gives_back_what_was_written(tmp_path_factory, ending, weights, rate, start):
    file = tmp_path_factory.mktemp("weights") / f"take{ending}"
    written = descriptors(weights, rate, start, residual=np.arange(len(weights), dtype=float))
    write_weights(written, file)
    back = read_weights(file)
    assert back.names == written.names
    np.testing.assert_allclose(back.weights, written.weights, atol=1e-6)
    np.testing.assert_allclose(back.residual, written.residual)
    assert abs(back.start - start) < 1e-6
    assert back.rate == pytest.approx(rate, abs=2e-3)


def test_frames_that_could_not_be_solved_stay_unknown(tmp_path):
    weights = np.array([[0.0, 1.0], [np.nan, np.nan], [0.5, 0.5]])
    write_weights(descriptors(weights), tmp_path / "w.csv")
    np.testing.assert_array_equal(np.isnan(read_weights(tmp_path / "w.csv").weights), np.isnan(weights))


def test_a_weights_file_has_the_columns_of_the_contract(tmp_path):
    write_weights(descriptors(np.zeros((3, 2))), tmp_path / "w.csv")
    assert (tmp_path / "w.csv").read_text().splitlines()[0] == (
        "time_s,base0,base1,head_x_mm,head_y_mm,head_z_mm,head_rx_deg,head_ry_deg,head_rz_deg,residual_mm"
    )


@pytest.mark.parametrize(
    ("content", "wrong"),
    [
        ("", "cannot be read"),
        ("a,b,c\n1,2,3\n", "is not a weights file"),
        ("time_s,jawOpen,residual_mm\n0,0,0\n", "fewer than two frames"),
        ("time_s,jawOpen,residual_mm\n0,0,0\n0,0,0\n", "do not rise evenly"),
        ("time_s,jawOpen,residual_mm\n0,0,0\n1,x,0\n", "not numbers"),
        ("time_s,jawOpen,residual_mm\n0,0,0\n0.1,0,0\n9,0,0\n", "do not rise evenly"),
        ("time_s,head_x_mm,residual_mm\n0,0,0\n0.1,0,0\n", "has no base"),
    ],
)
def test_a_bad_weights_file_is_one_clear_line(tmp_path, content, wrong):
    file = tmp_path / "w.csv"
    file.write_text(content)
    with pytest.raises(SignfaceError, match=wrong) as error:
        read_weights(file)
    assert str(file) in str(error.value)
    assert "\n" not in str(error.value)


def test_other_endings_are_refused(tmp_path):
    with pytest.raises(SignfaceError, match=r"\.csv or \.parquet"):
        write_weights(descriptors(np.zeros((2, 1))), tmp_path / "w.xlsx")


def doubles(*shape):
    """Doubles of any bits: NaN of any payload, both zeros, infinities, the smallest."""
    return arrays(np.uint64, shape).map(lambda bits: bits.view(np.float64))


@settings(max_examples=25, deadline=None)
@given(
    weights=doubles(7, 3),
    residual=doubles(7),
    head=doubles(7, 4, 4),
    deviation=st.none() | doubles(7, 3),
    rate=st.floats(1e-3, 1e5),
    start=st.floats(-1e6, 1e6),
    history=st.lists(st.text(max_size=20), max_size=3),
    names=st.sampled_from([("jawOpen", "a", "b"), ("take", "time_s", "head_00"), ("sd:a", "residual_mm", "base:x y")]),
    chosen=st.none() | st.builds(SolveSettings, alpha=st.floats(0, 1), neutral=st.floats(0, 9)),
)
def test_parquet_keeps_all_to_the_last_bit(
    tmp_path_factory, weights, residual, head, deviation, rate, start, history, names, chosen
):
    file = tmp_path_factory.mktemp("bits") / "another name.parquet"
    written = Descriptors(
        weights, names, rate, start, residual, head, "laugh", tuple(history), deviation=deviation, settings=chosen
    )
    write_weights(written, file)
    back = read_weights(file)
    for array in ("weights", "residual", "head", "deviation"):
        bits = [getattr(take, array) for take in (back, written)]
        assert bits[0] is bits[1] is None or bits[0].tobytes() == bits[1].tobytes()
    assert (back.names, back.rate, back.start, back.name) == (names, rate, start, "laugh")
    assert (back.history, back.settings) == (tuple(history), chosen)


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.tuples(*[st.floats(-3, 3)] * 3, *[st.floats(-900, 900)] * 3), min_size=2, max_size=6),
    st.integers(0, 5),
)
def test_csv_keeps_the_pose_of_the_head(tmp_path_factory, motions, unknown):
    file = tmp_path_factory.mktemp("poses") / "w.csv"
    head = np.tile(np.eye(4), (len(motions), 1, 1))
    head[:, :3, :3] = Rotation.from_rotvec([motion[:3] for motion in motions]).as_matrix()
    head[:, :3, 3] = [motion[3:] for motion in motions]
    head[unknown:] = np.nan
    write_weights(descriptors(np.zeros((len(motions), 2)), head=head), file)
    back = read_weights(file).head
    np.testing.assert_allclose(back[:, :3, :3], head[:, :3, :3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(back[:, :3, 3], head[:, :3, 3], rtol=0, atol=1e-6)


def test_a_csv_opens_in_pandas_without_a_word(nodding, tmp_path):
    write_weights(nodding, tmp_path / "w.csv")
    table = pd.read_csv(tmp_path / "w.csv", index_col="time_s")
    pd.testing.assert_frame_equal(table, nodding.to_frame(), rtol=0, atol=1e-6, check_names=True)


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_files_of_older_versions_have_a_head_that_does_not_move(ending, tmp_path):
    table = pd.DataFrame(
        {"time_s": [0.5, 0.52, 0.54], "jawOpen": [0.0, np.nan, 1.0], "take": [0.1, 0.2, 0.3], "residual_mm": 0.2}
    )
    file = tmp_path / f"old{ending}"
    table.to_csv(file, index=False) if ending == ".csv" else table.to_parquet(file)
    old = read_weights(file)
    assert (old.names, old.rate, old.start, old.name) == (("jawOpen", "take"), 50.0, 0.5, "old")
    np.testing.assert_array_equal(old.weights, table[["jawOpen", "take"]])
    np.testing.assert_array_equal(old.head, np.tile(np.eye(4), (3, 1, 1)))


def test_a_parquet_whose_rows_were_chosen_has_the_times_of_its_rows(nodding, tmp_path):
    file = tmp_path / "w.parquet"
    write_weights(nodding, file)
    metadata = {b"signface": pq.read_metadata(file).metadata[b"signface"]}
    pq.write_table(pq.read_table(file).slice(20, 50).replace_schema_metadata(metadata), file)
    part = read_weights(file)
    assert part == replace(nodding.between(0.4, 1.4), name="w")


def test_a_parquet_that_went_through_pandas_keeps_its_head(nodding, tmp_path):
    file = tmp_path / "w.parquet"
    write_weights(nodding, file)
    pd.read_parquet(file).to_parquet(file)
    np.testing.assert_array_equal(read_weights(file).head, nodding.head)


def test_settings_of_another_version_are_unknown(nodding, tmp_path):
    file = tmp_path / "w.parquet"
    write_weights(replace(nodding, settings=SolveSettings(alpha=0.2)), file)
    about = json.loads(pq.read_metadata(file).metadata[b"signface"])
    about["settings"]["a setting to come"] = 1
    pq.write_table(pq.read_table(file).replace_schema_metadata({"signface": json.dumps(about)}), file)
    assert read_weights(file) == nodding
    assert read_weights(file).settings is None


def test_pieces_of_which_one_has_no_deviations_are_refused(nodding, tmp_path):
    sure = replace(nodding, deviation=nodding.weights)

    def write():
        with WeightsWriter(tmp_path / "w.parquet") as writer:
            writer.append(sure)
            writer.append(nodding)

    with pytest.raises(SignfaceError, match="different bases"):
        write()
    assert list(tmp_path.iterdir()) == []


def test_the_last_piece_tells_the_history_of_the_take(nodding, tmp_path):
    with WeightsWriter(tmp_path / "w.parquet") as writer:
        writer.append(nodding.between(0, 1))
        writer.append(replace(nodding.between(1, 2), history=("all of it",)))
    back = read_weights(tmp_path / "w.parquet")
    assert back == nodding
    assert back.history == ("all of it",)


def test_columns_of_a_parquet_are_those_of_the_csv_but_for_the_pose(nodding, tmp_path):
    for ending in (".csv", ".parquet"):
        write_weights(nodding, tmp_path / f"w{ending}")
    exact, plain = pq.read_schema(tmp_path / "w.parquet").names, pd.read_csv(tmp_path / "w.csv").columns
    assert [name for name in exact if not name.startswith("head_")] == [name for name in plain if name not in POSE]
    assert pq.read_schema(tmp_path / "w.parquet").field("jawOpen").type == pa.float64()


@pytest.fixture(scope="module")
def nodding_take(mini, tmp_path_factory):
    """A recording of a signer who nods and then tilts the head, and its tiers with all channels."""
    take = read_take(next(entry.path for entry in mini.takes if entry.path.stem == "M2_EU_04"))
    pitch = np.where(take.time < 3, 8 * np.sin(4 * np.pi * take.time), 0)
    roll = 15 * np.clip(take.time - 4, 0, 1)
    turn = Rotation.from_euler("zx", np.stack([roll, pitch], axis=1), degrees=True).as_matrix()
    folder = tmp_path_factory.mktemp("nods")
    turned = take.positions @ turn.transpose(0, 2, 1)
    write_c3d(take.changed("nods", positions=turned), folder / "nods.c3d")
    return folder / "nods.c3d", tiers_of(folder / "nods.c3d", folder)


def tiers_of(source, folder):
    assert main(["annotate", str(source), "-o", str(folder / "a.eaf"), "--channels", "--replace"]) == 0
    return read_tiers(folder / "a.eaf")


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_weights_annotate_like_the_take_they_were_solved_from(ending, nodding_take, tmp_path):
    take, tiers = nodding_take
    assert main(["solve", str(take), "-o", str(tmp_path / f"w{ending}")]) == 0
    again = tiers_of(tmp_path / f"w{ending}", tmp_path)
    assert again.keys() == tiers.keys()
    for name, table in tiers.items():
        pd.testing.assert_frame_equal(table, again[name])
    assert {"nod", "tilt"} <= {label.split()[0].split("-")[0] for label in tiers["head"]["label"]}
