"""Many participants at once: `python -m benchmarks.study_load [--participants 200] [--seconds 60] [--database URL]`.

Participants arrive within the first seconds, fetch their film, look at it, answer, and go on, each through the whole
questionnaire of a small study. Latency is what a participant waits: from sending a form to having the next page. At
the end the database is compared with what the server acknowledged: nothing lost, nothing twice.
"""

from __future__ import annotations

import argparse
import asyncio
import re
import ssl
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import numpy as np


@dataclass
class Load:
    """What the participants saw.

    Parameters
    ----------
    waits : list of float
        Seconds from sending a form to having the next page.
    acknowledged : set of (str, str, str)
        Participant's token, page and value that the server acknowledged.
    errors : list of str
    """

    waits: list[float] = field(default_factory=list)
    acknowledged: dict[tuple[str, str], str] = field(default_factory=dict)
    errors: list[str] = field(default_factory=list)
    finished: int = 0


#: Reading the certificates takes longer than answering a page; once is enough, for nothing here is encrypted.
NO_CERTIFICATES = ssl.create_default_context()


async def take_part(address: str, number: int, load: Load, *, arrive_s: float, look_s: float) -> None:
    """One participant, from consent to thanks, with a pause of `look_s` on every film."""
    rng = np.random.default_rng(number)
    await asyncio.sleep(float(rng.uniform(0, arrive_s)))
    async with httpx.AsyncClient(base_url=address, timeout=60, follow_redirects=True, verify=NO_CERTIFICATES) as client:
        try:
            page = await client.get("/")
            page = await _send(client, load, page, "/begin", {"consent": "yes"})
            while page.url.path != "/thanks":
                film = re.search(r'<video src="([^"]+)"', page.text)
                fields: dict[str, str] = {}
                if film:
                    await client.get(film[1])
                    await asyncio.sleep(float(rng.uniform(0.7, 1.3)) * look_s)
                    fields["answer_intensity"] = str(rng.integers(1, 8))
                    if "answer_expression" in page.text:
                        fields["answer_expression"] = str(rng.choice(["A", "J"]))
                elif 'name="age"' in page.text:
                    fields["age"] = "30"
                path, before = page.url.path, client.cookies["participant"]
                page = await _send(client, load, page, path, fields)
                if film:
                    load.acknowledged[before, path] = fields["answer_intensity"]
            load.finished += 1
        except (httpx.HTTPError, AssertionError, KeyError) as error:
            load.errors.append(f"{type(error).__name__}: {error}")


async def _send(client: httpx.AsyncClient, load: Load, page: httpx.Response, path: str, fields: dict) -> httpx.Response:
    token = re.search(r'name="form_token" value="(\w+)"', page.text)
    assert token, page.text[:500]
    began = time.perf_counter()
    answer = await client.post(path, data={"form_token": token[1], **fields})
    load.waits.append(time.perf_counter() - began)
    assert answer.status_code == 200, f"{answer.status_code} at {path}"
    return answer


async def run_load(address: str, participants: int, *, arrive_s: float, look_s: float) -> Load:
    """All participants at once."""
    load = Load()
    await asyncio.gather(
        *(take_part(address, number, load, arrive_s=arrive_s, look_s=look_s) for number in range(participants))
    )
    return load


def check_nothing_is_lost(load: Load, database: str | Path) -> tuple[int, int]:
    """(lost, extra): acknowledged answers that the database does not hold so, and those that it holds besides."""
    from signface.study.design import read_study
    from signface.study.questionnaire.questionnaire import pages_of
    from signface.study.questionnaire.store import open_store
    from tests.fixtures.study_site import write_study

    with tempfile.TemporaryDirectory() as folder:
        study = read_study(write_study(Path(folder)).folder)
    store = open_store(database)
    _, answers = store.everything()
    kept = {
        (person, stimulus): value for person, stimulus, question, value in answers if question == "answer_intensity"
    }
    expected = {}
    for (token, path), value in load.acknowledged.items():
        person = store.find(token)
        assert person is not None, "a participant is lost"
        page = pages_of(study, person.id)[int(path.rpartition("/")[2]) - 1]
        expected[person.id, page.key] = value
    store.close()
    lost = sum(kept.get(key) != value for key, value in expected.items())
    return lost, len(set(kept) - set(expected))


def main() -> None:
    """Measure and print."""
    from tests.fixtures.study_servers import served
    from tests.fixtures.study_site import small_film, write_study

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--participants", type=int, default=200)
    parser.add_argument("--look", type=float, default=4.0, help="seconds a participant looks at a film (default 4)")
    parser.add_argument("--database", help="a PostgreSQL URL (default: SQLite)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_study(folder, film=small_film())
        more = ("--database", arguments.database) if arguments.database else ()
        with served(folder, *more) as (address, _):
            began = time.perf_counter()
            load = asyncio.run(
                run_load(address, arguments.participants, arrive_s=arguments.look, look_s=arguments.look)
            )
            took = time.perf_counter() - began
        lost, extra = check_nothing_is_lost(load, arguments.database or folder / "answers.sqlite")
    waits = np.array(load.waits) * 1000
    print(f"{load.finished} of {arguments.participants} participants finished; errors: {load.errors[:3] or 'none'}")
    print(
        f"{len(waits)} forms in {took:.1f} s; {len(load.acknowledged)} answers acknowledged, {lost} lost, {extra} extra"
    )
    print(
        f"wait for the next page: median {np.median(waits):.0f} ms, 95 % {np.percentile(waits, 95):.0f} ms, "
        f"worst {waits.max():.0f} ms"
    )


if __name__ == "__main__":
    main()
