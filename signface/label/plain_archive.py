"""Models of our own on disk, without skops: what consists of arrays and plain values.

- `is_plain`: whether an object is a model of ours that consists of them.
- `plain_entries`: the entries of an archive that hold a model.
- `read_plain`: the model in them.

Importing skops and what it imports of scikit-learn takes a second or more, which a recurrent network needs nothing of.
An archive holds a tree in JSON, `model.json`, and beside it one `.npy` file for each array, so that `numpy.load` opens
it, too. In the tree a text, a number, a truth value, null and a list stand for themselves; everything else is an object
of one key: `array` or `scalar` (numpy's, the name of its file), `tuple`, `dict` (a list of keys and values) and `model`
(one of `MODELS`, with the values of its attributes). Nothing else is read, and nothing of the archive is run.
"""

from __future__ import annotations

import importlib
import io
import json
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np

TREE = "model.json"

#: Models that consist of arrays and plain values, and where they stand.
MODELS = {
    "BoostingLabeller": "signface.sequence.boosting",
    "ChainLabeller": "signface.sequence.crf",
    "IntensityClassifier": "signface.label.intensity",
    "RecurrentLabeller": "signface.sequence.gru",
}


def is_plain(model: object) -> bool:
    """Whether a model is one of `MODELS`."""
    return MODELS.get(type(model).__name__) == type(model).__module__


def plain_entries(models: Mapping[str, object]) -> dict[str, bytes]:
    """The entries of an archive, by name, that hold models of `MODELS`, each under a name.

    Raises
    ------
    TypeError
        A model holds something else than arrays and plain values.
    """
    entries: dict[str, bytes] = {}
    files: dict[int, str] = {}  # an array that a model holds twice is written once

    def node(value: Any, path: str) -> Any:
        if value is None or type(value) in (str, bool, int, float):
            return value
        if type(value) is list:
            return [node(item, f"{path}.{number}") for number, item in enumerate(value)]
        if type(value) is tuple:
            return {"tuple": [node(item, f"{path}.{number}") for number, item in enumerate(value)]}
        if type(value) is dict:
            return {"dict": [[node(key, path), node(item, f"{path}.{key}")] for key, item in value.items()]}
        if isinstance(value, np.ndarray | np.generic):
            file = files.setdefault(id(value), f"{path}.npy")
            written = io.BytesIO()
            np.save(written, value, allow_pickle=False)
            entries[file] = written.getvalue()
            return {"array" if isinstance(value, np.ndarray) else "scalar": file}
        if is_plain(value):
            attributes = {name: node(item, f"{path}.{name}") for name, item in vars(value).items()}
            return {"model": [type(value).__name__, attributes]}
        raise TypeError(f"{path} is a {type(value).__name__}, neither an array nor a plain value")

    tree = {name: node(model, name) for name, model in models.items()}
    entries[TREE] = json.dumps(tree, indent=1, ensure_ascii=False).encode()
    return entries


def read_plain(archive: zipfile.ZipFile) -> dict[str, Any]:
    """The models in an archive, by name; none where it holds no `model.json`.

    Raises
    ------
    Exception
        Of any kind, where the archive is damaged or holds anything else.
    """
    arrays: dict[str, np.ndarray] = {}

    def value(node: Any) -> Any:
        if isinstance(node, list):
            return [value(item) for item in node]
        if not isinstance(node, dict):
            return node
        ((kind, content),) = node.items()
        if kind in ("array", "scalar"):
            if content not in arrays:
                arrays[content] = np.load(io.BytesIO(archive.read(content)), allow_pickle=False)
            return arrays[content] if kind == "array" else arrays[content][()]
        if kind == "tuple":
            return tuple(value(item) for item in content)
        if kind == "dict":
            return {value(key): value(item) for key, item in content}
        if kind == "model":
            name, attributes = content
            model = object.__new__(getattr(importlib.import_module(MODELS[name]), name))
            vars(model).update({attribute: value(item) for attribute, item in attributes.items()})
            return model
        raise ValueError(f"{kind} is nothing that a model consists of")

    if TREE not in archive.namelist():
        return {}
    return {name: value(node) for name, node in json.loads(archive.read(TREE)).items()}
