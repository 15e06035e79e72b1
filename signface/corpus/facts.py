"""What a corpus is made of, and from which contents its descriptors come: the provenance of a result.

- `corpus_facts`: names, counts and SHA-256 digests, as plain values.
"""

from __future__ import annotations

import json
import platform
from collections import Counter
from collections.abc import Sequence
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from signface.corpus.describing import recipe_of
from signface.corpus.manifest import Corpus
from signface.corpus.origin import Origin, Recipe, content_digest, find_origin, make_recipe
from signface.errors import SignfaceError
from signface.settings.solve import SolveSettings

#: Packages whose version can change a result.
PACKAGES = ("signface", "numpy", "scipy", "scikit-learn", "pandas")

#: What a corpus of `signface synth` holds.
SYNTHETIC = "synthetic.json"


def corpus_facts(corpus: Corpus, *, settings: SolveSettings | None = None) -> dict[str, Any]:
    """What was worked on, for whoever wants to know whether they have the same.

    Parameters
    ----------
    corpus : Corpus
        Its annotated takes are described; their recordings are read.
    settings : SolveSettings, optional
        As for `signface.corpus.examples.solve_corpus`.

    Returns
    -------
    dict
        - `name`, `synthetic` (whether `signface synth` made it), `signers`, `kinds` (takes of each);
        - `recordings`: of each take its name, signer, kind, and the SHA-256 of recording and annotation;
        - `digest`: the SHA-256 of all of these;
        - `faces`, `layouts`, `solvers`: name and SHA-256 of those used;
        - `versions`: of Python and the packages that matter.

    Raises
    ------
    SignfaceError
        A recording cannot be read.
    """
    recipe = make_recipe(settings)
    known: dict[tuple[str | None, ...], Recipe] = {}
    recordings, origins = [], []
    for entry in corpus:
        if entry.annotation is None:
            continue
        origin = find_origin(entry, corpus.folder, recipe_of(entry, recipe, known))
        origins.append(origin)
        row = {"take": origin.take, "signer": origin.signer, "kind": origin.kind}
        recordings.append(row | {"recording": origin.recording, "annotation": content_digest(entry.annotation)})
    kinds = Counter(row["kind"] for row in recordings)
    return {
        "name": corpus.folder.resolve().name,
        "synthetic": _is_synthetic(corpus.folder),
        "signers": sorted({row["signer"] for row in recordings}),
        "kinds": {kind: kinds[kind] for kind in sorted(kinds)},
        "digest": sha256(json.dumps(recordings, sort_keys=True).encode()).hexdigest(),
        "faces": _used(origins, lambda origin: (_name(origin, "face"), origin.recipe.face_digest)),
        "layouts": _used(origins, lambda origin: (_name(origin, "layout"), origin.recipe.layout_digest)),
        "solvers": _used(origins, lambda origin: (_name(origin, "method"), origin.recipe.solver)),
        "versions": {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}},
        "recordings": recordings,
    }


def _name(origin: Origin, field: str) -> str:
    """What the settings of a recipe name; `none` where nothing was solved."""
    settings = origin.recipe.settings
    if settings is None:
        return "none"
    name = getattr(settings, field)
    return "the shipped layout that fits best" if name is None else Path(name).name


def _used(origins: Sequence[Origin], name_and_digest: Any) -> list[dict[str, str]]:
    """Each name with its digest once; recordings that hold weights have no face and no layout."""
    pairs = sorted({name_and_digest(origin) for origin in origins})
    return [{"name": name, "sha256": digest} for name, digest in pairs if digest and name != "none"]


def _is_synthetic(folder: Path) -> bool:
    file = folder / SYNTHETIC
    if not file.is_file():
        return False
    try:
        return json.loads(file.read_text(encoding="utf-8")).get("made_by") == "signface synth"
    except (OSError, ValueError, AttributeError) as error:
        raise SignfaceError("cannot be read", file=file, hint="make the corpus again with signface synth") from error
