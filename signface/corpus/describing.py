"""One take of a corpus to its descriptors, from the store where it has them.

- `describe_entry`: solve a row of `takes.csv`.
- `stored_or_solved`: the same, but only when the store does not have it.
- `read_entry`, `recipe_of`, `layout_for`, `face_for`: the recording, recipe, layout and face of a row.

Faces and layouts are read once in a process and used for as many takes as there are.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from signface.corpus.manifest import TakeEntry
from signface.corpus.origin import Origin, Recipe, content_digest, make_recipe
from signface.corpus.signers import find_signer
from signface.corpus.store import DescriptorStore
from signface.descriptors import Descriptors
from signface.errors import SignfaceError
from signface.files import shipped
from signface.marker_names import subjects_of
from signface.settings.solve import SolveSettings
from signface.signer import Signer
from signface.takes.selecting import selected

if TYPE_CHECKING:
    from signface.face.layout import MarkerLayout
    from signface.face.model import FaceModel
    from signface.takes.take import Take


def describe_entry(entry: TakeEntry, recipe: Recipe, signer: Signer | None = None) -> Descriptors:
    """Solve one take of a corpus. Weights (from a phone, or solved before) are kept.

    `start_s` of the row, the time of the first frame in the video, places the take on the time line of its
    annotation; `neutral_s` is on that time line too.

    Raises
    ------
    SignfaceError
        The recording cannot be read or solved; the message names it.
    """
    from signface.solver.solving import solve

    recording = read_entry(entry, recipe)
    if isinstance(recording, Descriptors):
        return selected(recording, recipe.settings)
    settings = SolveSettings() if recipe.settings is None else recipe.settings
    if entry.neutral_s is not None:
        settings = settings.changed(neutral=entry.neutral_s)
    try:
        face, layout = _face(settings.face, recipe.face_digest), layout_for(recipe, recording.labels)
        return solve(recording, face, layout, settings=settings, signer=signer)
    except SignfaceError as error:
        raise error.at(entry.path) from error


def read_entry(entry: TakeEntry, recipe: Recipe | None = None) -> Take | Descriptors:
    """The recording of a row of `takes.csv`, read as the recipe says, on the time line of its annotation."""
    from signface.takes.reading import read_recording

    settings = None if recipe is None else recipe.settings
    settings = SolveSettings() if settings is None else settings
    recording = read_recording(entry.path, **settings.reading)
    if not isinstance(recording, Descriptors) and settings.subject is None:
        there = subjects_of(recording.labels)
        if len(there) > 1 and entry.signer in there:  # markers that are named after their signers
            recording = selected(recording, SolveSettings(subject=entry.signer))
    if entry.start_s is None:
        return recording
    return recording.changed(f"start at {entry.start_s:g} s", start=entry.start_s)


def stored_or_solved(
    entry: TakeEntry, origin: Origin, store: DescriptorStore | None, folder: Path
) -> tuple[Descriptors, bool]:
    """Descriptors of a take, and whether they had to be solved; what was solved is put in the store.

    Raises
    ------
    SignfaceError
        As `describe_entry`; or the store was written by a newer signface, or cannot be written.
    """
    stored = None if store is None else store.read(origin)
    if stored is not None:
        return stored, False
    descriptors = describe_entry(entry, origin.recipe, find_signer(folder, entry.signer))
    if store is not None:
        store.write(origin, descriptors)
    return descriptors, True


def recipe_of(entry: TakeEntry, recipe: Recipe, known: dict[tuple[str | None, ...], Recipe]) -> Recipe:
    """The recipe of a take: its row may name another face or layout. `known` keeps those that were made.

    Raises
    ------
    SignfaceError
        There is no such face or layout.
    """
    if recipe.settings is None or (entry.face is None and entry.layout is None and entry.subject is None):
        return recipe
    settings = recipe.settings
    names = (entry.face or settings.face, entry.layout or settings.layout, entry.subject or settings.subject)
    if names not in known:
        known[names] = make_recipe(settings.changed(face=names[0], layout=names[1], subject=names[2]))
    return known[names]


@lru_cache(maxsize=4)
def _face(name: str, digest: str) -> FaceModel:
    """A face whose content is the one that was asked for."""
    from signface.face.reading import read_face

    path = shipped("faces", ".glb").get(name, Path(name))
    if content_digest(path) != digest:
        raise SignfaceError("is not the face that the run began with", file=path, hint="run again")
    return read_face(name)


def face_for(recipe: Recipe) -> FaceModel:
    """The face of a recipe.

    Raises
    ------
    SignfaceError
        Its file was changed since the recipe was made.
    """
    return _face((SolveSettings() if recipe.settings is None else recipe.settings).face, recipe.face_digest)


@lru_cache(maxsize=16)
def layout_for(recipe: Recipe, labels: tuple[str, ...]) -> MarkerLayout:
    """The layout of a recipe, or the shipped one that fits the labels of a take best."""
    from signface.solver.solving import face_and_layout

    settings = SolveSettings() if recipe.settings is None else recipe.settings
    return face_and_layout(labels, settings, _face(settings.face, recipe.face_digest))[1]
