"""The tables, the report and the commands of a study's analysis."""

from __future__ import annotations

import argparse
import math
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import pandas as pd
import pytest

from signface.cli import study_analysis
from signface.errors import SignfaceError
from signface.report.study.report import report_html, write_report
from signface.study.reading import validate
from signface.study.statistics.analysis import Analysis, analyse
from signface.study.statistics.simulation import Effects, simulate, thesis_design
from signface.study.statistics.tables import StudyTable, as_latex, as_text, write_cell

#: What all of them share takes long to make.
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def study() -> Analysis:
    """Simulated answers of the thesis's first group with a planted effect."""
    effects = Effects({("LSTS70", "answer_intensity"): -0.6}, participants=0.5)
    return analyse(validate(simulate(thesis_design("group-1"), effects, participants=12, seed=6)), resamples=200)


@pytest.fixture(scope="module")
def real() -> Analysis:
    """The same without the mark, as a laboratory's answers would be."""
    table = simulate(thesis_design("group-2a"), participants=8, seed=2).drop(columns="simulated")
    return analyse(validate(table, name="answers <b>of</b> 2a.csv"), resamples=200)


def run(command: str, *words: str) -> int:
    parser = argparse.ArgumentParser()
    add, act = {
        "analyse": (study_analysis.add_analyse_arguments, study_analysis.run_analyse),
        "simulate": (study_analysis.add_simulate_arguments, study_analysis.run_simulate),
    }[command]
    add(parser)
    return act(parser.parse_args(list(words)))


class Page(HTMLParser):
    """Counts tags, checks that they close, and keeps what the page would fetch."""

    EMPTY = frozenset(("meta", "img", "link", "br", "hr", "input", "path", "use", "rect", "image"))

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.count: dict[str, int] = {}
        self.fetched: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.count[tag] = self.count.get(tag, 0) + 1
        self.fetched += [value for name, value in attrs if name in ("src", "href", "xlink:href") and value[:1] != "#"]
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in self.EMPTY:
            assert self.open.pop() == tag


@pytest.mark.slow
def test_every_table_of_the_thesis_has_its_form(study):
    references = " ".join(table.reference for table in study.tables)
    for number in (
        "6.2",
        "6.3",
        "6.4",
        "6.5",
        "6.6",
        "6.7",
        "6.8",
        "6.9",
        "A.1",
        "A.2",
        "A.3",
        "A.4",
        "A.5",
        "A.6",
        "A.7",
        "A.8",
    ):
        assert number in references
    means = study.table("means_by_method")
    assert means is not None
    table = study.responses.table
    first = means.frame.set_index("question").loc["intensity"]
    assert first["LSTS70"] == pytest.approx(table.loc[table["method"] == "LSTS70", "answer_intensity"].mean())


def test_the_planted_effect_is_what_the_summary_says(study):
    accuracy, intensity, ease, credibility = study.findings
    assert "LSTS30 is higher than LSTS70" in intensity
    assert "LSTS50 is higher than LSTS70" in intensity
    assert "LSTS30 is higher than LSTS50" not in intensity
    for sentence in (accuracy, ease, credibility):
        assert "no difference between the methods is shown" in sentence


def test_the_confusion_matrix_counts_every_answer_once(study):
    counted = sum(
        table.frame.drop(columns="played").to_numpy().sum()
        for table in study.tables
        if table.key.startswith("confusion_")
    )
    assert counted == len(study.responses.table)


def test_the_page_stands_alone_and_is_well_formed(study):
    page = Page(report_html(study))
    assert not page.open
    assert page.count["table"] == len(study.tables)
    assert page.count["svg"] == 4
    assert "script" not in page.count
    assert page.fetched == []


@pytest.mark.slow
def test_answers_of_nobody_are_marked_in_every_output(study, tmp_path):
    report = write_report(study, tmp_path)
    page = report.read_text(encoding="utf-8")
    assert "SIMULATED ANSWERS" in page
    assert page.count('class="badge"') == len(study.tables)
    for file in (tmp_path / "tables").glob("*.csv"):
        assert (pd.read_csv(file)["simulated"] == "yes").all()
    for file in (tmp_path / "tables").glob("*.tex"):
        assert "SIMULATED ANSWERS" in file.read_text(encoding="utf-8")


@pytest.mark.slow
def test_answers_of_people_are_not_marked(real, tmp_path):
    page = write_report(real, tmp_path).read_text(encoding="utf-8")
    assert "SIMULATED" not in page
    assert 'class="badge"' not in page
    for file in (tmp_path / "tables").glob("*.csv"):
        assert "simulated" not in pd.read_csv(file)


@pytest.mark.slow
def test_names_from_a_csv_cannot_put_markup_into_the_page(real):
    table = real.responses.table.replace({"method": {"FS": "<script>alert(1)</script>"}})
    page = report_html(analyse(validate(table, name="x.csv"), resamples=100), title="<i>study</i>")
    assert "<script>" not in page
    assert "<i>study" not in page
    assert "&lt;script&gt;" in page


