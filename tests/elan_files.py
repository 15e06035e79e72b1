"""Helpers of the tests of EAF files: segments to write, the schema to hold them to, a second parser to read them."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pandas as pd
import pympi
import pytest
from lxml import etree

from signface.segment.segments import Segments

SCHEMA = Path(__file__).parents[2] / "shared/data/EAFv3.0.xsd"


@functools.cache
def _schema() -> etree.XMLSchema:
    return etree.XMLSchema(etree.parse(SCHEMA))


def assert_valid(path: Path) -> None:
    """Hold an EAF to the schema; nothing is asserted where the schema is not at hand."""
    if SCHEMA.is_file():
        _schema().assertValid(etree.parse(path))


def needs_schema() -> pytest.MarkDecorator:
    return pytest.mark.skipif(not SCHEMA.is_file(), reason="the EAF schema is not at hand")


def labelled(labels: str = "N NJ J JN N", *, step: float = 0.5, start: float = 0.0, name: str = "take") -> Segments:
    """Segments of `step` seconds each, one for each label, with a confidence."""
    words = labels.split()
    edges = start + step * np.arange(len(words) + 1)
    kinds = ["stable" if word in ["N", "A", "D", "F", "J", "Sa", "Su"] else "transition" for word in words]
    table = pd.DataFrame(
        {
            "start_s": edges[:-1],
            "end_s": edges[1:],
            "kind": kinds,
            "label": words,
            "confidence": np.linspace(0.9, 0.5, len(words)),
        }
    )
    return Segments(table, name=name, history=("test",))


def read_back(path: Path, tier: str) -> list[tuple]:
    """Annotations of a tier as pympi reads them: (start_ms, end_ms, value, ...)."""
    return sorted(pympi.Elan.Eaf(str(path)).get_annotation_data_for_tier(tier))
