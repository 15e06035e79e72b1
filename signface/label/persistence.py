"""Trained classifiers on disk: skops files, which hold no code, with the model's card beside the estimator.

- `save_model`, `load_model`: write and read a trained classifier.
- `read_card`: what a file holds, without loading the estimator.

A file is the zip archive that skops writes, with one more entry, `signface.json`, the card. Object identities in
skops' own schema are memory addresses, zip entries carry the time of day, and arrays of records what was in memory
between their fields; they are replaced by counters, a fixed date and zeros, so that the same training writes the same
bytes.
"""

from __future__ import annotations

import importlib
import io
import json
import sys
import zipfile
import zlib
from dataclasses import asdict, fields
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from signface.errors import SignfaceError
from signface.files import shipped, whole_file
from signface.label.labellers import SEQUENCE_NAMES
from signface.label.model import Card, TrainedModel
from signface.label.plain_archive import SCHEMA, read_plain, read_schema
from signface.label.variants import DescriptorVariant

CARD = "signface.json"

#: What a file holds whose model gives intensities beside labels; others hold the labels' estimator alone.
LABELS, INTENSITY = "labels", "intensity"

#: Types that a file may hold beside containers, arrays and plain values. None of them runs code of the file's choosing.
TRUSTED = (
    "signface.sequence.crf.ChainLabeller",
    "signface.sequence.gru.RecurrentLabeller",
    "signface.label.intensity.IntensityClassifier",
    "signface.sequence.hsmm.SequenceLabeller",
    "sklearn.calibration.CalibratedClassifierCV",
    "sklearn.calibration._CalibratedClassifier",
    "sklearn.calibration._SigmoidCalibration",
    "sklearn.discriminant_analysis.LinearDiscriminantAnalysis",
    "sklearn.ensemble._bagging.BaggingClassifier",
    "sklearn.ensemble._forest.RandomForestClassifier",
    "sklearn.ensemble._hist_gradient_boosting.gradient_boosting.HistGradientBoostingClassifier",
    "sklearn.ensemble._hist_gradient_boosting.predictor.TreePredictor",
    "sklearn.linear_model._logistic.LogisticRegression",
    "sklearn.model_selection._split.StratifiedKFold",
    "sklearn.neighbors._classification.KNeighborsClassifier",
    "sklearn.neural_network._multilayer_perceptron.MLPClassifier",
    "sklearn.pipeline.Pipeline",
    "sklearn.preprocessing._data.StandardScaler",
    "sklearn.preprocessing._label.LabelBinarizer",
    "sklearn.preprocessing._label.LabelEncoder",
    "sklearn.svm._classes.SVC",
    "sklearn.tree._classes.DecisionTreeClassifier",
    "sklearn.tree._tree.Tree",
)

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
    import skops.io

    if Path(path).suffix.lower() != ".skops":
        raise SignfaceError("the ending of a classifier is .skops", file=path)
    both = {LABELS: model.estimator, INTENSITY: model.intensity}
    written = skops.io.dumps(model.estimator if model.intensity is None else both)
    with zipfile.ZipFile(io.BytesIO(written)) as archive:
        schema, names = _canonical(json.loads(archive.read(SCHEMA)))
        contents = {new: _without_padding(archive.read(old)) for old, new in names.items()}
    contents[SCHEMA] = json.dumps(schema).encode()
    contents[CARD] = json.dumps(asdict(model.card), indent=1, ensure_ascii=False).encode()
    with whole_file(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name in (CARD, SCHEMA, *sorted(set(contents) - {CARD, SCHEMA})):
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

    Nothing of the file is run: it may hold only types that skops trusts and those of `TRUSTED`.

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
            estimator: Any = read_plain(archive)
        if estimator is None:
            estimator = _loaded(file, quickly)
        intensity = None
        if isinstance(estimator, dict):
            estimator, intensity = estimator[LABELS], estimator[INTENSITY]
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
        or features != len(DescriptorVariant(card.features, card.normalise).names(card.bases))
        or not (intensity is None or hasattr(intensity, "annotate"))
        or not hasattr(estimator, "annotate" if card.classifier in SEQUENCE_NAMES else "predict_proba")
    ):
        raise SignfaceError("its estimator and its card do not belong together", file=file, hint="train it again")
    return TrainedModel(estimator, card, name=file.stem, intensity=intensity)


