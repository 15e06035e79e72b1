"""Reading the skops archive of a model that holds nothing but arrays and plain values, without skops.

- `read_plain`: the model, or None where the archive holds anything else, which is then skops' to read.

Importing skops and the modules of scikit-learn that it imports takes half a second or more. A recurrent network needs
none of them: its archive is a JSON tree of containers, numbers, texts and `.npy` files. Of any other type this reads
nothing, so that it trusts less than skops does: containers, arrays without objects, and the classes of `OURS`.
"""

from __future__ import annotations

import importlib
import io
import json
import zipfile
from typing import Any

import numpy as np

SCHEMA = "schema.json"

#: The protocol of the archives that are known here; newer ones may mean something else.
PROTOCOL = 2

#: Models that consist of arrays and plain values.
OURS = (
    "signface.sequence.crf.ChainLabeller",
    "signface.sequence.gru.RecurrentLabeller",
    "signface.label.intensity.IntensityClassifier",
)

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

CONTAINERS = {"ListNode": list, "TupleNode": tuple}
KEYS = {"builtins.str": str, "builtins.int": int}


class _OtherError(Exception):
    """The archive holds something that is not plain."""


def read_plain(archive: zipfile.ZipFile) -> Any:
    """The object in a skops archive; None where it holds more than `OURS`, arrays and plain values.

    Raises
    ------
    Exception
        Of any kind, where the archive is damaged.
    """
    schema = read_schema(archive)
    if schema.get("protocol") != PROTOCOL:
        return None
    try:
        return _value(schema, archive, {})
    except _OtherError:
        return None


def read_schema(archive: zipfile.ZipFile) -> Any:
    """The schema of a skops archive, with today's names of our modules and of what models hold."""

    def visit(node: Any) -> Any:
        if isinstance(node, list):
            return [visit(item) for item in node]
        if not isinstance(node, dict):
            return node
        renamed = {RENAMED_ATTRIBUTES.get(key, key): visit(value) for key, value in node.items()}
        if renamed.get("__module__") in RENAMED_MODULES:
            renamed["__module__"] = RENAMED_MODULES[renamed["__module__"]]
        return renamed

    return visit(json.loads(archive.read(SCHEMA)))


def _name(node: dict[str, Any]) -> str:
    return f"{node['__module__']}.{node['__class__']}"


def _value(node: dict[str, Any], archive: zipfile.ZipFile, known: dict[int, Any]) -> Any:
    """What a node of the tree stands for; what was met before under the same number is the same object."""
    number = node.get("__id__")
    if number in known:
        return known[number]
    loader, name = node["__loader__"], _name(node)
    value: Any
    if loader == "JsonNode" and name == "builtins.str":
        value = json.loads(node["content"])
    elif loader in CONTAINERS and name == f"builtins.{CONTAINERS[loader].__name__}":
        value = CONTAINERS[loader](_value(own, archive, known) for own in node["content"])
    elif loader == "DictNode" and name == "builtins.dict":
        keys = [KEYS.get(_name(own)) for own in node["key_types"]["content"]]
        if None in keys:
            raise _OtherError
        entries = zip(keys, node["content"].items(), strict=True)
        value = {kind(key): _value(own, archive, known) for kind, (key, own) in entries if kind is not None}
    elif loader == "NdArrayNode" and node["type"] == "numpy" and name.startswith("numpy."):
        value = np.load(io.BytesIO(archive.read(node["file"])), allow_pickle=False)
        if name != "numpy.ndarray":
            value = value[()]
            if f"{type(value).__module__}.{type(value).__name__}" != name:
                raise _OtherError
    elif loader == "ObjectNode" and name in OURS:
        state = _value(node["content"], archive, known)
        module, _, kind = name.rpartition(".")
        own = getattr(importlib.import_module(module), kind)
        value = own.__new__(own)
        value.__dict__.update(state)
    else:
        raise _OtherError
    if number is not None:
        known[number] = value
    return value
