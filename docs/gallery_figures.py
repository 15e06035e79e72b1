"""Pictures of the gallery that pyplot does not know of: the figures that functions of signface give back."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst


def figures_without_pyplot(block: Any, names: dict[str, Any], gallery: dict[str, Any]) -> str:
    """Show the figures that our functions give back, which pyplot does not know of."""
    files = []
    for thing in list(names["example_globals"].values()):
        if isinstance(thing, Figure) and not hasattr(thing, "number") and not getattr(thing, "in_gallery", False):
            thing.in_gallery = True  # type: ignore[attr-defined]
            file = next(names["image_path_iterator"])
            thing.savefig(file, dpi=150)
            files.append(file)
    return figure_rst(files, gallery["src_dir"])
