"""Requests that do not come from the page, or that it would not send: all are refused, and nothing is done."""

import json
import socket
from collections.abc import Iterator
from contextlib import suppress
from itertools import product
from pathlib import Path

import pytest

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")

from dyknow.console.picture.picture import Picture
from dyknow.console.web.access import Access, Demand
from dyknow.console.web.views import LiveFeed
from tests.console.web.served import Served, serving

HOLD = {"do": "delegate", "task": "hold", "to": "0", "with": {}}


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    tiles = tmp_path_factory.mktemp("map") / "tiles"
    (tiles / "1" / "0").mkdir(parents=True)
    (tiles / "1" / "0" / "1.png").write_bytes(b"tile")
    (tiles.parent / "secret.png").write_bytes(b"secret")
    with serving(lambda: LiveFeed("test", Picture()), tiles=tiles) as served:
        yield served


def hostile(port: int, cookie: str) -> list[tuple[str, str, dict[str, str], bytes]]:
    """Method, path, headers and body of more than two hundred requests, of each kind that there is."""
    here, body = f"127.0.0.1:{port}", json.dumps(HOLD).encode()
    good = {
        "Origin": f"http://{here}", "Content-Type": "application/json", "Cookie": cookie, "Content-Length": str(len(body)),
    }  # fmt: skip
    hosts = [
        "evil.example", f"evil.example:{port}", f"127.0.0.1.evil.example:{port}", "127.0.0.1", f"127.0.0.1:{port + 1}",
        f"0.0.0.0:{port}", f"{here}@evil", f"[::ffff:127.0.0.1]:{port}", "localhost", f"127.1:{port}",
    ]  # fmt: skip
    origins = [
        "http://evil.example", "null", f"https://{here}", f"http://{here}.evil.example", "file://", f"http://{here}/",
        "http://127.0.0.1", f"http://localhost:{port}", f"http://{here} http://evil", f"HTTP://{here}",
    ]  # fmt: skip
    cookies = ["", "dyknow=1", f"{cookie}x", cookie[:-1], cookie.partition("=")[0] + "=", f"x{cookie}", "=", "a" * 3000]
    kinds = [
        "",
        "text/plain",
        "application/x-www-form-urlencoded",
        "multipart/form-data",
        "application/jsonp",
        "text/json",
    ]
    lengths = ["", "-1", "1e3", "99999999999999", "65537", "0x10", "+5"]
    paths = [
        "/acts", "/act/", "//act", "/%61ct", "/page.html", "/page/page.js", "/../access.py", "/..%2faccess.py", "/.git/config",
        "/server.py", "/docs", "/openapi.json", "/redoc", "/health", "/tiles/1/0/1.png/..", "/tiles/../../secret.png",
        "/tiles/1/0/..%2f..%2f..%2fsecret.png", "/tiles/1/0/%2e%2e/%2e%2e/secret.png", "/tiles/-1/0/1.png", "/tiles/1/0/1.py",
        "/tiles/1/0/secret.png", "/tiles/1/0/1", "/tiles/99/0/1.png", "/" + "a" * 300, "/session/x", "/live/x", "/;act",
    ]  # fmt: skip
    methods = ["GET", "PUT", "DELETE", "PATCH", "OPTIONS", "HEAD", "TRACE", "CONNECT", "PROPFIND", "post", "X"]
    asked = [("POST", path, {**good, "Host": host}, body) for host, path in product(hosts, ("/act", "/session"))]
    asked += [("GET", path, {"Host": host, "Cookie": cookie}, b"") for host, path in product(hosts, ("/", "/page.js"))]
    asked += [("POST", path, {**good, "Origin": each}, body) for each, path in product(origins, ("/act", "/session"))]
    asked += [("GET", "/live", {**upgrade(), "Cookie": cookie, "Origin": each}, b"") for each in [*origins, ""]]
    asked += [
        ("GET", "/live", {**upgrade(), "Cookie": cookie, "Origin": f"http://{here}", "Host": each}, b"")
        for each in hosts
    ]
    asked += [("GET", "/live", {**upgrade(), "Origin": f"http://{here}", "Cookie": each}, b"") for each in cookies]
    asked += [("POST", "/act", {**good, "Cookie": each}, body) for each in cookies]
    asked += [("GET", "/tiles/1/0/1.png", {"Cookie": each}, b"") for each in cookies]
    asked += [
        ("POST", path, {**good, "Content-Type": each}, body) for each, path in product(kinds, ("/act", "/session"))
    ]
    asked += [
        ("POST", path, {**good, "Content-Length": each}, b"") for each, path in product(lengths, ("/act", "/session"))
    ]
    asked += [(method, path, good, body) for method, path in product(methods, ("/act", "/session"))]
    asked += [(method, "/", {"Cookie": cookie}, b"") for method in ["POST", *methods[1:]]]
    asked += [("GET", path, {"Cookie": cookie}, b"") for path in paths]
    asked += [("POST", path, good, body) for path in paths]
    asked += [
        ("GET", path, {"Cookie": cookie, "Sec-Fetch-Site": "cross-site"}, b"")
        for path in ("/page.js", "/tiles/1/0/1.png")
    ]
    tokens = ["", "x", "0" * 32, None, 1, [], {}, True]
    for token in tokens:
        said = json.dumps({"token": token}).encode()
        asked.append(("POST", "/session", {**good, "Content-Length": str(len(said))}, said))
    for said in (b"", b"[", b"[]", b"null", b"[" * 60_000, b"\xff\xfe"):
        asked.append(("POST", "/session", {**good, "Content-Length": str(len(said))}, said))
    return asked


