"""What keeps hostile input out of a questionnaire: form tokens, the origin of a post, the size of a body, headers.

- `read_form`: a form of bounded size, from the site's own pages.
- `FormKey`: tokens that tie a form to the visitor who was given it.
- `HEADERS`: what every page tells the browser; no page loads anything from elsewhere.

Everything that is refused raises `Refusal`, is logged in one line without an address, and changes nothing.
"""

from __future__ import annotations

import hashlib
import hmac
from collections.abc import Mapping
from typing import TYPE_CHECKING
from urllib.parse import parse_qsl, urlsplit

if TYPE_CHECKING:
    from starlette.requests import Request

#: Bytes of the largest form that is read; a page's answers fit many times.
LARGEST_FORM = 16 * 1024
#: Fields of the largest form.
MOST_FIELDS = 64

HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; style-src 'self'; script-src 'self'; media-src 'self'; img-src data:; "
        "form-action 'self'; frame-ancestors 'none'; base-uri 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",  # the private link must not travel
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}


class Refusal(Exception):
    """A request that is refused: the HTTP status, and a word for the log and the page."""

    def __init__(self, status: int, reason: str) -> None:
        self.status, self.reason = status, reason
        super().__init__(reason)


class FormKey:
    """Tokens of forms, made from the study's secret and what the visitor carries.

    Parameters
    ----------
    secret : str
    """

    def __init__(self, secret: str) -> None:
        self._secret = secret.encode()

    def token(self, carried: str, purpose: str = "form") -> str:
        """The token of a form for the visitor who carries `carried` (the cookie)."""
        return hmac.new(self._secret, f"{purpose}\0{carried}".encode(), hashlib.sha256).hexdigest()

    def check(self, carried: str, token: str) -> None:
        """Refuse a form whose token was not given to this visitor.

        Raises
        ------
        Refusal
            403 `forged form`.
        """
        if not hmac.compare_digest(self.token(carried).encode(), token.encode("utf-8", "replace")):
            raise Refusal(403, "forged form")

    def public_name(self, film: str) -> str:
        """The name under which a film is served: it must not tell which expression or method is shown."""
        return self.token(film, "film")[:24]


def same_site(headers: Mapping[str, str]) -> bool:
    """Whether a post comes from the site's own pages, as far as the browser tells."""
    fetched = headers.get("sec-fetch-site")
    if fetched is not None and fetched not in ("same-origin", "none"):
        return False
    origin = headers.get("origin")
    if origin is None or (origin == "null" and fetched == "same-origin"):  # sent so under Referrer-Policy: no-referrer
        return True
    return urlsplit(origin).netloc == headers.get("host")


async def read_form(request: Request) -> dict[str, str]:
    """The fields of a posted form.

    Raises
    ------
    Refusal
        403 `cross-site post`; 413 `oversized body`; 415 `not a form`; 400 `unreadable form` (too many fields, one
        given twice, or no UTF-8).
    """
    if not same_site(request.headers):
        raise Refusal(403, "cross-site post")
    if request.headers.get("content-type", "").partition(";")[0].strip() != "application/x-www-form-urlencoded":
        raise Refusal(415, "not a form")
    body = b""
    declared = request.headers.get("content-length", "0")
    if not declared.isdigit() or int(declared) > LARGEST_FORM:
        raise Refusal(413, "oversized body")
    async for part in request.stream():
        body += part
        if len(body) > LARGEST_FORM:
            raise Refusal(413, "oversized body")
    try:
        pairs = parse_qsl(body.decode("ascii"), keep_blank_values=True, errors="strict", max_num_fields=MOST_FIELDS)
    except ValueError as error:
        raise Refusal(400, "unreadable form") from error
    fields = dict(pairs)
    if len(fields) != len(pairs):
        raise Refusal(400, "unreadable form")
    return fields
