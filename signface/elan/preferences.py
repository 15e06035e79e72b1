"""ELAN's preferences file (`.pfsx`): the colours of vocabulary entries and the panels of the timeseries viewer.

EAF itself has no place for colours. ELAN keeps them beside the file, in the preference group `CV.ML.Prefs`:
vocabulary, entry id, `Color` as `r,g,b` (`PreferencesWriter` and `PrefObjectConverter` in ELAN's sources). Which
curves are drawn is kept there too (`TimeSeriesViewer`); without it the viewer opens empty.
"""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from lxml import etree

from signface.elan.curves import panels
from signface.elan.document import XSI, write_document
from signface.elan.elements import entry_identifier
from signface.elan.tiers import Tier

PREFERENCES_SCHEMA = "http://www.mpi.nl/tools/elan/Prefs_v1.1.xsd"


def write_preferences(
    path: str | PathLike[str], tiers: Sequence[Tier], *, curves: str | PathLike[str] | None = None
) -> None:
    """Write the colours of the tiers' vocabularies and the panels of the curves, unless there are preferences.

    A `.pfsx` that is there holds an annotator's own window layout and colours; it is left alone.

    Parameters
    ----------
    path : path
        Beside the EAF, with the same stem.
    tiers : sequence of Tier
    curves : path, optional
        The curves file linked from the EAF.
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
                    etree.SubElement(entries, "prefGroup", key=entry_identifier(entry.value)), "pref", key="Color"
                )
                colour = etree.SubElement(preference, "Object")
                colour.set("class", "java.awt.Color")
                colour.text = ",".join(map(str, entry.colour or ()))
    if curves is not None:
        drawn = panels(curves)
        count = etree.SubElement(root, "pref", key="TimeSeriesViewer.NumberOfPanels")
        etree.SubElement(count, "Int").text = str(len(drawn))
        for number, names in enumerate(drawn.values(), start=1):
            tracks = etree.SubElement(root, "prefList", key=f"TimeSeriesViewer.Panel-{number}")
            for name in names:
                etree.SubElement(tracks, "String").text = name
    write_document(etree.ElementTree(root), file)
