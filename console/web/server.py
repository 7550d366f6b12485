"""The server of the page: its files, a socket that differences of the picture leave by, and a door for speech acts."""

import asyncio
import json
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from dyknow.console.picture.differences import difference
from dyknow.console.web.access import ACT, LARGEST_BODY, LIVE, PAGE, SESSION, Access, Demand, Refusal
from dyknow.console.web.views import PageView, Viewer
from dyknow.model.errors import DyknowError

TICK_S: Final = 0.1
"""How often a page gets what has changed."""
ABOUT_S: Final = 0.2
MOST_PAGES: Final = 16
LONGEST_ACTION: Final = 1000
HEADERS: Final[Mapping[str, str]] = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
_KINDS: Final = {
    ".html": "text/html; charset=utf-8", ".css": "text/css; charset=utf-8", ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml", ".png": "image/png", ".jpg": "image/jpeg", ".webp": "image/webp",
}  # fmt: skip
Acting = Callable[[Mapping[str, Any]], Awaitable[Mapping[str, Any]]]
"""Takes what a user has confirmed, and tells what became of it; raises DyknowError."""


class PageGate:
    """Judges every request before the application sees it, and counts what is refused."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app, self._access = app, access
        self.refused: Counter[int] = Counter()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """An ASGI application around another one."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return
        refusal = self._access.refusal(_demand(scope))
        if refusal is None:
            await self._app(scope, receive, send)
            return
        self.refused[refusal.status] += 1
        if scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 4000 + refusal.status, "reason": refusal.why})
        else:
            await _refused(refusal)(scope, receive, send)


def _demand(scope: Scope) -> Demand:
    found: dict[str, str] = {}
    repeated = set()
    for name, value in scope["headers"]:
        key = name.decode("latin-1").lower()
        if key in found:
            repeated.add(key)
        found.setdefault(key, value.decode("latin-1"))
    raw = scope.get("raw_path") or scope["path"].encode()
    path = raw.decode("latin-1").partition("?")[0]
    return Demand(scope.get("method", "GET"), path, found, frozenset(repeated))


def _refused(refusal: Refusal) -> Response:
    return JSONResponse({"why": refusal.why}, refusal.status, headers=dict(HEADERS))


