"""Estimators of scikit-learn on disk: the archive that skops writes, made the same for the same training.

- `skops_entries`: the entries of an archive that hold an estimator.
- `read_skops`: the estimator in an archive, which may hold only types that skops trusts and those of `TRUSTED`.

Object identities in skops' schema are memory addresses, and arrays of records hold what was in memory between their
fields; they are replaced by counters and zeros, so that the same training writes the same bytes.
"""

from __future__ import annotations

import importlib
import io
import json
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from signface.errors import SignfaceError

SCHEMA = "schema.json"

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
    "sklearn.ensemble._forest.ExtraTreesClassifier",
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
    "sklearn.tree._classes.ExtraTreeClassifier",
    "sklearn.tree._tree.Tree",
)

#: Classifiers that ship with the project but not in the installed package, which would be twice as large with them.
ONLY_IN_CHECKOUTS = ("thesis-forest",)

#: Names of modules and of attributes in files that older versions wrote, and what they are called now.
RENAMED_MODULES = {
    "signface.label.crf": "signface.sequence.crf",
    "signface.label.gru": "signface.sequence.gru",
    "signface.label.sequence": "signface.sequence.hsmm",
}
RENAMED_ATTRIBUTES = {
    "border_weight": "boundary_weight",
    "border_classifier": "boundary_classifier",
    "border_mean_": "boundary_mean_",
    "border_scale_": "boundary_scale_",
    "borders_": "boundaries_",
}


def skops_entries(estimator: object) -> dict[str, bytes]:
    """The entries of an archive, by name, that hold an estimator."""
    import skops.io

    with zipfile.ZipFile(io.BytesIO(skops.io.dumps(estimator))) as archive:
        schema, names = _canonical(json.loads(archive.read(SCHEMA)))
        entries = {new: without_padding(archive.read(old)) for old, new in names.items()}
    return entries | {SCHEMA: json.dumps(schema).encode()}


def read_skops(archive: zipfile.ZipFile, *, quickly: bool = False) -> Any:
    """The object in an archive.

    Parameters
    ----------
    archive : ZipFile
    quickly : bool
        As for `signface.label.persistence.load_model`.

    Raises
    ------
    SignfaceError
        It holds other types.
    Exception
        Of any kind, where the archive is damaged.
    """
    if quickly:
        _hasten()
    import skops.io
    from skops.io.exceptions import UntrustedTypesFoundException

    data = _renamed(archive)
    try:
        return skops.io.loads(data, trusted=list(TRUSTED))
    except UntrustedTypesFoundException as error:
        foreign = sorted(set(skops.io.get_untrusted_types(data=data)) - set(TRUSTED))
        raise SignfaceError(
            f"holds types that a classifier of signface does not ({', '.join(foreign[:3])}) and was not loaded",
            file=archive.filename,
            hint="use only files that signface train wrote",
        ) from error


def _renamed(archive: zipfile.ZipFile) -> bytes:
    """The archive, with the present names of our modules and of what models hold in its schema."""

    def visit(node: Any) -> Any:
        if isinstance(node, list):
            return [visit(item) for item in node]
        if not isinstance(node, dict):
            return node
        renamed = {RENAMED_ATTRIBUTES.get(key, key): visit(value) for key, value in node.items()}
        if renamed.get("__module__") in RENAMED_MODULES:
            renamed["__module__"] = RENAMED_MODULES[renamed["__module__"]]
        return renamed

    renewed = io.BytesIO()
    with zipfile.ZipFile(renewed, "w") as new:
        for name in archive.namelist():
            content = archive.read(name)
            new.writestr(name, json.dumps(visit(json.loads(content))).encode() if name == SCHEMA else content)
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


def without_padding(data: bytes) -> bytes:
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
