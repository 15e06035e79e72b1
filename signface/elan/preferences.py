"""ELAN's preferences file (`.pfsx`): the colours of vocabulary entries.

EAF itself has no place for colours. ELAN keeps them beside the file, in the preference group `CV.ML.Prefs`:
vocabulary, entry id, `Color` as `r,g,b` (`PreferencesWriter` and `PrefObjectConverter` in ELAN's sources).
"""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from lxml import etree

from signface.elan.document import XSI, write_document
from signface.elan.tiers import Tier

PREFERENCES_SCHEMA = "http://www.mpi.nl/tools/elan/Prefs_v1.1.xsd"


def write_preferences(path: str | PathLike[str], tiers: Sequence[Tier]) -> None:
    """Write the colours of the tiers' vocabularies, unless there are preferences already.

    A `.pfsx` that is there holds an annotator's own window layout and colours; it is left alone.

    Parameters
    ----------
    path : path
        Beside the EAF, with the same stem.
    tiers : sequence of Tier
    """
    file = Path(path)
    if file.exists():
        return
    root = etree.Element("preferences", nsmap={"xsi": XSI}, version="1.1")
    root.set(f"{{{XSI}}}noNamespaceSchemaLocation", PREFERENCES_SCHEMA)
    group = etree.SubElement(root, "prefGroup", key="CV.ML.Prefs")
    done = set()
    for tier in tiers:
        for vocabulary in (tier.vocabulary, *(child.vocabulary for child in tier.dependents)):
            if vocabulary is None or vocabulary.name in done:
                continue
            done.add(vocabulary.name)
            coloured = [entry for entry in vocabulary.entries if entry.colour is not None]
            if not coloured:
                continue
            entries = etree.SubElement(group, "prefGroup", key=vocabulary.name)
            for entry in coloured:
                preference = etree.SubElement(
                    etree.SubElement(entries, "prefGroup", key=entry.identifier), "pref", key="Color"
                )
                colour = etree.SubElement(preference, "Object")
                colour.set("class", "java.awt.Color")
                colour.text = ",".join(str(part) for part in entry.colour or ())
    write_document(etree.ElementTree(root), file)
