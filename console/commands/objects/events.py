"""`dyknow explain` and `dyknow events`: the events of objects that platforms see, and the reasons."""

from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Annotated, Any

import typer

from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import unit_json
from dyknow.console.output.shown import line, styled
from dyknow.federation.messages.contents import ObjectEvent, ObjectEvents
from dyknow.model.instants import US_PER_S
from dyknow.runtime.library.jobs import lists

EVERY_S = 1.0
_STYLES = {
    "established": "green",
    "reestablished": "green",
    "unlinked": "yellow",
    "recognised": "cyan",
    "find": "green",
    "track": "green",
    "reacquire": "green",
    "lost": "yellow",
}


@command(example="dyknow explain car1")
def explain(
    call: Call,
    symbol: Annotated[str, typer.Argument(help="An object.")],
    *,
    unit: Annotated[str | None, typer.Option("--unit", metavar="U", help="Of one platform only.")] = None,
) -> int:
    """Why an object has its symbol: its links, the conditions that made and ended them, and by which samples."""
    with connected(call) as client:
        answers = client.run(lists(client, client.chosen(unit), ObjectEvents(symbol=symbol), ObjectEvents))
        found = _ordered(answers)
    for each in found:
        _tell(call, *each)
    if not found:
        call.out.note(f"no platform has linked an object {symbol}; dyknow objects lists those that are seen.")
    return DONE if found else NO


@command(example="dyknow events --follow")
def events(
    call: Call,
    *,
    unit: Annotated[str | None, typer.Option("--unit", metavar="U", help="Of one platform only.")] = None,
    follow: Annotated[bool, typer.Option("--follow", "-f", help="Also those to come.")] = False,
) -> int:
    """The events of objects: links made and ended, chronicles recognised of them; exit 1 if there are none."""
    with connected(call) as client:
        units = client.chosen(unit)
        told = set[tuple[str, ObjectEvent]]()
        since_us: int | None = None
        while True:
            found = _ordered(client.run(lists(client, units, ObjectEvents(since_us=since_us), ObjectEvents)))
            for each in found:
                if each not in told:
                    _tell(call, *each)
            if not follow:
                break
            told = {each for each in {*told, *found} if since_us is None or each[1].at_us > since_us}
            if found:  # events that become known late are requested again
                since_us = max(since_us or 0, found[-1][1].at_us - 10 * US_PER_S)
            client.wait_for(lambda: False, EVERY_S)
    if not found:
        call.out.note("nothing has happened to objects yet: no links were made, and no chronicle was recognised.")
    return DONE if found else NO


def _ordered(answers: Iterable[tuple[str, ObjectEvents]]) -> list[tuple[str, ObjectEvent]]:
    every = dict.fromkeys((unit, each) for unit, said in answers for each in said.events or ())
    return sorted(every, key=lambda each: (each[1].at_us, each[0]))


def _tell(call: Call, unit: str, event: ObjectEvent) -> None:
    if call.out.json_lines:
        call.out.line(_record(unit, event))
        return
    when = datetime.fromtimestamp(event.at_us / US_PER_S, UTC).strftime("%H:%M:%S.%f")[:-3]
    between = f"{event.source} -> {event.target}" if event.source else event.target
    kind = styled(event.event, _STYLES.get(event.event, "dim"))
    reason = f": {event.because}" if event.because else ""
    call.out.show(line(styled(when, "dim"), f"  {unit}  ", styled(between, "bold"), "  ", kind, reason), whole=True)


def _record(unit: str, event: ObjectEvent) -> dict[str, Any]:
    """One event, for `--json`."""
    return {
        "unit": unit_json(unit),
        "t_ms": event.at_us / 1000,
        "event": event.event,
        "from": event.source or None,
        "to": event.target,
        "because": event.because,
    }
