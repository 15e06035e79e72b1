"""The recogniser that ELAN itself runs: its extension folder, and the language it speaks.

ELAN lists a recogniser for every folder in its `extensions` directory that holds a CMDI file. It starts the program
named there in that folder with a bare environment, writes the chosen parameters to its standard input as XML, shows
its progress lines, and reads the tier file that it was told to write (`LocalRecognizer`, `RecognizerParser` and
`XmlTierIO` in ELAN's sources).

- `write_extension`, `extensions_folder`: the folder, and where it belongs.
- `read_parameters`: what ELAN writes to standard input; `discard_tier_file`: the result of an earlier run.
- `progress_line`, `DONE`, `FAILED`: what it reads from standard output.
- `write_tier_file`: the file it imports.
"""

from __future__ import annotations

import locale
import re
import stat
import sys
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from lxml import etree

from signface.elan.document import parse_xml
from signface.elan.tiers import Tier
from signface.errors import SignfaceError
from signface.files import whole_file

CMD = "http://www.clarin.eu/cmd/"

DONE = "RESULT: DONE."
FAILED = "RESULT: FAILED."

#: Name and, for ELAN's panel, description of each input, in the order shown.
INPUTS = (
    ("video", "video", True, "The film that is open in ELAN (not needed for the result)"),
    ("take", "auxiliary", False, "The recording of the face: C3D, TRC, TSV, CSV or .pose"),
    ("face", "auxiliary", True, "A face model (.glb), if not the one that ships with signface"),
    ("layout", "auxiliary", True, "A marker layout (.csv), if the shipped ones do not fit the markers"),
    ("classifier", "auxiliary", True, "A trained classifier (.skops), if not the one that ships with signface"),
    ("settings", "auxiliary", True, "A laboratory's settings (.toml): how recordings are solved"),
    ("signer_file", "auxiliary", True, "What is known of the signer (.csv, .json): bases, where the face rests"),
)
TEXTS = (
    ("signer", "", "Names the tiers: affect@SIGNER"),
    ("neutral", "auto", "Time of a frame with a neutral face in seconds, or auto"),
)

#: Where ELAN keeps its extensions, below its own folder, on Linux, macOS and Windows.
EXTENSIONS = ("lib/app/extensions", "Contents/app/extensions", "app/extensions", "extensions")

SHELL = """#!/bin/sh
# Started by ELAN, without PATH and in the C locale.
LC_ALL=C.UTF-8
PYTHONUTF8=1
export LC_ALL PYTHONUTF8
exec {python} -m signface.cli.main elan recognise
"""
BATCH = """@echo off\r
chcp 65001 >nul\r
set PYTHONUTF8=1\r
{python} -m signface.cli.main elan recognise\r
"""
HELP = """<!DOCTYPE html>
<html><head><meta charset="utf-8"><title>signface</title></head><body>
<h1>signface</h1>
<p>Annotates the face of a motion-captured take: expressions held and the transitions between them, each with a
confidence. Choose the recording (take); everything else has a default. Labels and confidences are those of
<code>signface annotate</code>, on plain tiers: what a recogniser gives to ELAN has no vocabulary, no dependent
tiers, no colours and no curves. <code>signface annotate --into FILE.eaf</code> writes all of these into the file,
while it is not open in ELAN.</p>
<p>When it is done, ELAN offers to load the tiers. Progress and errors stand in the report.</p>
</body></html>
"""


def extensions_folder(elan: str | PathLike[str]) -> Path:
    """The folder of extensions of an ELAN installation.

    Parameters
    ----------
    elan : path
        The folder that ELAN was installed into (on macOS `ELAN.app`), or its folder of extensions itself.

    Raises
    ------
    SignfaceError
        There is no ELAN in the folder.
    """
    folder = Path(elan)
    if folder.name == "extensions" and folder.is_dir():
        return folder
    for subfolder in EXTENSIONS:
        if (folder / subfolder).is_dir():
            return folder / subfolder
        if (folder / subfolder).parent.is_dir() and subfolder != "extensions":
            return folder / subfolder  # a new ELAN has the folder only once something is in it
    raise SignfaceError(
        "holds no ELAN", file=folder, hint="name the folder that has lib/app, app or Contents/app in it"
    )


def write_extension(folder: str | PathLike[str], *, python: str | None = None) -> list[Path]:
    """Write the recogniser for this machine.

    Parameters
    ----------
    folder : path
        The extension's own folder, below ELAN's `extensions`.
    python : str, optional
        The interpreter that has signface; the running one by default.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    SignfaceError
        The folder cannot be written.
    """
    program = sys.executable if python is None else python
    extension = Path(folder)
    quoted = "'" + program.replace("'", "'\\''") + "'"
    contents = {
        "recognizer.cmdi": etree.tostring(cmdi(), xml_declaration=True, encoding="UTF-8", pretty_print=True),
        "signface.sh": SHELL.format(python=quoted).encode(),
        "signface.bat": BATCH.format(python='"' + program.replace("%", "%%") + '"').encode(),
        "signface.html": HELP.encode(),
    }
    written = []
    for name, content in contents.items():
        with whole_file(extension / name) as temporary:
            temporary.write_bytes(content)
        written.append(extension / name)
    script = extension / "signface.sh"
    script.chmod(script.stat().st_mode | stat.S_IXUSR | stat.S_IXGRP | stat.S_IXOTH)
    return written


