"""A study to test with: a small one of our own, the shipped ones with small films, and a participant who answers."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import httpx

from signface.study.design import Study, read_study
from signface.study.examples import example_folder
from signface.study.server import make_app
from signface.study.store import Store, open_store

ORGANISER = "organiser-of-the-tests"

SMALL = """
name = "small"
languages = ["en", "fr"]
seed = 5

[title]
en = "Small study"
fr = "Petite étude"
[consent]
en = "Do you agree?"
fr = "Êtes-vous d’accord ?"

[[personal]]
column = "age"
kind = "number"
low = 16
high = 120
text = { en = "How old are you?", fr = "Quel âge avez-vous ?" }

[[question]]
column = "answer_expression"
kind = "choice"
text = "Which expression?"
choices = [{ value = "A", text = "Anger" }, { value = "J", text = "Joy" }]

[[question]]
column = "answer_intensity"
kind = "likert"
text = "How intense?"
low_end = "weak"
high_end = "strong"

[[question]]
column = "answer_comment"
kind = "text"
high = 200
optional = true
text = "Anything to say?"

[[block]]
expressions = ["A", "J"]
intensities = [1, 2]
methods = ["LSTS30"]
films = ["films/{expression}{intensity}_{method}.mp4"]

[[block]]
questions = ["answer_intensity"]
title = "Pairs"
expressions = ["A", "J"]
intensities = [3]
methods = ["pair"]
films = ["films/{expression}{intensity}_{method}.mp4", "films/{expression}{intensity}_video.mp4"]
"""


@cache
def small_film() -> bytes:
    """A film of a face that opens its mouth, in bytes."""
    import tempfile

    import numpy as np

    from signface.face.reading import read_face
    from signface.render.film import Avatar, pictures_of, write_film

    face = read_face("default")
    weights = np.zeros((8, face.n_bases))
    weights[:, face.names.index("jawOpen")] = np.linspace(0, 0.7, 8)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "film.mp4"
        write_film(file, pictures_of(Avatar(face, size=(160, 160)), weights), 8)
        return file.read_bytes()


def write_study(folder: Path, text: str = SMALL, film: bytes = b"film") -> Study:
    """A study in a folder, every film of which is the same."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "study.toml").write_text(text, encoding="utf-8")
    for path in read_study(folder, films=False).films:
        (folder / path).parent.mkdir(exist_ok=True)
        (folder / path).write_bytes(film)
    return read_study(folder)


def shipped_study(name: str, folder: Path, film: bytes = b"film", *, intensities: str | None = None) -> Study:
    """A study that ships, with the given intensities only."""
    text = (example_folder(name) / "study.toml").read_text(encoding="utf-8")
    return write_study(folder, text.replace("[1, 2, 3]", intensities or "[1, 2, 3]"), film)


class Site:
    """A study that is served in this process."""

    def __init__(self, folder: Path, study: Study | None = None, store: Store | None = None) -> None:
        self.study = study or write_study(folder)
        self.store = store or open_store(folder / "answers.sqlite")
        self.app = make_app(self.study, self.store, ORGANISER)

    def browser(self) -> Browser:
        """A new browser, without cookies."""
        from starlette.testclient import TestClient

        return Browser(TestClient(self.app))

    def answers(self) -> list[tuple[int, str, str, str]]:
        """Everything that was answered."""
        return self.store.everything()[1]


class Browser:
    """Someone's browser: it remembers the page it is on and the token in its form."""

    def __init__(self, client: httpx.Client) -> None:
        self.client = client
        self.page: httpx.Response | None = None

    def get(self, path: str, **more) -> httpx.Response:
        self.page = self.client.get(path, follow_redirects=True, **more)
        return self.page

    @property
    def token(self) -> str:
        assert self.page is not None
        found = re.search(r'name="form_token" value="(\w+)"', self.page.text)
        assert found, self.page.text
        return found[1]

    @property
    def path(self) -> str:
        assert self.page is not None
        return self.page.url.path

    def send(self, fields: dict[str, str], path: str | None = None, **more) -> httpx.Response:
        """Post the page's form; the answer becomes the page unless it is a refusal."""
        data = {"form_token": self.token, **fields}
        answer = self.client.post(path or self.path, data=data, follow_redirects=True, **more)
        if answer.status_code < 400:
            self.page = answer
        return answer

    def agree(self) -> None:
        self.get("/")
        answer = self.send({"consent": "yes"}, "/begin")
        assert answer.status_code == 200, answer.text

    def fill(self, value: str = "3") -> dict[str, str]:
        """An answer to every question on the page."""
        assert self.page is not None
        fields = {}
        for name, first in re.findall(r'<input type="radio" name="(\w+)" value="([\w.-]+)"', self.page.text):
            fields.setdefault(name, value if first == "1" else first)
        if 'name="age"' in self.page.text:
            fields["age"] = "33"
        return fields

    def go_on(self) -> httpx.Response:
        """Answer the page with whatever it accepts."""
        answer = self.send(self.fill())
        assert answer.status_code == 200, answer.text
        return answer

    def to_the_first_film(self) -> None:
        self.agree()
        while "<video" not in self.page.text:
            self.go_on()

    def to_the_end(self) -> int:
        """Answer everything that waits; the number of forms."""
        count = 0
        while self.path != "/thanks":
            self.go_on()
            count += 1
        return count
