"""Films and curves are linked once, wherever a file has moved to, and ELAN can open what is linked."""

from __future__ import annotations

import shutil
import warnings

import pytest
from lxml import etree

from signface.annotation import Annotation
from signface.elan.document import read_document
from signface.elan.links import film_origin
from signface.elan.writing import write_eaf
from signface.errors import SignfaceWarning
from tests.elan.test_curves import descriptors
from tests.elan.test_templates import LAB
from tests.fixtures.elan_files import assert_valid, labelled

OF_THE_LAB = '<MEDIA_DESCRIPTOR MEDIA_URL="file:///films/a.mp4" MIME_TYPE="video/mp4" TIME_ORIGIN="40"/>'


def take(labels: str = "N NJ J JN N") -> Annotation:
    return Annotation(descriptors(), labelled(labels), "forest")


def media(path) -> list[dict[str, str]]:
    return [dict(element.attrib) for element in etree.parse(path).iterfind("HEADER/MEDIA_DESCRIPTOR")]


def links(path) -> list[str]:
    return [element.get("RELATIVE_LINK_URL") for element in etree.parse(path).iterfind("HEADER/LINKED_FILE_DESCRIPTOR")]


@pytest.mark.parametrize(
    "urls",
    [
        'MEDIA_URL="file:///C:/Users/anna/corpus/film ä.mp4" RELATIVE_MEDIA_URL="./film ä.mp4"',
        'MEDIA_URL="file:///C:/Users/anna/corpus/film ä.mp4" RELATIVE_MEDIA_URL="film ä.mp4"',
        'MEDIA_URL="file:///gone/x.mp4" RELATIVE_MEDIA_URL="file:/./film ä.mp4"',
        'MEDIA_URL="file:///gone/x.mp4" RELATIVE_MEDIA_URL="./film%20%C3%A4.mp4"',
        'MEDIA_URL="FILE://HERE/film ä.mp4"',
        'MEDIA_URL="file:HERE/film%20%C3%A4.mp4"',
        'MEDIA_URL="file:///C:/Users/anna/corpus/film ä.mp4"',
        'MEDIA_URL="file:///D:/film ä.mp4" RELATIVE_MEDIA_URL="../../media/film ä.mp4"',
    ],
)
def test_a_film_that_the_file_links_is_not_linked_again(tmp_path, urls):
    (tmp_path / "film ä.mp4").write_bytes(b"film")
    file = tmp_path / "lab.eaf"
    urls = urls.replace("HERE", str(tmp_path))
    file.write_text(
        LAB.replace(OF_THE_LAB, f'<MEDIA_DESCRIPTOR {urls} MIME_TYPE="video/mp4" TIME_ORIGIN="40"/>'), "utf-8"
    )
    write_eaf(labelled(), into=file, signer="S1", video=tmp_path / "film ä.mp4")
    assert len(media(file)) == 1
    assert media(file)[0]["TIME_ORIGIN"] == "40"
    assert_valid(file)


def test_of_two_films_of_one_name_the_one_that_is_meant_has_the_clock(tmp_path):
    films = ""
    for name, origin in (("cam1", 0), ("cam2", 500)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "film.mp4").write_bytes(name.encode())
        urls = f'MEDIA_URL="file:///x/{name}/film.mp4" RELATIVE_MEDIA_URL="./{name}/film.mp4"'
        films += f'<MEDIA_DESCRIPTOR {urls} MIME_TYPE="video/mp4" TIME_ORIGIN="{origin}"/>'
    file = tmp_path / "lab.eaf"
    file.write_text(LAB.replace(OF_THE_LAB, films), "utf-8")
    root = read_document(file).getroot()
    assert [film_origin(root, file, tmp_path / name / "film.mp4") for name in ("cam1", "cam2")] == [0, 500]


def test_what_was_taken_from_a_film_follows_it(tmp_path):
    (tmp_path / "film.mp4").write_bytes(b"film")
    file = tmp_path / "lab.eaf"
    film = '<MEDIA_DESCRIPTOR MEDIA_URL="file:///D:/film.mp4" MIME_TYPE="video/mp4"/>'
    sound = film.replace("film.mp4", "a.wav").replace("/>", ' EXTRACTED_FROM="file:///D:/film.mp4"/>')
    file.write_text(LAB.replace(OF_THE_LAB, film + sound), "utf-8")
    write_eaf(labelled(), into=file, signer="S1", video=tmp_path / "film.mp4")
    assert media(file)[1]["EXTRACTED_FROM"] == media(file)[0]["MEDIA_URL"] == f"file://{tmp_path}/film.mp4"
    assert media(file)[1]["MEDIA_URL"] == "file:///D:/a.wav"


def test_another_film_is_linked_beside_the_labs(tmp_path):
    for name in ("cam1", "cam2"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "film.mp4").write_bytes(name.encode())
    file = tmp_path / "lab.eaf"
    own = (
        '<MEDIA_DESCRIPTOR MEDIA_URL="file:///x/film.mp4" RELATIVE_MEDIA_URL="./cam1/film.mp4" MIME_TYPE="video/mp4"/>'
    )
    file.write_text(LAB.replace(OF_THE_LAB, own), "utf-8")
    write_eaf(labelled(), into=file, signer="S1", video=tmp_path / "cam2" / "film.mp4")
    assert [one["RELATIVE_MEDIA_URL"] for one in media(file)] == ["./cam1/film.mp4", "./cam2/film.mp4"]


