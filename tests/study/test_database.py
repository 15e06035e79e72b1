"""Answers outlive a crash and a crowd, in SQLite and in PostgreSQL."""

from __future__ import annotations

import asyncio
import threading

import httpx
import pytest

from benchmarks.study_load import check_nothing_is_lost, run_load
from signface.cli.main import main
from signface.errors import SignfaceError
from signface.study.questionnaire.store import Refused, open_store
from tests.fixtures.study_servers import postgresql, served
from tests.fixtures.study_site import Browser, Site, write_study

pytest.importorskip("sqlalchemy", reason="needs the extra study")


@pytest.fixture(scope="module")
def database():
    with postgresql() as url:
        yield url


def test_sqlite_keeps_a_log_and_waits_for_the_disk(tmp_path):
    import sqlalchemy

    store = open_store(tmp_path / "answers.sqlite")
    with store._engine.connect() as connection:
        values = [
            connection.execute(sqlalchemy.text(f"PRAGMA {name}")).scalar() for name in ("journal_mode", "synchronous")
        ]
    assert values == ["wal", 2]
    store.close()


@pytest.mark.slow
def test_a_server_that_is_killed_loses_no_acknowledged_answer(tmp_path):
    write_study(tmp_path)
    acknowledged, stop = [], threading.Event()

    def answer_for_ever(address: str, number: int) -> None:
        with httpx.Client(base_url=address, timeout=20) as client:
            browser = Browser(client)
            try:
                browser.to_the_first_film()
                token, path = client.cookies["participant"], browser.path
                value = 0
                while not stop.is_set():
                    value = value % 7 + 1
                    browser.get(path)
                    answer = browser.send(
                        {**browser.fill(), "answer_intensity": str(value), "answer_comment": f"{value}"}
                    )
                    if answer.status_code == 200:
                        acknowledged.append((token, value))
            except (httpx.HTTPError, AssertionError):
                return  # the server is gone

    with served(tmp_path) as (address, process):
        people = [threading.Thread(target=answer_for_ever, args=(address, number)) for number in range(4)]
        for person in people:
            person.start()
        while len(acknowledged) < 40 and any(person.is_alive() for person in people):
            threading.Event().wait(0.02)
        process.kill()
        stop.set()
        for person in people:
            person.join()
    assert len(acknowledged) >= 40
    store = open_store(tmp_path / "answers.sqlite")
    answers = store.everything()[1]
    for token in {token for token, _ in acknowledged}:
        person = store.find(token)
        assert person is not None
        kept = {question: value for who, film, question, value in answers if who == person.id and film}
        last = [value for owner, value in acknowledged if owner == token][-1]
        # An answer that was kept but not acknowledged in time may have followed the last acknowledged one.
        assert int(kept["answer_intensity"]) in (last, last % 7 + 1)
        assert kept["answer_comment"] == kept["answer_intensity"]  # all of a page or none
    store.close()


@pytest.mark.slow
def test_a_crowd_loses_no_answer(tmp_path):
    write_study(tmp_path)
    with served(tmp_path) as (address, _):
        load = asyncio.run(run_load(address, 25, arrive_s=1.0, look_s=0.3))
    assert load.errors == []
    assert load.finished == 25
    assert len(load.acknowledged) == 25 * 6
    assert check_nothing_is_lost(load, tmp_path / "answers.sqlite") == (0, 0)


@pytest.mark.slow
def test_a_crowd_loses_no_answer_in_postgresql(tmp_path, database):
    write_study(tmp_path)
    with served(tmp_path, "--database", database) as (address, _):
        load = asyncio.run(run_load(address, 15, arrive_s=0.5, look_s=0.2))
    assert load.errors == []
    assert load.finished == 15
    assert check_nothing_is_lost(load, database) == (0, 0)
    assert not (tmp_path / "answers.sqlite").exists()
    output = tmp_path / "responses.csv"
    assert main(["study", "export", str(tmp_path), "--database", database, "-o", str(output), "--finished"]) == 0
    assert len(output.read_text().splitlines()) >= 1 + 15 * 6


@pytest.mark.slow
def test_postgresql_follows_the_same_rules(tmp_path, database):
    site = Site(tmp_path, store=open_store(database))
    browser = site.browser()
    browser.to_the_first_film()
    path, token = browser.path, browser.token
    fields = {"form_token": token, **browser.fill()}
    threads = [threading.Thread(target=browser.client.post, args=(path,), kwargs={"data": fields}) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    person = site.store.find(browser.client.cookies["participant"])
    own = [answer for answer in site.answers() if answer[0] == person.id and answer[1]]
    assert len(own) == len({answer[:3] for answer in own}) == 3
    with pytest.raises(Refused, match="not shown"):
        site.store.answer(person, 0, "nothing", {"answer_intensity": "1"})
    browser.get("/next")
    browser.to_the_end()
    with pytest.raises(Refused, match="final"):
        site.store.answer(person, 0, own[0][1], {"answer_intensity": "1"})
    assert site.store.erase(person.pseudonym) > 0
    assert site.store.find(browser.client.cookies["participant"]) is None
    site.store.close()


@pytest.mark.slow
def test_many_clicks_at_once_are_one_answer_in_sqlite(tmp_path):
    site = Site(tmp_path)
    browser = site.browser()
    browser.to_the_first_film()
    person = site.store.find(browser.client.cookies["participant"])
    film = next(iter(site.study.stimuli))
    site.store.show(person, film)
    threads = [
        threading.Thread(target=site.store.answer, args=(person, 0, film, {"answer_intensity": str(value)}))
        for value in range(1, 8)
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len([answer for answer in site.answers() if answer[1]]) == 1
    site.store.close()


@pytest.mark.parametrize(
    "url",
    ["postgresql://nobody@127.0.0.1:1/none", "mysql://root@localhost/x", "postgresql://[", "sqlite:////proc/none/x"],
)
def test_a_database_that_cannot_be_opened_is_one_line(url):
    with pytest.raises(SignfaceError) as caught:
        open_store(url)
    assert "\n" not in str(caught.value)


def test_the_password_of_a_database_is_not_shown():
    with pytest.raises(SignfaceError) as caught:
        open_store("postgresql://someone:hunter2@127.0.0.1:1/none")
    assert "hunter2" not in str(caught.value)
