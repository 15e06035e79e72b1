"""The command line as a shell: help, versions, statuses, and that help imports nothing heavy."""

import subprocess
import sys

import pytest

from signface.cli.main import COMMANDS, main


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(command, capsys):
    with pytest.raises(SystemExit) as left:
        main([command, "--help"])
    shown = capsys.readouterr().out
    assert left.value.code == 0
    assert "example" in shown
    assert f"signface {command}" in shown.split("example", 1)[1]


def test_help_imports_nothing_heavy():
    code = (
        "import sys\nfrom signface.cli.main import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "print(sorted({'numpy', 'scipy', 'pandas', 'sklearn', 'matplotlib', 'lxml'} & set(sys.modules)))"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert shown.strip().splitlines()[-1] == "[]"


def test_no_command_shows_the_help(capsys):
    assert main([]) == 0
    assert "annotate" in capsys.readouterr().out


def test_version_is_the_package_version(capsys):
    from importlib.metadata import version

    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip() == f"signface {version('signface')}"


def test_an_unknown_command_is_named(capsys):
    with pytest.raises(SystemExit) as left:
        main(["anotate"])
    assert left.value.code == 2
    assert "anotate" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        (["anotate"], "annotate"),
        (["study", "analyze"], "analyse"),
        (["evaluate", "corpus", "-o", "report", "--protocol", "acros"], "across"),
        (["study", "analyse", "answers.csv", "--resample5", "200"], "--resamples"),
    ],
)
def test_a_word_that_is_nearly_right_is_answered_with_the_right_one(line, meant, capsys):
    with pytest.raises(SystemExit) as left:
        main(line)
    assert left.value.code == 2
    assert f"Did you mean {meant}?" in capsys.readouterr().err


def test_a_word_like_no_other_is_answered_without_a_guess(capsys):
    with pytest.raises(SystemExit):
        main(["zzz"])
    assert "Did you mean" not in capsys.readouterr().err


def test_what_a_user_can_mend_is_one_line_without_traceback(tmp_path, capsys):
    status = main(["take", "info", str(tmp_path / "missing.c3d")])
    shown = capsys.readouterr().err
    assert status == 2
    assert shown.count("\n") == 1
    assert "missing.c3d" in shown
    assert "Traceback" not in shown


def test_a_closed_pipe_is_no_defect(tmp_path):
    code = "import sys; from signface.cli.main import main; sys.exit(main(['--help']))"
    shown = subprocess.run(
        f'"{sys.executable}" -c "{code}" | head -n 1', shell=True, capture_output=True, text=True, check=False
    )
    assert shown.stdout.startswith("usage")
    assert "Traceback" not in shown.stderr
