"""Hostile input: refused, logged, nothing lost."""

from __future__ import annotations

import logging
import os

import pytest

from tests.fixtures.study_site import Site, write_study

#: What all of them share takes long to make.
pytestmark = pytest.mark.slow

pytest.importorskip("starlette", reason="needs the extra study")


@pytest.fixture
def site(tmp_path):
    made = Site(tmp_path / "study")
    yield made
    made.store.close()


@pytest.fixture
def someone(site):
    """Someone who has answered one film and looks at the second."""
    browser = site.browser()
    browser.to_the_first_film()
    browser.go_on()
    return browser


@pytest.fixture
def refused(site, caplog):
    """Check that a request was refused with a status, logged in one line, and changed nothing."""
    caplog.set_level(logging.WARNING, "signface.study")
    before = site.store.everything

    def check(answer, status, reason):
        assert answer.status_code == status, answer.text
        assert reason in caplog.records[-1].getMessage()
        assert "\n" not in caplog.records[-1].getMessage()
        assert site.store.everything() == check.state
        assert "Traceback" not in answer.text

    check.state = None
    check.remember = lambda: setattr(check, "state", before())
    return check


@pytest.mark.parametrize(
    "path",
    [
        "/film/../study.toml",
        "/film/%2e%2e%2fstudy.toml",
        "/film/..%2f..%2fetc%2fpasswd",
        "/film/A1_LSTS30.mp4",
        "/static/..%2fserver.py",
        "/static/%2e%2e/design.py",
        "/film/%00",
        "/film/" + "a" * 5000,
    ],
)
def test_a_path_that_leaves_the_films_is_refused(site, someone, refused, path):
    refused.remember()
    answer = someone.client.get(path)
    refused(answer, 404, "refused GET")
    assert b"root:" not in answer.content
    assert b"seed = 5" not in answer.content


def test_a_film_that_links_out_of_the_folder_is_refused(tmp_path):
    from signface.errors import SignfaceError
    from signface.study.design import read_study

    write_study(tmp_path / "study")
    film = tmp_path / "study" / "films" / "A1_LSTS30.mp4"
    film.unlink()
    os.symlink("/etc/hostname", film)
    with pytest.raises(SignfaceError, match="outside"):
        read_study(tmp_path / "study")


@pytest.mark.parametrize("token", ["x" * 32, "' OR 1=1 --", "a" * 4000, "0"])
def test_a_forged_session_is_refused(site, someone, refused, token):
    refused.remember()
    stranger = site.browser()
    stranger.client.cookies.set("participant", token)
    refused(stranger.client.get("/next"), 403, "forged session")
    refused(stranger.client.get("/page/1"), 403, "forged session")


def test_a_forged_private_link_is_refused_and_not_logged(site, someone, refused, caplog):
    refused.remember()
    refused(site.browser().client.get("/resume/guessed-token"), 403, "forged session")
    assert "guessed-token" not in caplog.text


def test_nobody_answers_without_a_session(site, someone, refused):
    refused.remember()
    answer = site.browser().client.post(someone.path, data={"form_token": someone.token, **someone.fill()})
    refused(answer, 403, "no session")


def test_the_form_of_one_participant_does_not_serve_another(site, someone, refused):
    other = site.browser()
    other.to_the_first_film()
    refused.remember()
    refused(other.send({"form_token": someone.token, **other.fill()}), 403, "forged form")
    refused(other.send({"form_token": "", **other.fill()}), 403, "forged form")
    refused(other.send({"form_token": "é" * 40, **other.fill()}), 403, "forged form")


def test_a_token_is_of_no_use_once_everything_is_final(site, refused):
    browser = site.browser()
    browser.to_the_first_film()
    path, token, fields = browser.path, browser.token, browser.fill()
    browser.to_the_end()
    refused.remember()
    refused(browser.client.post(path, data={"form_token": token, **fields}), 409, "final")