class PageServer:
    """The application.

    Args:
        access: judges requests.
        view: makes what one page looks through.
        act: carries out what a user has confirmed; None: a page that only shows.
        tiles: a folder of map tiles, `Z/X/Y.png`.
        about: further facts for the page.
    """

    def __init__(
        self,
        access: Access,
        view: Callable[[], Viewer],
        act: Acting | None = None,
        tiles: Path | None = None,
        about: Mapping[str, Any] | None = None,
    ) -> None:
        self._access, self._view, self._act, self._tiles = access, view, act, tiles
        self._about = {"tiles": tiles is not None, "acts": act is not None, **(about or {})}
        self._pages = 0
        self._differences: dict[tuple[int, int], tuple[Any, Any, str]] = {}
        pages = [Route(path, self._file) for path in PAGE]
        doors = [Route(SESSION, self._session, methods=["POST"]), Route(ACT, self._acted, methods=["POST"])]
        routes = [*pages, *doors, Route("/tiles/{z:int}/{x:int}/{name}", self._tile), WebSocketRoute(LIVE, self._live)]
        self.app = PageGate(Starlette(routes=routes), access)

    async def _file(self, request: Request) -> Response:
        name = request.url.path.lstrip("/") or "page.html"
        kind = _KINDS[name[name.rindex(".") :]]
        return Response(
            (files("dyknow.console.web") / "page" / name).read_bytes(), media_type=kind, headers=dict(HEADERS)
        )

    async def _session(self, request: Request) -> Response:
        given = await _body(request)
        if not self._access.is_token(given.get("token")):
            return _refused(Refusal(401, "this is not the token that dyknow web printed"))
        return Response(status_code=204, headers={**HEADERS, "Set-Cookie": self._access.cookie})

    async def _acted(self, request: Request) -> Response:
        given = await _body(request)
        if self._act is None:
            return _refused(Refusal(403, "a recording is only looked at"))
        try:
            done = await self._act(given)
        except DyknowError as error:
            return JSONResponse({"why": str(error)[:1000]}, 409, headers=dict(HEADERS))
        return JSONResponse(dict(done), headers=dict(HEADERS))

    async def _tile(self, request: Request) -> Response:
        at, name = request.path_params, request.path_params["name"]
        stem, _, ending = name.rpartition(".")
        is_named = stem.isascii() and stem.isdigit() and f".{ending}" in {".png", ".jpg", ".webp"}
        path = self._tiles / str(at["z"]) / str(at["x"]) / name if self._tiles is not None and is_named else None
        if path is None or not path.is_file():
            return _refused(Refusal(404, "there is no such tile"))
        return FileResponse(path, media_type=_KINDS[f".{ending}"], headers={**HEADERS, "Cache-Control": "max-age=3600"})

    # -- the socket --------------------------------------------------------------------------------------------

    async def _live(self, socket: WebSocket) -> None:
        if self._pages >= MOST_PAGES:
            await socket.close(4429, "too many pages are open")
            return
        await socket.accept()
        self._pages += 1
        viewer = self._view()
        steering = asyncio.create_task(_steer(socket, viewer))
        try:
            await self._send(socket, viewer, steering)
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._pages -= 1
            steering.cancel()

    async def _send(self, socket: WebSocket, viewer: Viewer, steering: "asyncio.Task[None]") -> None:
        """Send the whole once, then what has changed, as fast as the page takes it, ten times a second at most."""
        sent: PageView | None = None
        about: dict[str, Any] = {}
        loop = asyncio.get_running_loop()
        about_s = loop.time()
        while not steering.done():
            begun_s = loop.time()
            moment = viewer.look()
            parts = [f'"t":{moment.at_us}']
            if sent is None or begun_s >= about_s:
                about_s = begun_s + ABOUT_S
                if (now := {**viewer.about(), **self._about}) != about:
                    about = now
                    parts.append(f'"about":{_json(about)}')
            if sent is None or sent.run != moment.run:
                trails, curves = viewer.past()
                parts.append(f'"whole":{_json(moment.sections)},"trails":{_json(trails)},"curves":{_json(curves)}')
            elif changed := self._difference(sent, moment):
                parts.append(f'"changed":{changed}')
            await socket.send_text(f"{{{','.join(parts)}}}")
            sent = moment
            await asyncio.sleep(max(0.01, TICK_S - (loop.time() - begun_s)))

    def _difference(self, before: PageView, after: PageView) -> str:
        """As JSON, made once for all pages that have the same; empty: none."""
        if before.sections is after.sections:
            return ""
        key = id(before.sections), id(after.sections)
        known = self._differences.get(key)
        if known is None:
            found = difference(before.sections, after.sections)
            known = before.sections, after.sections, _json(found) if found else ""
            if len(self._differences) >= MOST_PAGES:
                self._differences.clear()
            self._differences[key] = known  # holds both, so that their ids stay theirs
        return known[2]


async def _steer(socket: WebSocket, viewer: Viewer) -> None:
    """Take what the page wishes, until it closes or sends something else."""
    try:
        while True:
            action = json.loads((await socket.receive_text())[:LONGEST_ACTION])
            if isinstance(action, dict):
                viewer.steer(action)
    except (WebSocketDisconnect, RuntimeError, ValueError, KeyError, RecursionError):
        return


async def _body(request: Request) -> Mapping[str, Any]:
    data = b""
    async for piece in request.stream():
        data += piece
        if len(data) > LARGEST_BODY:
            return {}
    try:
        found = json.loads(data)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _json(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False)
