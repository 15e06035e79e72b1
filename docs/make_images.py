"""Draw the pictures of the README: `python docs/make_images.py`, from the root of the project."""

from __future__ import annotations

from pathlib import Path

from signface.annotation import annotate
from signface.corpus.manifest import read_corpus
from signface.elan.reference import read_reference
from signface.face.reading import read_face
from signface.label.persistence import load_model
from signface.report.overview import draw_overview
from signface.report.timeline import save_figure
from signface.settings.solve import SolveSettings
from signface.takes.reading import read_recording

ROOT = Path(__file__).resolve().parents[1]


def main() -> None:
    """Draw `images/overview.png` from a bundled synthetic take."""
    entry = next(entry for entry in read_corpus(ROOT / "corpora" / "mini").takes if entry.kind == "SE")
    face = read_face("default")
    found = annotate(
        read_recording(entry.path), load_model("default"), face=face, settings=SolveSettings(neutral=entry.neutral_s)
    )
    figure = draw_overview(
        found.descriptors,
        found.segments,
        face,
        reference=read_reference(entry.annotation),
        title=f"{entry.path.stem} (synthetic)",
    )
    save_figure(figure, ROOT / "docs" / "images" / "overview.png", dpi=110)


if __name__ == "__main__":
    main()