@pytest.mark.slow
def test_methods_with_awkward_names_have_files_of_their_own(tmp_path):
    table = simulate(thesis_design("group-1"), participants=5).replace(
        {"LSTS30": "../x", "LSTS50": "..:x", "LSTS70": "$x" * 150}
    )
    analysis = analyse(validate(table.replace({"method": {"LSTS30": "../x"}})), resamples=100)
    write_report(analysis, tmp_path / "out")
    assert len(list((tmp_path / "out" / "tables").glob("confusion_*.csv"))) == 3
    assert {file.name for file in tmp_path.iterdir()} == {"out"}


@pytest.mark.slow
def test_two_runs_write_the_same_bytes(real, tmp_path):
    first, second = write_report(real, tmp_path / "a"), write_report(real, tmp_path / "b")
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.slow
def test_screenshots_are_put_into_the_page(real, tmp_path):
    dot = bytes.fromhex(
        "89504e470d0a1a0a0000000d4948445200000001000000010802000000907753de0000000c49444154789c63f8cfc0000003010100c9fe92ef"
        "0000000049454e44ae426082"
    )
    (tmp_path / "01_consent.png").write_bytes(dot)
    (tmp_path / "notes.txt").write_text("not a picture")
    page = report_html(real, screenshots=tmp_path)
    assert page.count("data:image/png;base64,") == 1
    assert "01 consent" in page
    with pytest.raises(SignfaceError, match="no such folder"):
        report_html(real, screenshots=tmp_path / "absent")
    (tmp_path / "empty").mkdir()
    with pytest.raises(SignfaceError, match="holds no picture"):
        report_html(real, screenshots=tmp_path / "empty")


def test_csv_tables_keep_their_numbers_unrounded(real, tmp_path):
    write_report(real, tmp_path)
    hypotheses = real.table("hypotheses")
    assert hypotheses is not None
    again = pd.read_csv(tmp_path / "tables" / "hypotheses.csv")
    assert again["p"].to_numpy() == pytest.approx(hypotheses.frame["p"].to_numpy(), rel=1e-12)


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="LaTeX is not installed")
def test_latex_tables_compile(real, tmp_path):
    body = "\n".join(as_latex(table) for table in real.tables)
    (tmp_path / "t.tex").write_text(
        "\\documentclass{article}\\usepackage[utf8]{inputenc}\\usepackage{booktabs}\\begin{document}"
        + body
        + "\\end{document}",
        encoding="utf-8",
    )
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "t.tex"], cwd=tmp_path, capture_output=True, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:]


def test_latex_escapes_what_latex_reads():
    table = StudyTable("k", "50 % of R&D", pd.DataFrame({"a_b": ["x^2 $ #1 {y}"], "p": [0.0001]}), {"p": "p"})
    text = as_latex(table)
    assert r"50 \% of R\&D" in text
    assert r"a\_b" in text
    assert r"x\textasciicircum{}2 \$ \#1 \{y\}" in text
    assert "$<$0.001" in text
    assert len(re.findall(r"(?<!\\)&", text)) == 2


def test_cells_are_written_as_a_reader_expects():
    assert [write_cell(p, "p") for p in (0.0004, 0.0498, 0.05, 0.6, math.nan)] == [
        "<0.001",
        "0.0498",
        "0.0500",
        "0.600",
        "–",
    ]
    assert write_cell(-0.0001, "effect") == "0.000"
    assert as_text(StudyTable("k", "T", pd.DataFrame({"q": ["a"], "x": [1.5]}))).splitlines()[-1] == "a  1.500"


@pytest.mark.slow
def test_from_a_design_to_a_report_by_command(tmp_path, capsys):
    answers = tmp_path / "answers.csv"
    run("simulate", "group-2b", "-o", str(answers), "--participants", "8", "--effect", "FS:fidelity=-1", "--seed", "3")
    assert "SIMULATED" in capsys.readouterr().out
    run("analyse", str(answers), "--resamples", "200", "--title", "Fidelity")
    out, err = capsys.readouterr()
    assert "SIMULATED ANSWERS" in err
    assert out.count("SIMULATED ANSWERS") == out.count("\n\n")
    assert (tmp_path / "answers-analysis" / "report.html").is_file()
    assert {file.suffix for file in (tmp_path / "answers-analysis" / "tables").iterdir()} == {".csv", ".tex"}
    assert not [file for file in Path(tmp_path).rglob(".*")]


@pytest.mark.parametrize(
    "words",
    [
        ("analyse", "absent.csv"),
        ("analyse", "absent.csv", "--alpha", "2"),
        ("analyse", "absent.csv", "--resamples", "3"),
        ("simulate", "group-9", "-o", "x.csv"),
        ("simulate", "group-1", "-o", "x.csv", "--effect", "LSTS30"),
        ("simulate", "group-1", "-o", "x.csv", "--effect", "LSTS30:colour=1"),
        ("simulate", "group-1", "-o", "x.csv", "--spread", "-1"),
    ],
)
def test_commands_say_in_a_line_what_to_mend(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SignfaceError) as found:
        run(*words)
    assert found.value.hint
    assert not (tmp_path / "x.csv").exists()
