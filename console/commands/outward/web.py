"""`dyknow web`: the operator's page, of the federation as it is or of a recording."""

import asyncio
import os
import socket
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from importlib.util import find_spec
from ipaddress import ip_address
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dyknow.console.command import Call, command
from dyknow.console.errors import DONE
from dyknow.console.output.shown import line, styled
from dyknow.console.web.access import Access
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.model.errors import WrongCall

if TYPE_CHECKING:
    from dyknow.console.web.feeds import RecordedFeed
    from dyknow.console.web.joining import PageMember
    from dyknow.runtime.client import Client

PORT = 8420


@command(example="dyknow web")
def web(
    call: Call,
    recording: Annotated[
        Path | None, typer.Argument(metavar="[FILE.mcap]", help="A recording, looked at at any time of it.")
    ] = None,
    *,
    port: Annotated[int, typer.Option(metavar="PORT", min=0, max=65_535, help="Where; 0: any free port.")] = PORT,
    bind: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Where it is reached; 127.0.0.1: this machine only.")
    ] = "127.0.0.1",
    read_only: Annotated[
        bool, typer.Option("--read-only", help="The page only shows; no speech act leaves it.")
    ] = False,
    label: Annotated[
        list[str] | None, typer.Option(metavar="LABEL", help="Take streams of this label, too (repeatable).")
    ] = None,
    every: Annotated[
        str | None, typer.Option(metavar="TIME", help="Sample period of all streams. [default: as offered]")
    ] = None,
    origin: Annotated[
        str | None, typer.Option(metavar="LAT,LON", help="Where the metres of objects are counted from.")
    ] = None,
    tiles: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Map tiles, Z/X/Y.png.")] = None,
) -> int:
    """The operator's page in a browser: map, alarms, monitors, tasks, speech acts, streams; of now or a recording."""
    if tiles is not None and not tiles.is_dir():
        raise WrongCall(f"--tiles: {tiles} is no folder; name one that has tiles as Z/X/Y.png.")
    if not all(map(find_spec, ("starlette", "uvicorn", "websockets"))):
        raise WrongCall("the page needs what is not installed; install the extra: pip install 'dyknow-federation[web]'")
    every_us = duration_us(every, option="--every", least_us=SHORTEST_US) if every else None
    place = _place(origin)
    _check_reach(bind)
    with _listening(bind, port) as listener:
        hosts = _hosts(bind, listener.getsockname()[1])
        access = Access(hosts, is_read_only=read_only)
        if recording is not None:
            return _show_recording(call, access, listener, recording, place, tiles)
        return _show_federation(call, access, listener, place, tiles, tuple(label or ()), every_us)


def _place(origin: str | None) -> tuple[float, float] | None:
    if origin is None:
        return None
    with suppress(ValueError):
        latitude, longitude = map(float, origin.split(","))
        if abs(latitude) < 90 and abs(longitude) <= 180:
            return latitude, longitude
    raise WrongCall(f"--origin: {origin!r} is no place; write latitude and longitude in degrees, 58.4,15.6.")


def _check_reach(bind: str) -> None:
    try:
        is_here = ip_address(bind).is_loopback
    except ValueError:
        raise WrongCall(f"--bind: {bind!r} is no address of this machine; write 127.0.0.1.") from None
    if not is_here and os.environ.get("DYKNOW_OPEN") != "1":
        raise WrongCall(
            f"--bind {bind}: the page is not encrypted, so that every host on the way could read its token and command "
            "aircraft. Reach this machine by ssh -L, or set DYKNOW_OPEN=1 to allow it all the same."
        )


def _listening(bind: str, port: int) -> socket.socket:
    try:
        return socket.create_server((bind, port), family=socket.AF_INET6 if ":" in bind else socket.AF_INET)
    except OSError as error:
        raise WrongCall(f"--port {port}: {error.strerror or error}; choose another one, or 0 for any.") from None


def _hosts(bind: str, port: int) -> tuple[str, ...]:
    shown = f"[{bind}]" if ":" in bind else bind
    here = ("127.0.0.1", "localhost", "[::1]") if ip_address(bind).is_loopback else ()
    return tuple(dict.fromkeys(f"{host}:{port}" for host in (shown, *here)))


def _show_recording(
    call: Call,
    access: Access,
    listener: socket.socket,
    file: Path,
    place: tuple[float, float] | None,
    tiles: Path | None,
) -> int:
    from dyknow.console.web.feeds import RecordedFeed, RecordingViewer
    from dyknow.console.web.server import PageServer
    from dyknow.runtime.recordings.recorded import FederationRecording

    feed = RecordedFeed(FederationRecording(file), place)
    _told(call, access, listener, f"recording {file}")
    threading.Thread(target=_load, args=(call, feed), name="recording", daemon=True).start()
    server = PageServer(access, lambda: RecordingViewer(feed, time.monotonic), None, tiles)
    _serve(server.app, access, listener)
    return DONE


def _load(call: Call, feed: "RecordedFeed") -> None:
    """Read the recording, and note what of it cannot be read; the page shows the rest."""
    problem = feed.load()
    if problem:
        call.out.note(f"{problem}.", style="yellow")


def _show_federation(
    call: Call,
    access: Access,
    listener: socket.socket,
    place: tuple[float, float] | None,
    tiles: Path | None,
    labels: tuple[str, ...],
    every_us: int | None,
) -> int:
    _told(call, access, listener, f"federation {call.settings.federation}")
    from dyknow.console.web.joining import PageMember
    from dyknow.console.web.server import PageServer
    from dyknow.console.web.views import LiveFeed

    feed = LiveFeed(call.settings.federation)
    member = PageMember(lambda: _joined(call), feed, labels, every_us, place, lambda: _tasks(call))

    async def act(given: Mapping[str, Any]) -> Mapping[str, Any]:
        return await asyncio.wrap_future(member.act(given))

    server = PageServer(access, lambda: feed, None if access.is_read_only else act, tiles)
    try:
        _serve(server.app, access, listener, member)
    finally:
        member.close()
    if member.failure is not None:
        raise member.failure
    return DONE


def _joined(call: Call) -> "Client":
    from dyknow.console.centre.client import client_of

    return client_of(call)


def _tasks(call: Call) -> list[str]:
    from dyknow.runtime.configuration.wording import typed

    return sorted(typed(call.settings.extensions))


def _told(call: Call, access: Access, listener: socket.socket, what: str) -> None:
    """The address, printed: whoever opens it is served as soon as the server is there, which takes a moment."""
    host, port = listener.getsockname()[:2]
    shown = f"[{host}]" if ":" in host else host
    url = f"http://{shown}:{port}/#{access.token}"
    call.out.say(
        line(styled("page", "green"), f" of {what}: {url}\nThe address gives access to it. Ctrl-C ends the page."),
        event="serving", url=url, read_only=access.is_read_only,
    )  # fmt: skip


def _serve(app: Any, access: Access, listener: socket.socket, member: "PageMember | None" = None) -> None:
    """Until Ctrl-C; the member joins its federation once the page is served."""
    import uvicorn

    from dyknow.console.web.connections import uvicorn_settings

    class Server(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            if member is not None:
                member.start()

        def end(self) -> None:
            self.should_exit = True

    server = Server(uvicorn.Config(app, **uvicorn_settings(access)))
    if member is not None:
        member.on_failure = server.end
    with suppress(KeyboardInterrupt):
        server.run(sockets=[listener])
