"""`dyknow top`: platforms, streams, monitors, alarms and acts in the terminal, again every second."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.errors import DONE, INTERRUPTED
from dyknow.console.top.gathered import Gatherer, TopSnapshot
from dyknow.model.errors import DyknowError, WrongCall
from dyknow.runtime.client import Client

LOOK_S = 1.0


@command(example="dyknow top")
def top(call: Call) -> int:
    """Platforms, streams, monitors, alarms and acts in the terminal, kept up to date; keys sort, filter and open."""
    if call.out.json_lines:
        raise WrongCall("top is a screen: ls, imports, monitors, alarms and acts print what it shows with --json.")
    try:
        from dyknow.console.top.screen import TopApp
    except ImportError:
        raise WrongCall(
            "the screen is drawn with textual, which is not installed; install the extra: "
            "pip install 'dyknow-federation[top]'"
        ) from None
    if not sys.stdout.isatty():
        raise WrongCall(
            "top is a screen, and the output is no terminal: start it in one; ls, imports and alarms print lines."
        )
    with connected(call) as client, _looking(client, call.settings.federation) as looks:
        app = TopApp(lambda: looks[-1])
        app.run()
        if app.return_code:
            return INTERRUPTED
    return DONE


@contextmanager
def _looking(client: Client, federation: str) -> Iterator[list[TopSnapshot]]:
    """A thread that looks every second while the screen is drawn; the newest is the last."""
    looks, over = [TopSnapshot(f"federation {federation}: looking for platforms")], threading.Event()
    gatherer = Gatherer(client, federation)

    def look() -> None:
        while not over.is_set():
            try:
                looks.append(gatherer.look())
            except DyknowError as error:
                looks.append(TopSnapshot(f"federation {federation}: {error}"))
            del looks[:-1]
            client.wait_for(over.is_set, LOOK_S)

    thread = threading.Thread(target=look, name="top", daemon=True)
    thread.start()
    try:
        yield looks
    finally:
        over.set()
        thread.join(3 * LOOK_S)
        gatherer.close()