def upgrade() -> dict[str, str]:
    return {
        "Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    }  # fmt: skip


def test_more_than_two_hundred_hostile_requests_are_refused_and_do_nothing(page: Served) -> None:
    asked = hostile(page.port, page.cookie)
    assert len(asked) >= 200
    answers = [(page.asks(*each), each) for each in asked]
    assert not [(status, each) for status, each in answers if 0 < status < 400]
    assert not page.done
    assert page.posted("/act", HOLD)[0] == 200  # it still serves those who may
    assert page.done == [HOLD]


def test_what_is_refused_gives_nothing_away(page: Served) -> None:
    for each in hostile(page.port, page.cookie):
        _, headers, body = page.answer(*each)
        assert page.access.token.encode() not in body
        assert "set-cookie" not in headers
        assert b"secret" not in body
        assert b"Traceback" not in body


def test_the_page_says_that_nothing_is_loaded_from_elsewhere_and_holds_no_token(page: Served) -> None:
    for path in ("/", "/page.js", "/map.js", "/intents.js", "/panels.js", "/charts.js", "/page.css"):
        status, headers, body = page.answer("GET", path)
        assert status == 200
        policy = headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert "http" not in policy
        assert page.access.token.encode() not in body
        assert b"//cdn" not in body
        assert headers["cache-control"] == "no-store"


def test_the_token_opens_the_page_with_a_cookie_that_scripts_and_other_sites_do_not_have(page: Served) -> None:
    status, headers, _ = page.posted("/session", {"token": page.access.token}, Cookie="")
    assert status == 204
    assert "HttpOnly" in headers["set-cookie"]
    assert "SameSite=Strict" in headers["set-cookie"]
    assert page.access.token not in headers["set-cookie"]
    assert page.asks("GET", "/tiles/1/0/1.png", {"Cookie": headers["set-cookie"].partition(";")[0]}) == 200


def test_a_page_that_only_shows_lets_no_speech_act_out(tmp_path: Path) -> None:
    with serving(lambda: LiveFeed("test", Picture()), is_read_only=True) as served:
        assert served.posted("/act", HOLD)[0] == 403
        assert not served.done


def test_a_header_that_comes_twice_is_refused() -> None:
    access = Access(("127.0.0.1:1",))
    asked = Demand("GET", "/", {"host": "127.0.0.1:1"}, frozenset({"host"}))
    refusal = access.refusal(asked)
    assert refusal is not None
    assert refusal.status == 400


def test_bytes_that_are_no_request_end_their_connection_only(page: Served) -> None:
    for data in (
        b"\x00" * 4000,
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET /" + b"a" * 100_000 + b" HTTP/1.1\r\n\r\n",
        b"POST /act HTTP/1.1\r\n" + b"A: b\r\n" * 9000,
    ):
        with socket.create_connection(("127.0.0.1", page.port), timeout=5) as connection:
            try:
                connection.sendall(data)
                answer = connection.recv(100)
            except ConnectionError:
                answer = b""
        assert not answer or b" 4" in answer[:12]
    assert page.asks("GET", "/") == 200


def half_requests(port: int, count: int, sent: bytes) -> list[socket.socket]:
    made = [socket.create_connection(("127.0.0.1", port), 5) for _ in range(count)]
    for each in made:
        with suppress(OSError):  # closed already: an older one that made room
            each.sendall(sent)
    return made


@pytest.mark.parametrize(
    "sent",
    [
        b"",
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ",
        (
            b"POST /session HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nOrigin: http://127.0.0.1:%d\r\n"
            b"Content-Type: application/json\r\nContent-Length: 60\r\n\r\n{"
        ),
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nCookie: dyknow-%d=wrong\r\n\r\n",
    ],
    ids=["no byte", "half a head", "half a body", "idle after an answer"],
)
def test_connections_that_are_held_without_the_cookie_keep_nobody_out(page: Served, sent: bytes) -> None:
    held = half_requests(page.port, 500, sent.replace(b"%d", str(page.port).encode()))
    try:
        assert page.answer("GET", "/")[0] == 200
        status, headers, _ = page.posted("/session", {"token": page.access.token}, Cookie="")
        assert status == 204
        assert page.cookie in headers["set-cookie"]
        assert page.posted("/act", HOLD)[0] == 200
        assert page.done.pop() == HOLD
    finally:
        for each in held:
            each.close()


def test_a_connection_with_the_cookie_is_not_displaced_by_strangers(page: Served) -> None:
    with socket.create_connection(("127.0.0.1", page.port), 5) as known:
        known.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{page.port}\r\nCookie: {page.cookie}\r\n\r\n".encode())
        assert known.recv(12) == b"HTTP/1.1 200"
        for each in half_requests(page.port, 300, b"GET /"):
            each.close()
        known.settimeout(0.2)
        with suppress(TimeoutError):
            while piece := known.recv(65_536):  # the rest of the answer, and nothing after it
                assert piece
        known.settimeout(5)
        known.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{page.port}\r\nCookie: {page.cookie}\r\n\r\n".encode())
        assert known.recv(12) == b"HTTP/1.1 200"