@pytest.mark.parametrize(
    "headers",
    [
        {"origin": "https://evil.example"},
        {"origin": "null"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site", "origin": "http://other.testserver"},
    ],
)
def test_a_post_from_another_site_is_refused(someone, refused, headers):
    refused.remember()
    refused(someone.send(someone.fill(), headers=headers), 403, "cross-site post")


def test_a_post_from_our_own_page_is_accepted(someone):
    headers = {"origin": "http://testserver", "sec-fetch-site": "same-origin"}
    assert someone.send(someone.fill(), headers=headers).status_code == 200


def test_an_oversized_body_is_refused(someone, refused):
    refused.remember()
    refused(someone.send({**someone.fill(), "answer_comment": "x" * 20_000}), 413, "oversized body")

    def endless():
        for _ in range(100):
            yield b"a" * 1024

    form = {"content-type": "application/x-www-form-urlencoded"}
    refused(someone.client.post(someone.path, content=endless(), headers=form), 413, "oversized body")


@pytest.mark.parametrize(
    ("content", "kind", "status"),
    [
        (b'{"answer_intensity": 3}', "application/json", 415),
        (b"--x\r\n", "multipart/form-data; boundary=x", 415),
        (b"answer_intensity=%ff%fe", "application/x-www-form-urlencoded", 400),
        (b"answer_intensity=3&answer_intensity=4", "application/x-www-form-urlencoded", 400),
        (b"&".join(b"q%d=1" % number for number in range(500)), "application/x-www-form-urlencoded", 400),
        ("answer_intensity=é".encode(), "application/x-www-form-urlencoded", 400),
    ],
)
def test_a_body_that_is_no_form_of_ours_is_refused(someone, refused, content, kind, status):
    refused.remember()
    refused(someone.client.post(someone.path, content=content, headers={"content-type": kind}), status, "form")


@pytest.mark.parametrize("value", ["0", "8", "-1", "3.5", "99999999999999999999", "٣", "1e1", "three", "3; DROP TABLE"])
def test_an_answer_out_of_range_is_refused(someone, refused, value):
    refused.remember()
    refused(someone.send({**someone.fill(), "answer_intensity": value}), 400, "out of range")


def test_a_choice_that_is_not_offered_is_refused(someone, refused):
    refused.remember()
    refused(someone.send({**someone.fill(), "answer_expression": "Su"}), 400, "out of range")


def test_an_age_that_nobody_has_is_asked_again(site):
    browser = site.browser()
    browser.agree()
    for age in ("7", "300", "old", "-20", ""):
        assert browser.send({"age": age}).status_code == 422
    assert site.answers() == []


def test_a_question_of_another_page_is_refused(someone, refused):
    refused.remember()
    refused(someone.send({**someone.fill(), "age": "40"}), 400, "foreign question")
    refused(someone.send({**someone.fill(), "answer_fidelity": "4"}), 400, "foreign question")


def test_an_answer_for_a_film_that_was_not_shown_is_refused(site, someone, refused):
    refused.remember()
    ahead = int(someone.path.rpartition("/")[2]) + 1
    refused(someone.client.get(f"/page/{ahead}"), 403, "not shown")
    refused(someone.send(someone.fill(), f"/page/{ahead}"), 403, "not shown")
    refused(someone.send(someone.fill(), "/page/999"), 404, "no such page")
    refused(someone.send(someone.fill(), "/page/0"), 404, "no such page")


def test_a_block_cannot_be_confirmed_before_it_is_answered(site, someone, refused):
    refused.remember()
    refused(someone.send({}, "/page/6"), 409, "incomplete")
    refused(someone.send({}, "/page/9"), 409, "final")


def test_script_in_an_answer_is_shown_as_text(site):
    browser = site.browser()
    browser.to_the_first_film()
    path = browser.path
    script = "</textarea><script>alert(1)</script>"
    browser.send({**browser.fill(), "answer_comment": script})
    page = browser.get(path)
    assert "<script>alert" not in page.text
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page.text


def test_the_organisers_page_needs_its_token(site, someone, refused, caplog):
    refused.remember()
    for token in ("guess", "", "organiser-of-the-test", "é"):
        answer = someone.client.get(f"/organiser/{token}")
        assert answer.status_code in (403, 404)
    assert "guess" not in caplog.text


def test_what_is_logged_cannot_forge_a_line(someone, refused):
    refused.remember()
    refused(someone.client.get("/x%0A2026-01-01 everything is fine"), 404, "refused GET /x\\n2026")


def test_other_methods_are_refused(someone, refused):
    refused.remember()
    refused(someone.client.delete("/page/2"), 405, "refused DELETE")
    refused(someone.client.put("/begin", data={"consent": "yes"}), 405, "refused PUT")
