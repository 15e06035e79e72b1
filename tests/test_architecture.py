"""The house as docs/architecture.md draws it: arrows point down, no circles, results know nothing of finders."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter

import pytest

from tests.conftest import REPOSITORY

PACKAGE = REPOSITORY / "signface"

#: Rooms and the modules at the top of the package, each of which may import those before it.
FLOORS = [
    "errors",
    "files",
    "progress",
    "extras",
    "compiling",
    "frames",
    "trust",
    "content",
    "columns",
    "marker_names",
    "timecode",
    "settings",
    "descriptors",
    "head",
    "face",
    "signer_level",
    "signer",
    "descriptors_files",
    "takes",
    "segmentation",
    "channels",
    "label",
    "sequence",
    "learn",
    "metrics",
    "solver",
    "elan",
    "annotation",
    "evaluation",
    "corpus",
    "synth",
    "render",
    "placement",
    "study",
    "report",
    "datasets",
    "cli",
    "__main__",
]

#: Rooms that read results and must not know how they are found.
RESULTS_ONLY = {
    "elan": (
        "channels.rules",
        "channels.head",
        "label.labelling",
        "segmentation.energy",
        "segmentation.cutting",
        "solver",
    ),
    "metrics": ("label", "learn", "evaluation", "solver"),
    "settings": ("solver", "label", "elan", "learn"),
    "report": ("cli", "solver"),
}


@cache
def modules() -> dict[str, ast.Module]:
    """Every module of the package and its syntax tree."""
    files = PACKAGE.rglob("*.py")
    return {_name(file.relative_to(REPOSITORY).with_suffix("").parts): ast.parse(file.read_text()) for file in files}


def _name(parts: tuple[str, ...]) -> str:
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(name: str) -> Iterator[str]:
    """The modules of ours that a module imports, those for types and those inside functions included."""
    for node in ast.walk(modules()[name]):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("signface"):
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield whole if whole in modules() else node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in modules())


def room(name: str) -> str:
    return name.split(".")[1] if "." in name else name


@pytest.mark.slow
def test_no_arrow_points_up():
    upward = [
        f"{name} imports {other}"
        for name in modules()
        for other in imports(name)
        if "signface" not in (room(name), room(other)) and FLOORS.index(room(other)) > FLOORS.index(room(name))
    ]
    assert upward == []


def test_there_are_no_circles_of_modules():
    graph = {name: set(imports(name)) - {name} for name in modules()}
    assert len(list(TopologicalSorter(graph).static_order())) == len(graph)  # raises CycleError


@pytest.mark.parametrize("reader", RESULTS_ONLY)
def test_rooms_that_read_results_do_not_know_how_they_are_found(reader):
    forbidden = tuple(f"signface.{name}" for name in RESULTS_ONLY[reader])
    known = [
        f"{n} imports {o}"
        for n in modules()
        if room(n) == reader
        for o in imports(n)
        if f"{o}.".startswith(tuple(f"{name}." for name in forbidden))
    ]
    assert known == []


def test_every_room_is_described_and_every_described_room_stands():
    text = (REPOSITORY / "docs" / "architecture.md").read_text(encoding="utf-8")
    described = {name.rstrip("/") for name in re.findall(r"^\| `signface/([a-z_]+)(?:\.py)?/?`", text, flags=re.M)}
    rooms = {room(name) for name in modules()} - {"signface", "__main__"}
    assert described == rooms


def test_modules_have_one_purpose_and_a_readers_length():
    long = {
        str(f.relative_to(PACKAGE)): n for f in PACKAGE.rglob("*.py") if (n := len(f.read_text().splitlines())) > 420
    }
    assert long == {}
