"""How the documentation site is built: `make docs`, which calls `python -m sphinx -W docs docs/_build/html`.

The pages beside this file are written by hand. `api/` (a page for the front door and one for each module) is made from
the docstrings, and `gallery/` from the scripts in `examples/`, which are run; neither is kept in the repository.
Nothing is fetched from the network.
"""

from __future__ import annotations

import ast
import re
import shutil
import sys
from importlib.metadata import version as installed_version
from pathlib import Path
from typing import Any

import matplotlib as mpl

import signface

mpl.use("Agg")

project, author, copyright = "signface", "the signface authors", "the signface authors, MIT licence"
release = installed_version("signface")
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
]

#: `name` in a docstring is a link where there is such a thing, and a name where there is none.
default_role = "py:obj"

#: A type in a docstring is found by its last word, at the front door and in its room: either page serves.
suppress_warnings = ["ref.python", "misc.highlighting_failure"]
exclude_patterns = ["_build", "gallery/*.py", "gallery/*.ipynb", "gallery/sg_execution_times.rst"]
myst_enable_extensions = ["deflist", "colon_fence"]
myst_heading_anchors = 4
napoleon_google_docstring = False
napoleon_use_rtype = False
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 100
toc_object_entries = False

html_theme = "furo"
html_title = "signface"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))  # for gallery_figures

#: The gallery's scripts run in a copy of their folder: what they write does not land in the repository.
EXAMPLES = HERE / "_build" / "examples"
shutil.rmtree(EXAMPLES, ignore_errors=True)
shutil.copytree(HERE.parent / "examples", EXAMPLES)

sphinx_gallery_conf = {
    "image_scrapers": ("matplotlib", "gallery_figures.figures_without_pyplot"),
    "examples_dirs": str(EXAMPLES),
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 1e9,
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "plot_gallery": True,
    "remove_config_comments": True,
    "notebook_extensions": set(),
}

COLON = "\N{RATIO}"

#: Rooms that are no part of a script's world: the command line is described in files.md.
UNLISTED = {"cli", "__main__"}
PACKAGE = Path(signface.__file__).parent
API = HERE / "api"


def write_api_pages() -> None:
    """Make the pages of the reference: the front door, the rooms, and a page a module."""
    pages = {"front-door": _front_door()}
    top, rooms = [], []
    for path in sorted(PACKAGE.iterdir()):
        if path.stem in UNLISTED or path.stem.startswith("__"):
            continue
        if path.suffix == ".py":
            top.append(path.stem)
            pages[f"signface.{path.stem}"] = _module_page(f"signface.{path.stem}")
        elif (path / "__init__.py").is_file():
            rooms.append(path.name)
            pages |= _room_pages(path, f"signface.{path.name}")
    opening = [
        "The rooms",
        "=========",
        "",
        "What the front door's names are made of, for who builds on the parts.",
        "",
    ]
    pages["rooms"] = "\n".join([*opening, *_contents([f"signface.{name}" for name in [*rooms, *top]])])
    API.mkdir(exist_ok=True)
    for old in API.glob("*.rst"):
        if old.stem not in pages:
            old.unlink()
    for name, text in pages.items():
        file = API / f"{name}.rst"
        if not file.is_file() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")


def _front_door() -> str:
    """Every name of the front door, in the order of the table that opens it."""
    lines = ["The front door", "==============", "", ".. automodule:: signface", "   :no-members:", ""]
    lines += [".. currentmodule:: signface", ""]
    for name in dict.fromkeys(re.findall(r"`(\w+)`", signface.__doc__ or "")):
        thing = getattr(signface, name)
        if isinstance(thing, type(signface)):
            continue
        directive = "autoclass" if isinstance(thing, type) else "autofunction"
        lines += [name, "-" * len(name), "", f".. {directive}:: signface.{name}"]
        lines += ["   :members:", ""] if directive == "autoclass" else [""]
    lines += ["datasets", "--------", "", ".. automodule:: signface.datasets", "   :members:", "   :no-index:", ""]
    return "\n".join(lines)


def _room_pages(folder: Path, name: str) -> dict[str, str]:
    """The page of a room and of all that is in it."""
    pages: dict[str, str] = {}
    inside = []
    for path in sorted(folder.iterdir()):
        child = f"{name}.{path.stem}"
        if path.suffix == ".py" and path.stem != "__init__":
            pages[child] = _module_page(child)
            inside.append(child)
        elif (path / "__init__.py").is_file():
            pages |= _room_pages(path, child)
            inside.append(child)
    pages[name] = "\n".join([*_heading(name), f".. automodule:: {name}", "   :no-members:", "", *_contents(inside)])
    return pages


def _module_page(name: str) -> str:
    return "\n".join([*_heading(name), f".. automodule:: {name}", "   :members:", ""])


def _heading(name: str) -> list[str]:
    short = name.removeprefix("signface.")
    return [short, "=" * len(short), ""]


def _contents(modules: list[str]) -> list[str]:
    """A table of modules with the first line of their docstrings, and the hidden tree of their pages."""
    lines = []
    for name in modules:
        lines += [f":doc:`{name.removeprefix('signface.')} <{name}>`", f"   {_summary(name)}", ""]
    return [*lines, ".. toctree::", "   :hidden:", "", *(f"   {name}" for name in modules), ""]


def _summary(name: str) -> str:
    """The first paragraph of a module's docstring, without importing it."""
    path = PACKAGE.joinpath(*name.split(".")[1:])
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split())


def mend_docstring(app: Any, what: str, name: str, thing: object, options: Any, lines: list[str]) -> None:
    """What our docstrings leave to the eye and reStructuredText wants to be told."""
    for number, line in enumerate(lines):
        line = re.sub(r"(?<!`)(`\.[\w.]+`)(?!`)", r"`\1`", line)  # `.csv` is an ending and no link
        block = number + 2 < len(lines) and not lines[number + 1].strip() and lines[number + 2].startswith("    ")
        if what == "module" and block and line.endswith(":") and not line.endswith("::"):
            line += ":"  # an indented block after a colon is text as it stands
        lines[number] = line
    if what in ("data", "attribute"):
        lines[:] = [line.replace(":", COLON) for line in lines]


def restore_colons(app: Any, what: str, name: str, thing: object, options: Any, lines: list[str]) -> None:
    """Put back what `mend_docstring` hid from napoleon, which takes what stands before a colon for a type."""
    lines[:] = [line.replace(COLON, ":") for line in lines]


def skip_generated(app: Any, what: str, name: str, thing: object, skip: bool, options: Any) -> bool | None:
    """Leave out the methods that scikit-learn adds to estimators for its metadata routing."""
    return True if name.startswith("set_") and name.endswith("_request") else None


def setup(app: Any) -> None:
    """Called by Sphinx before anything is read."""
    write_api_pages()
    app.connect("autodoc-process-docstring", mend_docstring, priority=400)  # before napoleon
    app.connect("autodoc-process-docstring", restore_colons, priority=600)  # after it
    app.connect("autodoc-skip-member", skip_generated)