def _loaded(file: Path, quickly: bool) -> Any:
    """The object in a file, by skops."""
    if quickly:
        _hasten()
    import skops.io
    from skops.io.exceptions import UntrustedTypesFoundException

    data = _modernised(file)
    try:
        return skops.io.loads(data, trusted=list(TRUSTED))
    except UntrustedTypesFoundException as error:
        foreign = sorted(set(skops.io.get_untrusted_types(data=data)) - set(TRUSTED))
        raise SignfaceError(
            f"holds types that a classifier of signface does not ({', '.join(foreign[:3])}) and was not loaded",
            file=file,
            hint="use only files that signface train wrote",
        ) from error


def _modernised(file: Path) -> bytes:
    """The archive in a file, with the names of today in its schema."""
    renewed = io.BytesIO()
    with zipfile.ZipFile(file) as old, zipfile.ZipFile(renewed, "w") as new:
        for name in old.namelist():
            content = json.dumps(read_schema(old)).encode() if name == SCHEMA else old.read(name)
            new.writestr(name, content)
    return renewed.getvalue()


def _hasten() -> None:
    """Import skops without its list of everything in scikit-learn.

    On import skops lists the estimators of all of scikit-learn, since it trusts them, and imports every module of it
    to that end: two seconds, and six where PyTorch is installed. Without the list it trusts none of them by itself, but
    those of `TRUSTED` when it is told.
    """
    import sklearn.utils

    if "skops.io" in sys.modules:
        return
    everything = sklearn.utils.all_estimators
    sklearn.utils.all_estimators = list
    try:
        importlib.import_module("skops.io")
    finally:
        sklearn.utils.all_estimators = everything


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
    card = Card(**values)
    if not (isinstance(card.bases, tuple) and isinstance(card.labels, tuple) and isinstance(card.scores, dict)):
        raise ValueError("the card's lists are no lists")
    if card.calibration and not all(isinstance(card.calibration.get(name), float) for name in ("slope", "offset")):
        raise ValueError("the card's calibration is no line")
    try:
        DescriptorVariant(card.features, card.normalise).check()
    except SignfaceError as error:
        raise ValueError(error.problem) from error
    return card


def _without_padding(data: bytes) -> bytes:
    """The content of an entry, with zeros between the fields of an array of records.

    The nodes of scikit-learn's trees have seven bytes of padding each, which hold whatever was in memory.
    """
    if not data.startswith(np.lib.format.MAGIC_PREFIX):
        return data
    array = np.load(io.BytesIO(data), allow_pickle=False)
    if array.dtype.names is None:
        return data
    clean = np.zeros(array.shape, array.dtype)  # zeros_like would leave the padding as it finds it
    for name in array.dtype.names:
        clean[name] = array[name]
    written = io.BytesIO()
    np.save(written, clean, allow_pickle=False)
    return written.getvalue()


def _canonical(schema: Any) -> tuple[Any, dict[str, str]]:
    """The schema with identities numbered in the order of appearance, and the new name of each file of the archive."""
    numbers: dict[int, int] = {}
    names: dict[str, str] = {}

    def visit(node: Any) -> Any:
        if isinstance(node, list):
            return [visit(item) for item in node]
        if not isinstance(node, dict):
            return node
        result: dict[str, Any] = {}
        for key, value in node.items():
            if key == "__id__":
                result[key] = numbers.setdefault(value, len(numbers))
            elif key == "file" and isinstance(value, str):
                result[key] = names.setdefault(value, f"{len(names):05d}{Path(value).suffix}")
            else:
                result[key] = visit(value)
        return result

    return visit(schema), names
