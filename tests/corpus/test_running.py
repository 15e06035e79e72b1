"""A whole corpus, solved and annotated: wherever it was stopped, on cores or on a cluster, with the same bytes."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from lxml import etree
from pympi.Elan import Eaf

from signface.annotation import find_clause
from signface.channels.rules import find_channels, read_channels
from signface.cli.main import main
from signface.corpus.cluster import WorkerDied, on_cluster, on_cores
from signface.corpus.jobs import BEFORE, CORRECTED, DONE, FAILED
from signface.corpus.manifest import Corpus, TakeEntry, read_corpus, write_takes
from signface.corpus.origin import take_name
from signface.corpus.running import run_corpus
from signface.descriptors_files import read_weights, write_weights
from signface.errors import SignfaceError
from signface.label.persistence import load_model, save_model
from signface.learn.training import train
from signface.settings.eaf import EafOptions
from signface.settings.solve import SolveSettings
from signface.signer import Signer
from tests.conftest import REPOSITORY
from tests.fixtures.hand_made import corpus as hand_made_corpus
from tests.fixtures.training import quick

TAKES = 24


@pytest.fixture(scope="module")
def ready(tmp_path_factory):
    """A corpus of 24 takes of weights, and a classifier that fits them: it runs in seconds and solves nothing."""
    folder = tmp_path_factory.mktemp("ready")
    examples = hand_made_corpus()
    entries = []
    for made in examples:
        path = folder / "feel" / made.signer / f"{made.take}.csv"
        write_weights(made.descriptors, path)
        entries.append(TakeEntry(path, made.signer, made.kind))
    write_takes(folder / "feel", entries)
    save_model(train(examples, quick("knn1")), folder / "mine.skops")
    assert len(entries) == TAKES
    return folder


@pytest.fixture
def feel(ready, tmp_path):
    """A fresh copy of the corpus."""
    shutil.copytree(ready / "feel", tmp_path / "feel")
    return tmp_path / "feel"


@pytest.fixture(scope="module")
def undisturbed(ready, tmp_path_factory):
    """A corpus and every file of a run that nothing disturbed; tests run it again in the same place."""
    feel = tmp_path_factory.mktemp("undisturbed") / "feel"
    shutil.copytree(ready / "feel", feel)
    assert states(run_here(feel, ready)) == [DONE]
    whole = written(feel)
    assert len(whole) == TAKES * 5  # .eaf, .pfsx, curves, their description, descriptors
    return feel, whole


def forget_run(feel):
    """Remove what a run made."""
    for made in ("annotated", "descriptors"):
        shutil.rmtree(feel / made)


def run_here(corpus, ready, **options):
    """States of the takes of a run with two workers."""
    outcomes = run_corpus(read_corpus(corpus), classifier=str(ready / "mine.skops"), workers=2, **options)
    return {outcome.take: outcome for outcome in outcomes}


def states(outcomes):
    return sorted({outcome.state for outcome in outcomes.values()})


def written(corpus) -> dict[str, bytes]:
    """Every file that a run made but the logs, which hold the time of day."""
    made = [path for part in ("annotated", "descriptors") for path in (corpus / part).rglob("*") if path.is_file()]
    return {str(path.relative_to(corpus)): path.read_bytes() for path in made if "logs" not in path.parts}


def finished(corpus) -> set[str]:
    """Takes whose log says that they are done."""
    logs = (corpus / "annotated" / "logs").rglob("[!.]*.log")
    return {log.stem for log in logs if log.read_text().splitlines()[-1].startswith("done ")}


def wait_until(condition, process, seconds=90):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it took too long"
        assert process.poll() is None, process.communicate()
        time.sleep(0.005)


def start_run(corpus, ready, *options):
    """`signface corpus run` as a process of its own."""
    command = [sys.executable, "-m", "signface.cli.main", "corpus", "run", str(corpus), "--classifier"]
    command += [str(ready / "mine.skops"), *(options or ("--workers", "2"))]
    return subprocess.Popen(command, cwd=REPOSITORY, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.slow
def test_a_run_that_was_killed_goes_on_and_ends_with_the_same_bytes(undisturbed, ready):
    feel, whole = undisturbed
    forget_run(feel)
    process = start_run(feel, ready)
    wait_until(lambda: len(finished(feel)) >= 5, process)
    process.kill()  # SIGKILL
    told = re.findall(r"annotating: (\d+) of", process.communicate(timeout=20)[1])
    before = finished(feel)
    assert 5 <= len(before) < TAKES
    assert max(map(int, told), default=0) <= len(before)  # nothing that was told to be done is lost
    times = {path: path.stat().st_mtime_ns for path in feel.rglob("*.eaf") if path.stem in before}
    after = run_here(feel, ready)
    repeated = {Path(take).stem for take, outcome in after.items() if outcome.state == DONE}
    assert not repeated & before
    assert states(after) == [BEFORE, DONE]
    assert all(path.stat().st_mtime_ns == time for path, time in times.items())
    assert written(feel) == whole


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_ends_with_the_same_bytes(undisturbed, ready):
    from distributed import LocalCluster

    feel, whole = undisturbed
    forget_run(feel)
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        victim = next(iter(cluster.workers.values())).pid
        process = start_run(feel, ready, "--scheduler", cluster.scheduler_address)
        wait_until(lambda: len(finished(feel)) >= 4, process)
        os.kill(victim, signal.SIGKILL)
        assert len(finished(feel)) < TAKES
        out, err = process.communicate(timeout=90)
    assert process.returncode == 0, err
    # What the lost worker had done and not yet told is asked for again, and found done.
    done, before, failed = map(int, re.search(r"(\d+) annotated.* (\d+) done before.* (\d+) failed", out).groups())
    assert (done + before, failed) == (TAKES, 0)
    assert written(feel) == whole


@pytest.mark.slow
def test_the_second_run_has_nothing_to_do_and_a_new_export_is_done_alone(feel, ready):
    run_here(feel, ready)
    assert states(run_here(feel, ready)) == [BEFORE]
    take = feel / "S1" / "S1-EU-J.csv"
    take.write_bytes((feel / "S2" / "S2-EU-J.csv").read_bytes())
    again = {take for take, outcome in run_here(feel, ready).items() if outcome.state == DONE}
    assert again == {"S1/S1-EU-J"}


@pytest.mark.slow
def test_what_an_annotator_corrected_stays_as_it_is(feel, ready, capsys):
    run_here(feel, ready)
    eaf = feel / "annotated" / "S1" / "S1-IE-J.eaf"
    tree = etree.parse(str(eaf))
    next(tree.iter("ANNOTATION_VALUE")).text = "Su"
    tree.write(str(eaf))
    corrected = eaf.read_bytes()
    (feel / "S1" / "S1-IE-J.csv").write_bytes(
        (feel / "S2" / "S2-IE-J.csv").read_bytes()
    )  # there is cause to do it again
    outcomes = run_here(feel, ready)
    assert outcomes["S1/S1-IE-J"].state == CORRECTED
    assert eaf.read_bytes() == corrected
    words = ["corpus", "run", str(feel), "--classifier", str(ready / "mine.skops"), "--workers", "2"]
    assert main(words) == 0
    assert "1 corrected by hand and left alone" in capsys.readouterr().out


@pytest.mark.slow
def test_takes_that_fail_are_told_and_stop_no_other(feel, ready, capsys):
    (feel / "S1" / "S1-IE-A.csv").write_text("nonsense")
    (feel / "S2" / "S2-EU-D.csv").write_bytes(b"")
    (feel / "annotated" / "S2").mkdir(parents=True)
    (feel / "annotated" / "S2" / "S2-IE-F.eaf").mkdir()  # a folder where a file should go
    words = ["corpus", "run", str(feel), "--classifier", str(ready / "mine.skops"), "--workers", "2"]
    assert main(words) == 2
    shown = capsys.readouterr()
    assert f"{TAKES - 3} annotated" in shown.out
    lines = [line for line in shown.err.splitlines() if line.startswith("signface: ")]
    assert len(lines) == 2
    assert any("S1-IE-A.csv" in line for line in lines)
    assert any("S2-EU-D.csv" in line and "empty" in line for line in lines)
    log = (feel / "annotated" / "logs" / "S1" / "S1-IE-A.log").read_text()
    assert log.endswith("failed\n")
    assert "S1-IE-A.csv" in log


@pytest.mark.slow
def test_two_runs_do_not_work_in_one_folder(feel, ready):
    first = run_corpus(read_corpus(feel), classifier=str(ready / "mine.skops"), workers=2)
    next(first)
    with pytest.raises(SignfaceError, match="another run is at work"):
        next(run_corpus(read_corpus(feel), classifier=str(ready / "mine.skops"), workers=2))
    assert len(list(first)) == TAKES - 1


def test_what_cannot_begin_is_one_clear_error_and_writes_nothing(feel, ready):
    corpus, mine = read_corpus(feel), str(ready / "mine.skops")
    takes = corpus.takes
    twin = TakeEntry(takes[0].path.with_suffix(".parquet"), "S1", "IE")
    for attempt, said in (
        ({"classifier": "nobody"}, "nobody"),
        ({"classifier": mine, "settings": SolveSettings(face="nobody")}, "nobody"),
        ({"classifier": mine, "output": takes[0].path / "out"}, "cannot be written"),
    ):
        with pytest.raises(SignfaceError, match=said):
            list(run_corpus(corpus, **attempt))
    with pytest.raises(SignfaceError, match="would both be written"):
        list(run_corpus(Corpus(feel, (*takes, twin)), classifier=mine))
    assert not (feel / "annotated").exists()
    assert not (feel / "descriptors").exists()


def test_without_dask_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(SignfaceError, match=r"distributed is not installed.*signface\[cluster\]"):
        next(on_cluster(abs, [1], scheduler="tcp://127.0.0.1:9"))


@pytest.mark.slow
def test_without_a_scheduler_at_the_address_there_is_one_clear_error(feel, ready, monkeypatch):
    monkeypatch.setattr("signface.corpus.cluster.PATIENCE_S", 1.0)
    with pytest.raises(SignfaceError, match="no Dask scheduler answers"):
        list(run_corpus(read_corpus(feel), classifier=str(ready / "mine.skops"), scheduler="tcp://127.0.0.1:9"))


@pytest.mark.slow
def test_a_failed_take_is_tried_again(feel, ready):
    take = feel / "S1" / "S1-IE-A.csv"
    good = take.read_bytes()
    take.write_bytes(b"")
    assert run_here(feel, ready)["S1/S1-IE-A"].state == FAILED
    take.write_bytes(good)
    assert run_here(feel, ready)["S1/S1-IE-A"].state == DONE


def die_of_seven(number: int) -> int:
    """Square a number; seven is deadly."""
    if number == 7:
        os.kill(os.getpid(), signal.SIGKILL)
    return number**2


@pytest.mark.slow
def test_a_job_that_kills_its_process_fails_alone():
    found = dict(on_cores(die_of_seven, list(range(20)), workers=2))
    assert isinstance(found.pop(7), WorkerDied)
    assert found == {number: number**2 for number in range(20) if number != 7}


@pytest.mark.slow
def test_channels_doubts_and_the_template_of_a_lab_are_written_as_annotate_writes_them(feel, ready, tmp_path):
    """And what is written otherwise is written again, but not solved again."""
    manifest = feel / "takes.csv"
    manifest.write_text("".join(manifest.read_text().splitlines(keepends=True)[:3]))
    run = ["corpus", "run", str(feel), "--classifier", str(ready / "mine.skops"), "--workers", "1"]
    assert main(run) == 0
    how = ["--channels", "--doubtful", "0.9"]
    assert main([*run, *how]) == 0
    annotated = next((feel / "annotated").rglob("*.eaf"))
    tiers = {tier.get("TIER_ID") for tier in etree.parse(annotated).getroot().iterfind("TIER")}
    assert {"affect@S1", "intensity@S1"} <= tiers
    assert any("doubt" in name for name in tiers)
    assert main([*run, "--template", str(annotated)]) == 0  # a template may be any .eaf
    assert main(["corpus", "run", str(feel), "--doubtful", "7"]) == 2
    assert main([*run, "--template", str(tmp_path / "none.etf")]) == 2
    states_after = [outcome.state for outcome in run_corpus(read_corpus(feel), classifier=str(ready / "mine.skops"))]
    assert set(states_after) == {DONE}


def test_a_further_model_gets_its_tier_in_every_take(feel, ready, tmp_path):
    """And a run that had none is done again, but not solved again."""
    other = tmp_path / "other.skops"
    normalised = train(hand_made_corpus(), quick("knn1").changed(normalise="signer"))
    save_model(normalised, other)
    assert states(run_here(feel, ready)) == [DONE]
    again = run_here(feel, ready, clauses=[str(other)])
    assert states(again) == [DONE]
    assert not any(outcome.solved for outcome in again.values())
    assert states(run_here(feel, ready, clauses=[str(other)])) == [BEFORE]
    model = load_model(other)
    made = list(read_corpus(feel))
    of_one = [read_weights(entry.path) for entry in made if entry.signer == made[0].signer]
    signer = Signer(made[0].signer).with_level(of_one)
    expected = find_clause(of_one[0], model, signer=signer).segments.table
    eaf = Eaf(str(feel / "annotated" / f"{take_name(made[0], feel)}.eaf"))
    told = eaf.get_annotation_data_for_tier(f"affect-other@{made[0].signer}")
    assert [row[2] for row in told] == expected["label"].tolist()
    assert [row[0] for row in told] == pytest.approx((expected["start_s"] * 1000).tolist(), abs=1)


def test_the_rules_of_channels_know_the_level_of_a_signer_of_the_corpus(feel, ready, tmp_path):
    """As in `annotate` of all takes of a signer."""
    made = list(read_corpus(feel))
    entries = [entry for entry in made if entry.signer == made[0].signer]
    takes = [read_weights(entry.path) for entry in entries]
    signer = Signer(made[0].signer).with_level(takes)
    (feel / "signers").mkdir()
    signer.save(feel / "signers" / f"{signer.name}.json")
    table = tmp_path / "channels.toml"
    thresholds = ("on = 0.5", "off = 0.4", "min_ms = 40")
    rows = ("[brows.raised]", 'bases = ["base0"]', *thresholds, "[brows.raised.signer]", "on = 0.1", "off = 0.05")
    table.write_text("\n".join(rows), "utf-8")
    run_here(feel, ready, options=EafOptions(channels=table))
    rules = read_channels(table)
    known, alone = (
        [find_channels(take, rules, level=level)[0].table for take in takes] for level in (signer.level, None)
    )
    assert any(len(a) != len(b) for a, b in zip(known, alone, strict=True))  # it matters
    for entry, found in zip(entries, known, strict=True):
        eaf = Eaf(str(feel / "annotated" / f"{take_name(entry, feel)}.eaf"))
        told = sorted(eaf.get_annotation_data_for_tier(f"brows@{signer.name}"))
        assert [row[0] for row in told] == pytest.approx((found["start_s"] * 1000).tolist(), abs=1)