def test_a_film_is_linked_although_the_tiers_are_there_already(tmp_path):
    (tmp_path / "film.mp4").write_bytes(b"film")
    file = tmp_path / "lab.eaf"
    file.write_text(LAB, "utf-8")
    write_eaf(labelled(), into=file, signer="S1")
    write_eaf(labelled(), into=file, signer="S1", video=tmp_path / "film.mp4")
    assert [one.get("RELATIVE_MEDIA_URL") for one in media(file)] == [None, "./film.mp4"]
    before = file.read_bytes()
    write_eaf(labelled(), into=file, signer="S1", video=tmp_path / "film.mp4")
    assert file.read_bytes() == before


@pytest.mark.parametrize("labels", ["N NJ J JN N", "N NA A AN N"])
def test_curves_are_linked_once_after_the_folder_has_moved(tmp_path, labels):
    (tmp_path / "old").mkdir()
    file = tmp_path / "old" / "lab.eaf"
    file.write_text(LAB, "utf-8")
    write_eaf(take(), into=file, signer="S1")
    shutil.move(tmp_path / "old", tmp_path / "new")
    file = tmp_path / "new" / "lab.eaf"
    write_eaf(take(labels), into=file, signer="S1")
    assert links(file) == [None, "./lab.curves.csv", "./lab_tsconf.xml"]
    source = etree.parse(file.with_name("lab_tsconf.xml")).find("tracksource").get("source-url")
    assert source == etree.parse(file).findall("HEADER/LINKED_FILE_DESCRIPTOR")[1].get("LINK_URL")
    assert str(tmp_path / "new") in source
    assert_valid(file)


def test_links_that_stand_twice_become_one(tmp_path):
    file = tmp_path / "lab.eaf"
    file.write_text(LAB, "utf-8")
    write_eaf(take(), into=file, signer="S1")
    text = file.read_text("utf-8")
    twice = [line for line in text.splitlines(keepends=True) if "lab.curves.csv" in line or "lab_tsconf.xml" in line]
    moved = "".join(twice).replace(str(tmp_path), "/elsewhere")
    file.write_text(text.replace("<PROPERTY", moved + "<PROPERTY", 1), "utf-8")
    assert len(links(file)) == 5
    write_eaf(take(), into=file, signer="S1")
    assert links(file) == [None, "./lab.curves.csv", "./lab_tsconf.xml"]


@pytest.mark.parametrize("labels", ["N NJ J JN N", "N NA A AN N"])
def test_a_renamed_copy_shows_curves_of_its_own(tmp_path, labels):
    write_eaf(take(), tmp_path / "take.eaf", signer="S1")
    copy = tmp_path / "copy.eaf"
    shutil.copy(tmp_path / "take.eaf", copy)
    shutil.copy(tmp_path / "take_tsconf.xml", tmp_path / "copy_tsconf.xml")  # as ELAN does on saving as
    write_eaf(take(labels), into=copy, signer="S1")
    assert links(copy) == ["./copy.curves.csv", "./copy_tsconf.xml"]
    sources = etree.parse(tmp_path / "copy_tsconf.xml").findall("tracksource")
    assert [source.get("source-url").rpartition("/")[2] for source in sources] == ["copy.curves.csv"]
    assert (tmp_path / "take_tsconf.xml").is_file()
    assert links(tmp_path / "take.eaf") == ["./take.curves.csv", "./take_tsconf.xml"]


def test_a_labs_own_description_hides_our_curves_and_that_is_said(tmp_path):
    file = tmp_path / "lab.eaf"
    own = '<LINKED_FILE_DESCRIPTOR LINK_URL="file:///films/theirs_tsconf.xml" MIME_TYPE="text/xml"/>\n    <PROPERTY'
    file.write_text(LAB.replace("<PROPERTY", own, 1), "utf-8")
    with pytest.warns(SignfaceWarning, match="links theirs_tsconf.xml, and ELAN reads one"):
        write_eaf(take(), into=file, signer="S1")
    assert not (tmp_path / "lab_tsconf.xml").exists()
    panels = etree.parse(tmp_path / "lab.pfsx").xpath("pref[@key='TimeSeriesViewer.NumberOfPanels']")
    assert panels == []


@pytest.mark.parametrize("name", ["Zoë", "李小龙", "Пётр"])
def test_a_path_beyond_ascii_is_linked_so_that_elan_opens_the_curves(tmp_path, name):
    folder = tmp_path / name
    with pytest.warns(SignfaceWarning, match="letters outside ASCII"):
        write_eaf(take(), folder / "take.eaf", signer="S1")
    curves, description = etree.parse(folder / "take.eaf").findall("HEADER/LINKED_FILE_DESCRIPTOR")
    assert description.get("LINK_URL") == f"FILE://{folder}/take_tsconf.xml"
    assert description.get("RELATIVE_LINK_URL") == "./take_tsconf.xml"
    assert curves.get("LINK_URL") == f"file://{folder}/take.curves.csv"
    with pytest.warns(SignfaceWarning):
        write_eaf(take("N NA A AN N"), folder / "take.eaf", signer="S1")
    assert len(links(folder / "take.eaf")) == 2
    assert_valid(folder / "take.eaf")


@pytest.mark.parametrize("name", ["100 % sure", "a%20b c", "50% #1 [x]"])
def test_any_folder_can_be_written_to(tmp_path, name):
    folder = tmp_path / name
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        written = write_eaf(take(), folder / "take.eaf", signer="S1")
    assert all(file.is_file() for file in written)
    assert (folder / "take.pfsx").is_file()
