"""A page that is served in this process, and a browser that looks at it."""

import http.client
import json
import shutil
import socket
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from dyknow.console.web.access import Access
from dyknow.console.web.views import Viewer

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
)  # fmt: skip
needs_chromium = pytest.mark.skipif(
    CHROMIUM is None or DRIVER is None,
    reason="chromium and chromedriver are not installed: apt-get install chromium-driver",
)


class Served(NamedTuple):
    """A server that runs: its port, who may have what, and what was done by clicks."""

    port: int
    access: Access
    done: list[Mapping[str, Any]]
    gate: Any

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/#{self.access.token}"

    @property
    def cookie(self) -> str:
        return self.access.cookie.partition(";")[0]

    def asks(self, method: str, path: str, headers: Mapping[str, str] = {}, body: bytes = b"") -> int:
        """The status of one request with exactly these headers."""
        return self.answer(method, path, headers, body)[0]

    def answer(
        self, method: str, path: str, headers: Mapping[str, str] = {}, body: bytes = b""
    ) -> tuple[int, dict[str, str], bytes]:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=5)
        try:
            connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
            for name, value in {"Host": f"127.0.0.1:{self.port}", **headers}.items():
                if value:
                    connection.putheader(name, value)
            connection.endheaders(body or None)
            got = connection.getresponse()
            return got.status, {name.lower(): value for name, value in got.getheaders()}, got.read()
        except (http.client.HTTPException, ConnectionError, TimeoutError):
            return 0, {}, b""
        finally:
            connection.close()

    def posted(self, path: str, said: Any, **headers: str) -> tuple[int, dict[str, str], bytes]:
        """As the page does it."""
        body = json.dumps(said).encode()
        given = {
            "Origin": f"http://127.0.0.1:{self.port}", "Content-Type": "application/json", "Cookie": self.cookie,
            "Content-Length": str(len(body)),
        } | {name.replace("_", "-"): value for name, value in headers.items()}  # fmt: skip
        return self.answer("POST", path, given, body)


@contextmanager
def serving(view: Callable[[], Viewer], *, is_read_only: bool = False, tiles: Path | None = None) -> Iterator[Served]:
    """A server of a view, on a free port."""
    import uvicorn

    from dyknow.console.web.connections import uvicorn_settings
    from dyknow.console.web.server import PageServer

    done: list[Mapping[str, Any]] = []

    async def act(given: Mapping[str, Any]) -> Mapping[str, Any]:
        done.append(given)
        return {"said": "platform 0 agrees"}

    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        access = Access((f"127.0.0.1:{port}", f"localhost:{port}"), is_read_only=is_read_only)
        gate = PageServer(access, view, act, tiles, {"tasks": ["hold", "goto", "monitor-proximity"]}).app
        server = uvicorn.Server(uvicorn.Config(gate, **uvicorn_settings(access)))
        server.install_signal_handlers = lambda: None  # type: ignore[attr-defined]
        thread = threading.Thread(target=server.run, args=([listener],), daemon=True)
        thread.start()
        try:
            yield Served(port, access, done, gate)
        finally:
            server.should_exit = True
            thread.join(5)


@contextmanager
def browsing(folder: Path, width: int = 1280, height: int = 800) -> Iterator[Any]:
    """Chromium without a window, with a profile of its own."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = str(CHROMIUM)
    for flag in (*FLAGS, f"--user-data-dir={folder}", f"--window-size={width},{height}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(str(DRIVER)))
    try:
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        yield driver
    finally:
        driver.quit()
