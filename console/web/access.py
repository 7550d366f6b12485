"""Access to the page: decided on a request's method, path, headers and size, before anything is done with it.

The page itself, which holds nothing, is for everyone on this machine. All else needs the cookie that is given for the
token, and, where a browser says where a request comes from, that it comes from the page.
"""

import hmac
import secrets
from collections.abc import Mapping
from http.cookies import CookieError, SimpleCookie
from typing import Final, NamedTuple

LONGEST_PATH: Final = 200
LARGEST_BODY: Final = 65_536
PAGE: Final = ("/", "/page.css", "/page.js", "/map.js", "/intents.js", "/panels.js", "/charts.js", "/icon.svg")
"""Paths that need no cookie; they are files of the program."""
SESSION, ACT, LIVE, TILES = "/session", "/act", "/live", "/tiles/"
SENT_AS: Final = "application/json"


class Refusal(NamedTuple):
    """Why a request is not answered, as an HTTP status and a sentence."""

    status: int
    why: str


class Demand(NamedTuple):
    """A request as far as it is judged; header names in lower case, the first of each."""

    method: str
    path: str
    headers: Mapping[str, str]
    repeated: frozenset[str] = frozenset()
    """Headers that came more than once."""


class Access:
    """Judges requests.

    Args:
        hosts: the names of the page's host in a browser: `127.0.0.1:8420`.
        is_read_only: whether no speech act leaves the page.
    """

    def __init__(self, hosts: tuple[str, ...], *, is_read_only: bool = False) -> None:
        self.token, self._session = secrets.token_urlsafe(24), secrets.token_urlsafe(24)
        self._hosts, self.is_read_only = frozenset(hosts), is_read_only
        self._cookie = f"dyknow-{hosts[0].rpartition(':')[2]}"

    def is_token(self, given: object) -> bool:
        """Whether this is the token; takes as long for every text."""
        return isinstance(given, str) and hmac.compare_digest(given.encode(), self.token.encode())

    @property
    def cookie(self) -> str:
        """The cookie that the browser gets for the token: not readable by scripts, not sent from other pages."""
        return f"{self._cookie}={self._session}; HttpOnly; SameSite=Strict; Path=/"

    def refusal(self, asked: Demand) -> Refusal | None:
        """Why this is refused, or None."""
        if len(asked.path) > LONGEST_PATH:
            return Refusal(414, "the path is too long")
        if asked.repeated & {"host", "origin", "content-length", "content-type"}:
            return Refusal(400, "a header came twice")
        if asked.headers.get("host") not in self._hosts:
            return Refusal(421, "this is not the name of this page; open the address that dyknow web printed")
        is_change = asked.path in {SESSION, ACT}
        if asked.method != ("POST" if is_change else "GET"):
            return Refusal(405, "not by this method")
        if not self._comes_from_here(asked, must_say=is_change or asked.path == LIVE):
            return Refusal(403, "this comes from another page")
        if is_change and (wrong := _wrong_body(asked.headers)):
            return wrong
        if asked.path in PAGE or asked.path == SESSION:
            return None
        if not (asked.path in {ACT, LIVE} or asked.path.startswith(TILES)):
            return Refusal(404, "there is no such page")
        if not self.has_session(asked.headers.get("cookie", "")):
            return Refusal(401, "open the address that dyknow web printed, with its token")
        if asked.path == ACT and self.is_read_only:
            return Refusal(403, "this page only shows: dyknow web was started with --read-only")
        return None

    def has_session(self, cookies: str) -> bool:
        """Whether the header `Cookie` has what was given for the token."""
        try:
            given = SimpleCookie(cookies).get(self._cookie)
        except CookieError:
            return False
        return given is not None and hmac.compare_digest(given.value.encode(), self._session.encode())

    def _comes_from_here(self, asked: Demand, *, must_say: bool) -> bool:
        origin, site = asked.headers.get("origin"), asked.headers.get("sec-fetch-site", "same-origin")
        if origin is None:
            return not must_say and (site in {"same-origin", "none"} or asked.path == "/")
        return origin.startswith("http://") and origin.removeprefix("http://") == asked.headers.get("host")


def _wrong_body(headers: Mapping[str, str]) -> Refusal | None:
    if headers.get("content-type", "").partition(";")[0].strip().lower() != SENT_AS:
        return Refusal(415, f"a request has the content type {SENT_AS}")
    length = headers.get("content-length", "")
    if not (length.isascii() and length.isdigit()):
        return Refusal(411, "a request says how long it is")
    return Refusal(413, "the request is too long") if len(length) > 9 or int(length) > LARGEST_BODY else None