def cmdi() -> etree._Element:
    """The description that ELAN reads.

    ELAN splits the command at spaces, so it names a script in its own folder and no path. It drops a parameter
    without `info`, and shows a recogniser on the panel of video recognisers only when an input is a video.
    """
    root = etree.Element(f"{{{CMD}}}CMD", nsmap={None: CMD}, CMDVersion="1.1")
    etree.SubElement(root, f"{{{CMD}}}Header")
    resources = etree.SubElement(root, f"{{{CMD}}}Resources")
    for name in ("ResourceProxyList", "JournalFileProxyList", "ResourceRelationList"):
        etree.SubElement(resources, f"{{{CMD}}}{name}")
    recogniser = etree.SubElement(etree.SubElement(root, f"{{{CMD}}}Components"), f"{{{CMD}}}RECOGNIZER")

    def add(tag: str, text: str, **attributes: str) -> None:
        etree.SubElement(recogniser, f"{{{CMD}}}{tag}", attributes).text = text

    add(
        "recognizer",
        "signface",
        recognizerType="local",
        runLinux="./signface.sh",
        runMac="./signface.sh",
        runWin="cmd /c signface.bat",
        info="signface: facial expressions from motion capture",
    )
    add("documentation", "signface.html")
    for name, kind, optional, info in INPUTS:
        add("input", name, type=kind, level="basic", optional="true" if optional else "false", info=info)
    for name, default, info in TEXTS:
        add("textparam", name, default=default, level="basic", info=info)
    add("output", "tiers", type="tier", level="basic", optional="false", info="The tiers found")
    return root


def read_parameters(xml: bytes) -> tuple[dict[str, str], str]:
    """The parameters that ELAN writes to standard input, and the code page that it writes and reads.

    The first line says UTF-8, but ELAN's Java writes what its platform has: on Windows that is the code page of the
    country (up to Java 17).

    Returns
    -------
    parameters : dict of str to str
        Name and value; those left empty are not among them.
    encoding : str

    Raises
    ------
    SignfaceError
        The text is not what ELAN writes.
    """
    for encoding in ("utf-8-sig", locale.getencoding(), "cp1252", "latin-1"):  # the last reads anything
        try:
            text = xml.decode(encoding)
            break
        except (UnicodeDecodeError, LookupError):
            continue
    text = re.sub(r"^\s*<\?xml[^>]*\?>", "", text)
    text = re.sub(r"&(?!#?\w+;)", "&amp;", text)  # a folder "Tom & Eva", which some versions write as it is
    parser = etree.XMLParser(resolve_entities=False, no_network=True)
    try:
        root = etree.fromstring(text.strip(), parser)
    except etree.XMLSyntaxError as error:
        raise SignfaceError(
            "what came in on standard input is no list of parameters", hint="this command is run by ELAN"
        ) from error
    if root.tag != "PARAM":
        raise SignfaceError(f"expected PARAM on standard input, not {root.tag}", hint="this command is run by ELAN")
    values = {str(item.get("name")): (item.text or "").strip() for item in root.iterfind("param")}
    return {name: value for name, value in values.items() if value}, encoding.removesuffix("-sig")


def discard_tier_file(path: str | PathLike[str]) -> None:
    """Remove the tiers of an earlier run: ELAN offers to load what is in the file also after a run that failed.

    Raises
    ------
    SignfaceError
        The file holds something else than a recogniser's tiers.
    """
    file = Path(path)
    if not file.exists():
        return
    try:
        ours = file.stat().st_size == 0 or parse_xml(file).getroot().tag == "TIER"
    except SignfaceError:
        ours = False
    if not ours:
        raise SignfaceError("holds something else than tiers", file=file, hint="choose another file for the tiers")
    file.unlink()


def progress_line(share: float, what: str) -> str:
    """A line that ELAN shows as progress: `PROGRESS: 0.4 solving`."""
    return f"PROGRESS: {share:.2f} {what}"


def write_tier_file(path: str | PathLike[str], tier: Tier, *, with_dependents: Sequence[str] = ()) -> None:
    """Write a tier, and dependents of it by channel, as the file that ELAN imports.

    Names of tiers stand in one attribute, parted by spaces, so a space in a name becomes `_`. ELAN reads seconds as
    32-bit numbers and cuts them to milliseconds, which would turn 1.234 s into 1233 ms: 0.4 ms are added.

    Raises
    ------
    SignfaceError
        The folder cannot be written.
    """
    dependents = [child for child in tier.dependents if child.channel in with_dependents]
    suffix = tier.name.removeprefix(tier.channel)
    names = [tier.name, *(child.channel + suffix for child in dependents)]
    root = etree.Element("TIER", columns=" ".join(name.replace(" ", "_") for name in names))
    for number, (start, end, value) in enumerate(zip(tier.start_ms, tier.end_ms, tier.values)):
        span = etree.SubElement(root, "span", start=f"{start / 1000 + 0.0004:.4f}", end=f"{end / 1000 + 0.0004:.4f}")
        etree.SubElement(span, "v").text = value
        for child in dependents:
            etree.SubElement(span, "v").text = child.values[number] or ""
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        etree.ElementTree(root).write(stream, xml_declaration=True, encoding="UTF-8", pretty_print=True)
