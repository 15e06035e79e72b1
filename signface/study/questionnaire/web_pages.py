"""What the questionnaire answers to each request: one method for each address.

Pages follow one another as in the thesis (section 6.3.2): consent, personal questions, one page a film, the end of
each block, thanks. A form is posted, kept in one transaction, and answered by a redirection to the next page.
`signface.study.questionnaire.server` puts them on the web.
"""

from __future__ import annotations

import hmac
import logging
import secrets
from pathlib import Path
from typing import TYPE_CHECKING, Any

from signface.extras import needed
from signface.study.design import Study
from signface.study.questionnaire.length import with_counts
from signface.study.questionnaire.questionnaire import Page, check_answer, pages_of
from signface.study.questionnaire.security import FormKey, Refusal
from signface.study.questionnaire.store import Participant, Refused, Store
from signface.study.questionnaire.wording import wording

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

log = logging.getLogger("signface.study")
PAGES = Path(__file__).parent / "pages"
#: Days that a browser keeps the private link.
KEPT_DAYS = 60


class Questionnaire:
    """The pages of one study.

    Parameters
    ----------
    study : Study
    store : Store
    organiser_token : str
        Who has it sees how the study goes.
    """

    def __init__(self, study: Study, store: Store, organiser_token: str) -> None:
        jinja2 = needed("jinja2", "study")
        self.study, self.store, self._organiser_token = study, store, organiser_token
        self.key = FormKey(store.setting("secret", secrets.token_hex(32)))
        self.words = {language: wording(language, study.words) for language in study.languages}
        self.films = {self.key.public_name(film): study.folder / film for film in study.films}
        self.refusals = 0
        self._templates = jinja2.Environment(
            loader=jinja2.FileSystemLoader(PAGES),
            autoescape=True,
            undefined=jinja2.StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
            auto_reload=False,
        )
        self._templates.filters["paragraphs"] = lambda text: [
            part for part in with_counts(text, study).split("\n\n") if part.strip()
        ]

    # ---- what every request needs

    def render(self, template: str, language: str, status: int = 200, **context: Any) -> Response:
        from starlette.responses import HTMLResponse

        text = self._templates.get_template(template).render(
            study=self.study,
            language=language,
            languages=[(code, self.words[code]["language"]) for code in self.study.languages],
            words=self.words[language],
            film_url=lambda film: f"/film/{self.key.public_name(film)}",
            **context,
        )
        return HTMLResponse(text, status_code=status, headers={"Cache-Control": "no-store"})

    def language_of(self, request: Request) -> str:
        """The language that was asked for, or the first of the browser's that the study has."""
        wanted = [request.query_params.get("language", ""), request.cookies.get("language", "")]
        accepted = request.headers.get("accept-language", "")[:200]
        wanted += [part.partition(";")[0].strip()[:2].lower() for part in accepted.split(",")]
        return next((code for code in wanted if code in self.study.languages), self.study.languages[0])

    def participant(self, request: Request) -> tuple[Participant, str]:
        """Who asks, by the private token in the cookie.

        Raises
        ------
        Refusal
            403 `no session` or `forged session`.
        """
        token = request.cookies.get("participant", "")
        if not token:
            raise Refusal(403, "no session")
        found = self.store.find(token) if len(token) < 100 else None
        if found is None:
            raise Refusal(403, "forged session")
        return found, token

    def turn(self, participant: Participant) -> int:
        """Index of the first page that waits for this participant; one past the last when there is none."""
        pages = pages_of(self.study, participant.id)
        if participant.finished:
            return len(pages)
        answered = self.store.answered(participant)
        for index, page in enumerate(pages):
            if page.block >= 0 and page.block < participant.closed:
                continue
            if page.kind == "close" or page.key not in answered:
                return index
        return len(pages)

    # ---- pages

    def consent(self, request: Request) -> Response:
        """What the study is, and the participant's consent."""
        language = self.language_of(request)
        known = bool(request.cookies.get("participant")) and self.store.find(request.cookies["participant"]) is not None
        visit = request.cookies.get("visit") or secrets.token_urlsafe(16)
        page = self.render(
            "consent.html", language, form_token=self.key.token(visit), known=known, mistakes={}, here="/"
        )
        self._keep(page, request, "visit", visit, days=1)
        if request.query_params.get("language") == language:
            self._keep(page, request, "language", language, days=KEPT_DAYS)
        return page

    def begin(self, request: Request, fields: dict[str, str]) -> Response:
        """The consent was given: a new participant."""
        visit = request.cookies.get("visit", "")
        if not visit:
            raise Refusal(403, "forged form")
        self.key.check(visit, fields.get("form_token", ""))
        language = self.language_of(request)
        if fields.get("consent") != "yes":
            return self.render(
                "consent.html",
                language,
                422,
                form_token=self.key.token(visit),
                known=False,
                mistakes={"consent": "missing"},
                here="/",
            )
        carried = request.cookies.get("participant", "")
        if carried and fields.get("anew") != "yes":  # a double click, or the way back: the same person
            again = self.store.find(carried)
            if again is not None:
                return self._to("/next")
        _, token = self.store.enrol(language)
        response = self._to("/next")
        self._keep(response, request, "participant", token, days=KEPT_DAYS)
        return response

    def resume(self, request: Request) -> Response:
        """The private link."""
        token = request.path_params["token"]
        if len(token) > 100 or self.store.find(token) is None:
            raise Refusal(403, "forged session")
        response = self._to("/next")
        self._keep(response, request, "participant", token, days=KEPT_DAYS)
        return response

    def speak(self, request: Request) -> Response:
        """Change the language and come back."""
        participant, _ = self.participant(request)
        language = request.path_params["language"]
        if language not in self.study.languages:
            raise Refusal(404, "no such page")
        self.store.speak(participant, language)
        response = self._to("/next")
        self._keep(response, request, "language", language, days=KEPT_DAYS)
        return response

    def next(self, request: Request) -> Response:
        """The page that waits."""
        participant, _ = self.participant(request)
        turn = self.turn(participant)
        return self._to("/thanks" if turn >= len(pages_of(self.study, participant.id)) else f"/page/{turn + 1}")

    def page(self, request: Request) -> Response:
        """One page, as far as the participant has come."""
        participant, token = self.participant(request)
        index = request.path_params["number"] - 1
        page = self._page(participant, index)
        if page.stimulus is not None and not self.store.was_shown(participant, page.key):
            self.store.show(participant, page.key)
        values = self.store.answers_to(participant, page.key) if page.kind != "close" else {}
        return self._show(participant, token, index, page, values, {})

    def answer(self, request: Request, fields: dict[str, str]) -> Response:
        """What a page's form held."""
        participant, token = self.participant(request)
        self.key.check(token, fields.pop("form_token", ""))
        pages = pages_of(self.study, participant.id)
        index = request.path_params["number"] - 1
        if not 0 <= index < len(pages):
            raise Refusal(404, "no such page")
        page = pages[index]
        if page.kind == "close":
            block = self.study.blocks[page.block]
            try:
                self.store.close_block(
                    participant,
                    page.block,
                    [stimulus.name for stimulus in block.stimuli],
                    last=page.block + 1 == len(self.study.blocks),
                )
            except Refused as refused:
                if refused.reason == "final" and participant.closed > page.block:  # a double click
                    return self._to("/next")
                raise
            return self._to("/next")
        questions = page.questions(self.study)
        foreign = set(fields) - {question.column for question in questions}
        if foreign:
            raise Refusal(400, "foreign question")
        checked = {question.column: check_answer(question, fields.get(question.column)) for question in questions}
        mistakes = {column: mistake for column, (_, mistake) in checked.items() if mistake is not None}
        closed_choice = {question.column for question in questions if question.kind in ("choice", "likert")}
        if any(mistake != "missing" and column in closed_choice for column, mistake in mistakes.items()):
            raise Refusal(400, "answer out of range")  # no browser sends that
        if mistakes:
            self._page(participant, index)
            return self._show(participant, token, index, page, fields, mistakes, 422)
        self.store.answer(participant, page.block, page.key, {c: value or "" for c, (value, _) in checked.items()})
        return self._to(f"/page/{index + 2}")

    def thanks(self, request: Request) -> Response:
        """The end."""
        participant, token = self.participant(request)
        if not participant.finished:
            return self._to("/next")
        return self.render(
            "thanks.html", participant.language, participant=participant, link=self._link(request, token)
        )

    def film(self, request: Request) -> Response:
        """A film, under a name that tells nothing; whole or the range that was asked for."""
        from starlette.responses import FileResponse

        file = self.films.get(request.path_params["name"])
        if file is None:
            raise Refusal(404, "no such film")
        kind = "video/webm" if file.suffix.lower() == ".webm" else "video/mp4"
        return FileResponse(file, media_type=kind, headers={"Cache-Control": "private, max-age=86400"})

    def static(self, request: Request) -> Response:
        """The style sheet and the script."""
        from starlette.responses import FileResponse

        kinds = {"style.css": "text/css", "questionnaire.js": "text/javascript"}
        name = request.path_params["name"]
        if name not in kinds:
            raise Refusal(404, "no such page")
        return FileResponse(PAGES / name, media_type=kinds[name], headers={"Cache-Control": "max-age=3600"})

    def organiser(self, request: Request) -> Response:
        """How the study goes, for who has the token."""
        given = request.path_params["token"].encode("utf-8", "replace")
        if not hmac.compare_digest(given, self._organiser_token.encode()):
            raise Refusal(403, "organiser's token")
        films = sum(len(block.stimuli) for block in self.study.blocks)
        return self.render(
            "organiser.html",
            self.language_of(request),
            progress=self.store.progress(),
            films=films,
            refusals=self.refusals,
        )

    # ---- small parts

    def _page(self, participant: Participant, index: int) -> Page:
        """Page `index`, where the participant may be."""
        pages = pages_of(self.study, participant.id)
        if not 0 <= index < len(pages):
            raise Refusal(404, "no such page")
        page = pages[index]
        if participant.finished or 0 <= page.block < participant.closed or (page.block < 0 and participant.closed):
            raise Refusal(409, "final")
        if index > self.turn(participant):
            raise Refusal(403, "not shown")
        return page

    def _show(
        self,
        participant: Participant,
        token: str,
        index: int,
        page: Page,
        values: dict[str, str],
        mistakes: dict[str, str],
        status: int = 200,
    ) -> Response:
        pages = pages_of(self.study, participant.id)
        first_open = next(i for i, p in enumerate(pages) if p.block >= participant.closed or not participant.closed)
        return self.render(
            f"{page.kind}.html",
            participant.language,
            status,
            page=page,
            index=index,
            pages=len(pages),
            films=sum(len(block.stimuli) for block in self.study.blocks),
            block=self.study.blocks[page.block] if page.block >= 0 else None,
            first_of_block=page.kind == "film" and (index == 0 or pages[index - 1].block != page.block),
            questions=page.questions(self.study),
            values=values,
            mistakes=mistakes,
            back=f"/page/{index}" if index > first_open else None,
            form_token=self.key.token(token),
            link_path=f"/resume/{token}",
            participant=participant,
            last=page.block + 1 == len(self.study.blocks),
        )

    @staticmethod
    def _to(path: str) -> Response:
        from starlette.responses import RedirectResponse

        return RedirectResponse(path, status_code=303, headers={"Cache-Control": "no-store"})

    @staticmethod
    def _link(request: Request, token: str) -> str:
        return f"{request.url.scheme}://{request.url.netloc}/resume/{token}"

    @staticmethod
    def _keep(response: Response, request: Request, key: str, value: str, *, days: int) -> None:
        secure = request.url.scheme == "https"
        response.set_cookie(key, value, max_age=days * 86400, httponly=True, samesite="lax", secure=secure)

    def refuse(self, request: Request, status: int, reason: str) -> Response:
        """Log a refusal in one line, without an address or a token, and say so on a page."""
        self.refusals += 1
        place = request.scope["path"][:80].encode("unicode_escape").decode("ascii")
        if place.startswith(("/resume/", "/organiser/")):
            place = place[: place.index("/", 1)]
        log.warning("refused %s %s: %s (%d)", request.method, place, reason, status)
        language = self.language_of(request)
        reasons = self.words[language]
        return self.render(
            "refused.html", language, status, explanation=reasons.get(f"refused {reason}", reasons["refused"])
        )
