"""Trained classifiers on disk: archives that hold no code, with the model's card beside the estimator.

- `save_model`, `load_model`: write and read a trained classifier.
- `read_card`: what a file holds, without loading the estimator.

A file is a zip archive. `signface.json` is the card. Models of our own are arrays and plain values
(`signface.label.plain_archive`); what scikit-learn trained is written by skops (`signface.label.skops_archive`). Zip
entries carry a fixed date, so that the same training writes the same bytes.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from dataclasses import asdict, fields
from os import PathLike
from pathlib import Path
from typing import Any

from signface.errors import SignfaceError
from signface.files import shipped, whole_file
from signface.label.courses import courses_width
from signface.label.model import Card, TrainedModel
from signface.label.plain_archive import is_plain, plain_entries, read_plain
from signface.label.skops_archive import read_skops, skops_entries
from signface.label.variants import DescriptorVariant
from signface.label.vocabulary import Vocabulary
from signface.settings.choices import SEQUENCE_NAMES

CARD = "signface.json"

#: Names of a model's parts: what gives labels, and what gives intensities beside them.
LABELS, INTENSITY = "labels", "intensity"

#: Classifiers that ship with the project but not in the installed package, which would be twice as large with them.
ONLY_IN_CHECKOUTS = ("thesis-forest",)

#: No trained classifier of ours unpacks to more (bytes): a small file that does is no honest one.
LARGEST = 2 * 1024**3


def save_model(model: TrainedModel, path: str | PathLike[str]) -> None:
    """Write a trained classifier as a .skops file.

    Raises
    ------
    SignfaceError
        The ending is not .skops, or the folder cannot be written.

    See Also
    --------
    signface.load_model : the way back.

    Examples
    --------
    >>> import signface as sf
    >>> sf.save_model(sf.load_model(), "mine.skops")
    >>> sf.load_model("mine.skops").name
    'mine'
    """
    if Path(path).suffix.lower() != ".skops":
        raise SignfaceError("the ending of a classifier is .skops", file=path)
    models = {LABELS: model.estimator, INTENSITY: model.intensity}
    plain = {name: part for name, part in models.items() if is_plain(part)}
    contents = plain_entries(plain) if plain else {}
    if LABELS not in plain:
        contents |= skops_entries(model.estimator)
    contents[CARD] = json.dumps(asdict(model.card), indent=1, ensure_ascii=False).encode()
    with whole_file(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name in sorted(contents, key=lambda name: (name != CARD, not name.endswith(".json"), name)):
            entry = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, contents[name], compresslevel=9)


def read_card(name_or_path: str | PathLike[str]) -> Card:
    """The card of a saved classifier (a shipped name or a file), without loading the estimator.

    Raises
    ------
    SignfaceError
        The file is missing, cut off, or no classifier of signface.
    """
    file = _found(name_or_path)
    try:
        with zipfile.ZipFile(file) as archive:
            if CARD not in archive.namelist():
                raise SignfaceError(
                    "is no classifier of signface (it has no card)", file=file, hint="train one with signface train"
                )
            content = json.loads(archive.read(CARD))
        return _card(content)
    except (zipfile.BadZipFile, OSError, EOFError, zlib.error, ValueError, KeyError, TypeError) as error:
        raise SignfaceError(
            "is no classifier of signface, or is cut off", file=file, hint="train one with signface train"
        ) from error


def load_model(name_or_path: str | PathLike[str] = "default", *, quickly: bool = False) -> TrainedModel:
    """Read a trained classifier: a shipped one by its name, or a file.

    Nothing of the file is run: it may hold only models of our own, types that skops trusts and `skops_archive.TRUSTED`.

    Parameters
    ----------
    name_or_path : str or path
    quickly : bool
        Import skops without its list of the estimators that it trusts by itself, which takes two seconds to make. In
        this process skops then trusts less, also where others call it: the command line asks for this, and scripts that
        load other files by skops should not.

    Raises
    ------
    SignfaceError
        The file is missing, cut off, no classifier of signface, holds other types, or its estimator and its card
        do not belong together.

    See Also
    --------
    signface.train : a classifier of one's own.
    signface.save_model : the way to disk.

    Examples
    --------
    >>> import signface as sf
    >>> model = sf.load_model()
    >>> model.card.classifier, model.card.labels
    ('gru', ('A', 'D', 'F', 'J', 'N', 'Sa', 'Su'))
    """
    file = _found(name_or_path)
    card = read_card(file)
    try:
        with zipfile.ZipFile(file) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > LARGEST or archive.testzip() is not None:
                raise SignfaceError("is no classifier of signface, or is damaged", file=file)
            models = read_plain(archive)
            if LABELS not in models:
                estimator = read_skops(archive, quickly=quickly)
                # Older versions let skops write both; the labels' estimator alone where there was no intensity.
                models |= estimator if isinstance(estimator, dict) else {LABELS: estimator}
        estimator, intensity = models[LABELS], models.get(INTENSITY)
        classes = tuple(str(label) for label in estimator.classes_)
        features = int(estimator.n_features_in_)
    except SignfaceError:
        raise
    except Exception as error:  # a damaged archive makes skops and scikit-learn fail in many ways
        raise SignfaceError(
            f"cannot be loaded as a classifier ({type(error).__name__})",
            file=file,
            hint=f"it was written by signface {card.version}; train it again with signface train",
        ) from error
    if (
        classes != card.labels
        or features != _width(card)
        or not (intensity is None or hasattr(intensity, "annotate"))
        or not hasattr(estimator, "annotate" if card.classifier in SEQUENCE_NAMES else "predict_proba")
    ):
        raise SignfaceError("its estimator and its card do not belong together", file=file, hint="train it again")
    return TrainedModel(estimator, card, name=file.stem, intensity=intensity)


def _width(card: Card) -> int:
    """How many numbers the estimator of a card is given for a frame, or for a segment."""
    columns = len(DescriptorVariant(card.features, card.normalise).names(card.bases))
    return courses_width(columns) if card.aggregate == "course" else columns


def _found(name_or_path: str | PathLike[str]) -> Path:
    """The file of a shipped classifier, or the path itself when there is such a file."""
    ours = shipped("classifiers", ".skops")
    file = ours.get(str(name_or_path), Path(name_or_path))
    if not file.is_file() and str(name_or_path) in ONLY_IN_CHECKOUTS:
        raise SignfaceError(
            f"the classifier {name_or_path} is too large to come with an installed signface",
            hint=f"take models/classifiers/{name_or_path}.skops from a checkout of the project and name that file",
        )
    if not file.is_file():
        hint = f"name a .skops file or a shipped classifier ({', '.join(ours) or 'there is none'})"
        raise SignfaceError("no such classifier", file=file, hint=hint)
    return file


def _card(content: dict[str, Any]) -> Card:
    """The card from its JSON, with lists made tuples again."""
    known = {item.name for item in fields(Card)}
    values: dict[str, Any] = {
        name: tuple(str(entry) for entry in value) if isinstance(value, list) else value
        for name, value in content.items()
        if name in known
    }
    if "vocabulary" in values:
        values["vocabulary"] = Vocabulary.from_dict(values["vocabulary"])
    card = Card(**values)
    if not (isinstance(card.bases, tuple) and isinstance(card.labels, tuple) and isinstance(card.scores, dict)):
        raise ValueError("the card's lists are no lists")
    if card.familiarity and not all(isinstance(of, dict) for of in card.familiarity.values()):
        raise ValueError("the card's familiarity is no table")
    if card.calibration and not all(isinstance(card.calibration.get(name), float) for name in ("slope", "offset")):
        raise ValueError("the card's calibration is no line")
    try:
        DescriptorVariant(card.features, card.normalise).check()
    except SignfaceError as error:
        raise ValueError(error.problem) from error
    return card
