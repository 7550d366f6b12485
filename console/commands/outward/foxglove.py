"""`dyknow foxglove`: a running federation in Foxglove, live."""

from collections.abc import Iterable
from typing import Annotated

import typer

from dyknow.console.arguments import Duration
from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.commands.outward.passing import THERE, Beyond, check_reach, pass_on
from dyknow.console.errors import DONE, INTERRUPTED
from dyknow.console.output.output import counted
from dyknow.console.output.shown import line, styled
from dyknow.console.processes.supervision import interruptible
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.runtime.client import Client
from dyknow.runtime.library.questions import check_streamed
from dyknow.runtime.recorder.live import LiveServer


@command(example="dyknow foxglove --port 8765")
def foxglove(
    call: Call,
    *,
    port: Annotated[
        int, typer.Option(metavar="PORT", min=0, max=65_535, help="Where it listens; 0: any that is free.")
    ] = 8765,
    host: Annotated[str, typer.Option(metavar="ADDRESS", help="The address that it listens at.")] = THERE,
    beyond: Beyond = False,
    label: Annotated[
        list[str] | None, typer.Option(metavar="LABEL", help="Only streams of this label (repeatable).")
    ] = None,
    duration: Duration = None,
) -> int:
    """Serve the federation to Foxglove until Ctrl-C, with the topics of a recording; clients can only watch."""
    check_reach(host, beyond=beyond, option="--host")
    for each in label or ():
        check_streamed(each)
    lasts_us = duration_us(duration, option="--duration", least_us=SHORTEST_US) if duration else None
    with connected(call) as client:
        try:
            with interruptible():
                return _served(call, client, (host, port), label or (), lasts_us)
        except KeyboardInterrupt:
            return INTERRUPTED


def _served(call: Call, client: Client, at: tuple[str, int], labels: Iterable[str], lasts_us: int | None) -> int:
    server = LiveServer(*at, f"dyknow {call.settings.federation}", client.federation_us)
    url = f"ws://{f'[{at[0]}]' if ':' in at[0] else at[0]}:{server.port}"
    try:
        call.out.say(
            line(
                styled("serving", "green"), f": {url}; in Foxglove: Open connection, Foxglove WebSocket; Ctrl-C ends it"
            ),
            event="serving",
            url=url,
        )
        recorder = pass_on(call, client, server, labels, lasts_us)
    finally:
        server.close()
    messages = sum(recorder.counts.values())
    call.out.say(
        line(
            styled("served", "green"), f": {counted(messages, 'message')} of {counted(len(recorder.units), 'platform')}"
        ),
        event="served",
        units=recorder.units,
        messages=messages,
        lost=server.lost,
        refused=server.refused,
    )
    return DONE
