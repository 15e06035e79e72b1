"""Weights that signface wrote itself (`signface.descriptors_files`), as a format of recordings."""

from __future__ import annotations

from os import PathLike

from signface.descriptors import Descriptors
from signface.descriptors_files import is_weights_table, read_weights
from signface.takes.formats.registry import FileHead, register_format


def _certainty(head: FileHead) -> float:
    return 1.0 if head.content[:4] == b"PAR1" else 0.8 * is_weights_table(head.cells)


@register_format(
    "weights",
    title="weights",
    written_by="signface solve",
    endings=(".parquet",),
    recognise=_certainty,
    holds="weights",
)
def open_weights(path: str | PathLike[str], *, unit: str | None = None) -> Descriptors:
    """Read a file of weights, whatever its ending; `unit` is not used. Errors are those of `read_weights`."""
    return read_weights(path)
