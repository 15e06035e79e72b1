"""The questionnaire on the web: pages made on the server, answers kept at once.

- `make_app`: the application of a study and a store (Starlette).
- `serve`: run it.

What stands on the pages is `signface.study.questionnaire.web_pages`.
"""

from __future__ import annotations

import logging
import secrets
from collections.abc import Callable
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import TYPE_CHECKING, Any

from signface.errors import SignfaceError
from signface.extras import needed
from signface.study.design import Study
from signface.study.questionnaire.security import HEADERS, Refusal, read_form
from signface.study.questionnaire.store import Refused, Store
from signface.study.questionnaire.web_pages import Questionnaire, log

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import Response

_STATUS = {"final": 409, "not shown": 403, "incomplete": 409, "unknown": 403}


def make_app(study: Study, store: Store, organiser_token: str) -> Starlette:
    """The questionnaire of a study as an ASGI application.

    Parameters
    ----------
    study : Study
    store : Store
    organiser_token : str

    Raises
    ------
    SignfaceError
        The extra `study` is not installed, or a language has no words for the pages.
    """
    needed("starlette", "study")
    from starlette.applications import Starlette
    from starlette.concurrency import run_in_threadpool
    from starlette.exceptions import HTTPException
    from starlette.routing import Route

    pages = Questionnaire(study, store, organiser_token)

    def getting(handler: Callable) -> Callable:
        async def endpoint(request: Request) -> Response:
            return await run_in_threadpool(handler, request)

        return endpoint

    def posting(handler: Callable) -> Callable:
        async def endpoint(request: Request) -> Response:
            fields = await read_form(request)
            return await run_in_threadpool(handler, request, fields)

        return endpoint

    async def refuse(request: Request, error: Exception) -> Response:
        if isinstance(error, Refusal):
            return pages.refuse(request, error.status, error.reason)
        if isinstance(error, Refused):
            return pages.refuse(request, _STATUS[error.reason], error.reason)
        assert isinstance(error, HTTPException)
        return pages.refuse(request, error.status_code, "no such page")

    app = Starlette(
        routes=[
            Route("/", getting(pages.consent)),
            Route("/begin", posting(pages.begin), methods=["POST"]),
            Route("/resume/{token}", getting(pages.resume)),
            Route("/language/{language}", getting(pages.speak)),
            Route("/next", getting(pages.next)),
            Route("/page/{number:int}", getting(pages.page), methods=["GET"]),
            Route("/page/{number:int}", posting(pages.answer), methods=["POST"]),
            Route("/thanks", getting(pages.thanks)),
            Route("/film/{name}", getting(pages.film)),
            Route("/static/{name}", getting(pages.static)),
            Route("/organiser/{token}", getting(pages.organiser)),
        ],
        exception_handlers={Refusal: refuse, Refused: refuse, HTTPException: refuse},
    )
    app.add_middleware(_Headers)
    return app


class _Headers:
    """Adds `HEADERS` to every answer."""

    def __init__(self, app: Any) -> None:
        self._app = app
        self._headers = [(key.lower().encode(), value.encode()) for key, value in HEADERS.items()]

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        async def send_with_headers(message: Any) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *self._headers]
            await send(message)

        await self._app(scope, receive, send_with_headers if scope["type"] == "http" else send)


def organiser_token(folder: Path) -> str:
    """The token of the organiser's page, kept in `organiser-token` beside the study, for its owner alone.

    Raises
    ------
    SignfaceError
        The file cannot be written.
    """
    file = folder / "organiser-token"
    try:
        if not file.is_file():
            file.touch(mode=0o600)
            file.write_text(secrets.token_urlsafe(24) + "\n", encoding="ascii")
        token = file.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise SignfaceError("the organiser's token cannot be kept here", file=file, hint="check the folder") from error
    if len(token) < 16:
        raise SignfaceError("is too short for a token", file=file, hint="delete it, and another is made")
    return token


def serve(study: Study, store: Store, *, host: str = "127.0.0.1", port: int = 8000, behind_proxy: bool = False) -> None:
    """Serve a study until it is interrupted. Refusals are logged in `refusals.log` of the study's folder.

    Parameters
    ----------
    study, store
    host, port
        Where to listen.
    behind_proxy : bool
        Whether a server on this machine forwards to us over HTTPS; its word on the scheme is then believed.

    Raises
    ------
    SignfaceError
        The port is taken.
    """
    import socket

    uvicorn = needed("uvicorn", "study")
    handler = RotatingFileHandler(study.folder / "refusals.log", maxBytes=1_000_000, backupCount=3, encoding="utf-8")
    handler.setFormatter(logging.Formatter("%(asctime)s %(message)s"))
    log.addHandler(handler)
    app = make_app(study, store, organiser_token(study.folder))
    try:
        listening = socket.create_server((host, port), backlog=1024)
    except OSError as error:
        raise SignfaceError(f"{host}:{port} cannot be listened on ({error.strerror})", hint="try --port") from error
    config = uvicorn.Config(
        app,
        log_level="warning",
        access_log=False,  # it would hold addresses and private links
        server_header=False,
        timeout_keep_alive=75,  # longer than a film is looked at, so that an answer needs no new connection
        proxy_headers=behind_proxy,
        forwarded_allow_ips="127.0.0.1",
    )
    uvicorn.Server(config).run(sockets=[listening])
