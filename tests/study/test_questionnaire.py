"""The questionnaire from consent to thanks, and what it keeps."""

from __future__ import annotations

import csv
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from signface.cli.main import main
from signface.errors import SignfaceError
from signface.study.design import read_study
from signface.study.questionnaire.export import COLUMNS, write_export
from signface.study.questionnaire.questionnaire import check_answer, order_of, pages_of
from signface.study.reading import read_responses
from tests.fixtures.study_site import ORGANISER, SMALL, Site, shipped_study, write_study

pytest.importorskip("starlette", reason="needs the extra study")


@pytest.fixture
def site(tmp_path):
    made = Site(tmp_path / "study")
    yield made
    made.store.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "films", "methods"),
    [
        ("group-1", 54, {"LSTS30", "LSTS50", "LSTS70"}),
        ("group-2a", 54, {"LSTS30", "LS", "video"}),
        ("group-2b", 36, {"LSTS30", "LS"}),
    ],
)
def test_a_questionnaire_of_the_thesis_goes_from_consent_to_an_export_that_analyse_reads(
    tmp_path, name, films, methods
):
    site = Site(tmp_path, shipped_study(name, tmp_path))
    browser = site.browser()
    browser.agree()
    blocks = len(site.study.blocks)
    assert browser.to_the_end() == 1 + films + blocks
    people, rows = write_export(site.study, site.store, tmp_path / "responses.csv")
    assert (people, rows) == (1, films)
    with open(tmp_path / "responses.csv", encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    assert tuple(table[0]) == COLUMNS
    assert {row["method"] for row in table} == methods
    assert {row["age"] for row in table} == {"33"}
    fidelity = {row["answer_fidelity"] for row in table}
    assert fidelity == ({"3"} if name == "group-2b" else {""})
    responses = read_responses(tmp_path / "responses.csv")
    assert len(responses.table) == films
    site.store.close()
    out = tmp_path / "results"
    assert main(["study", "analyse", str(site.study.folder), "-o", str(out), "--resamples", "100"]) == 0
    again = tmp_path / "again"
    assert main(["study", "analyse", str(tmp_path / "responses.csv"), "-o", str(again), "--resamples", "100"]) == 0
    means = "tables/means_by_method.csv"
    assert (out / means).read_bytes() == (again / means).read_bytes()


def test_a_study_nobody_has_answered_says_so(tmp_path, capsys):
    study = shipped_study("group-1", tmp_path)
    assert main(["study", "analyse", str(study.folder)]) == 2
    assert "no answers yet" in capsys.readouterr().err
    assert not (study.folder / "answers.sqlite").exists()


def test_videos_come_after_animations(tmp_path):
    study = shipped_study("group-2a", tmp_path)
    for number in range(1, 20):
        shown = [page.stimulus.method for page in pages_of(study, number) if page.stimulus]
        assert set(shown[:36]) == {"LSTS30", "LS"}
        assert set(shown[36:]) == {"video"}


def test_every_participant_has_an_order_of_their_own_that_can_be_found_again(tmp_path):
    study = shipped_study("group-1", tmp_path)
    orders = [order_of(study, number) for number in range(1, 40)]
    assert len(set(orders)) == 39
    assert orders[3] == order_of(study, 4)
    assert all(sorted(order[0]) == list(range(54)) for order in orders)
    places = [order[0].index(0) for order in (order_of(study, number) for number in range(1, 400))]
    assert 20 < sum(places) / len(places) < 33  # the first film of the list stands anywhere, 26.5 on average


@pytest.mark.slow
def test_someone_who_closes_the_browser_resumes_by_the_private_link(site):
    first = site.browser()
    first.to_the_first_film()
    first.go_on()
    link = re.search(r'href="(/resume/[^"]+)"', first.page.text)[1]
    place = first.path
    second = site.browser()
    second.get(link)
    assert second.path == place
    second.to_the_end()
    assert len(site.store.everything()[0]) == 1


def test_the_private_link_is_not_in_the_database(site, tmp_path):
    browser = site.browser()
    browser.to_the_first_film()
    token = browser.client.cookies["participant"]
    site.store.close()
    stored = b"".join(file.read_bytes() for file in (tmp_path / "study").glob("answers.sqlite*"))
    assert token.encode() not in stored


def test_a_form_that_is_sent_many_times_is_one_answer_a_question(site):
    browser = site.browser()
    browser.to_the_first_film()
    page, fields = browser.path, {"form_token": browser.token, **browser.fill()}
    for _ in range(5):
        assert browser.client.post(page, data=fields).status_code == 200
    films = [answer for answer in site.answers() if answer[1]]
    assert len(films) == len({answer[:3] for answer in films}) == 3


def test_consent_that_is_sent_twice_is_one_participant(site):
    browser = site.browser()
    browser.get("/")
    fields = {"form_token": browser.token, "consent": "yes"}
    for _ in range(2):
        assert browser.client.post("/begin", data=fields).status_code == 200
    assert len(site.store.everything()[0]) == 1


def test_an_answer_can_be_changed_until_its_block_is_confirmed(site):
    browser = site.browser()
    browser.to_the_first_film()
    first, token = browser.path, browser.token
    fields = browser.fill()
    while "<video" in browser.page.text:
        browser.go_on()
    browser.get(first)
    assert 'value="3" checked' in re.sub(r' id="[\w-]+"', "", browser.page.text)
    assert browser.send({**fields, "answer_intensity": "6"}).status_code == 200
    assert "6" in {answer[3] for answer in site.answers() if answer[2] == "answer_intensity"}
    before = site.answers()
    browser.get("/next")
    browser.go_on()  # the block is confirmed
    late = browser.client.post(first, data={"form_token": token, **fields, "answer_intensity": "1"})
    assert late.status_code == 409
    assert browser.client.get(first).status_code == 409
    assert site.answers() == before


def test_a_page_with_something_missing_comes_back_with_what_was_answered(site):
    browser = site.browser()
    browser.to_the_first_film()
    answer = browser.send({"answer_expression": "J"})
    assert answer.status_code == 422
    assert 'role="alert"' in answer.text
    assert re.search(r'value="J"[^>]* checked', answer.text)
    assert not [answer for answer in site.answers() if answer[1]]


def test_the_language_can_be_chosen_and_changed(site):
    browser = site.browser()
    assert '<html lang="fr">' in browser.get("/", headers={"accept-language": "fr-CA,fr;q=0.9"}).text
    assert '<html lang="en">' in browser.get("/", headers={"accept-language": "de"}).text
    assert "Êtes-vous" in browser.get("/?language=fr").text
    assert "Êtes-vous" in browser.get("/").text
    browser.get("/?language=en")
    browser.agree()
    browser.get("/language/fr")
    assert "Quel âge" in browser.page.text


def test_the_name_of_a_film_does_not_tell_what_is_shown(site):
    browser = site.browser()
    browser.to_the_first_film()
    source = re.search(r'<video src="([^"]+)"', browser.page.text)[1]
    stimuli = site.study.stimuli
    assert not any(word in browser.page.text for word in (*stimuli, "LSTS30", ".mp4"))
    film = browser.client.get(source, headers={"range": "bytes=1-2"})
    assert (film.status_code, film.content, film.headers["content-type"]) == (206, b"il", "video/mp4")


def test_no_page_asks_anything_of_another_site_or_keeps_an_address(site):
    browser = site.browser()
    browser.to_the_first_film()
    pages = [browser.page, browser.client.get("/"), browser.client.get("/static/style.css")]
    for page in pages:
        assert "http://" not in page.text
        assert "https://" not in page.text
        assert "default-src 'none'" in page.headers["content-security-policy"]
    columns = {column.name for table in site.store._metadata.tables.values() for column in table.columns}
    assert not columns & {"ip", "address", "agent", "email", "name"}


def test_an_erased_participant_leaves_nothing_behind(site, tmp_path):
    stays, goes = site.browser(), site.browser()
    for browser in (stays, goes):
        browser.to_the_first_film()
    goes.send({**goes.fill(), "answer_comment": "remember-me-not"})
    stays.go_on()
    pseudonym = site.store.find(goes.client.cookies["participant"]).pseudonym
    assert site.store.erase(pseudonym.strip()) == 4
    assert goes.client.get("/next").status_code == 403
    assert len(site.store.everything()[0]) == 1
    with pytest.raises(SignfaceError, match="no participant"):
        site.store.erase(pseudonym)
    site.store.close()
    stored = b"".join(file.read_bytes() for file in (tmp_path / "study").glob("answers.sqlite*"))
    assert b"remember-me-not" not in stored
    assert pseudonym.encode() not in stored


def test_the_organiser_sees_how_the_study_goes(site):
    browser = site.browser()
    browser.agree()
    browser.to_the_end()
    site.browser().agree()
    page = site.browser().get(f"/organiser/{ORGANISER}")
    assert page.status_code == 200
    assert "50 %" in page.text
    assert re.findall(r"<dd>([\d.]+)</dd>", page.text)[:3] == ["2", "1", "6"]


def test_a_text_that_looks_like_a_formula_is_exported_as_a_text(site, tmp_path):
    browser = site.browser()
    browser.to_the_first_film()
    browser.send({**browser.fill(), "answer_comment": "=cmd|'/c calc'!A1"})
    write_export(site.study, site.store, tmp_path / "out.csv")
    assert "'=cmd" in (tmp_path / "out.csv").read_text()
    assert write_export(site.study, site.store, tmp_path / "out.csv", finished_only=True) == (0, 0)


@settings(deadline=None, max_examples=80)
@given(st.text(max_size=12))
def test_a_number_that_is_kept_is_in_range(text):
    from signface.study.design import Question

    value, mistake = check_answer(Question("age", "number", {}, low=16, high=120), text)
    assert (mistake is None) == (value is not None)
    if value is not None:
        assert 16 <= int(value) <= 120


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("films/{expression}", "../{expression}", "outside"),
        ("films/{expression}{intensity}_{method}.mp4", "/etc/passwd", "outside"),
        (".mp4", ".exe", "neither .mp4"),
        ('kind = "likert"', 'kind = "slider"', "needs kind"),
        ('en = "Small study"', "", "not given in en"),
        ('questions = ["answer_intensity"]', 'questions = ["answer_colour"]', "answer_colour"),
        ('value = "J"', 'value = "A"', "different values"),
        ('methods = ["pair"]', "", "lists of expressions"),
        ('languages = ["en", "fr"]', "languages = []", "languages must be"),
        ("seed = 5", "seed = [", "is not TOML"),
        ('column = "age"', 'column = "answer_intensity"', "two questions"),
    ],
)
def test_a_mistake_in_study_toml_is_said(tmp_path, before, after, said):
    assert before in SMALL
    with pytest.raises(SignfaceError, match=said):
        write_study(tmp_path, SMALL.replace(before, after))


def test_films_that_are_missing_are_named(tmp_path):
    write_study(tmp_path)
    (tmp_path / "films" / "A1_LSTS30.mp4").unlink()
    with pytest.raises(SignfaceError, match=r"A1_LSTS30\.mp4"):
        read_study(tmp_path)


def test_another_language_needs_all_of_its_words(tmp_path):
    text = SMALL.replace('["en", "fr"]', '["es"]').replace("en = ", "es = ").replace("fr = ", "ignored = ")
    study = write_study(tmp_path, text)
    with pytest.raises(SignfaceError, match="has no words"):
        Site(tmp_path, study)
