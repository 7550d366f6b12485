"""`dyknow call`: a stream that platforms offer at a cost, by a call for proposals."""

from typing import Annotated, Any

import typer

from dyknow.console.arguments import Count, Label
from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.commands.members.query import value_text
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import unit_json
from dyknow.console.output.shown import styled
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.federation.calls.proposals import CallNews
from dyknow.model.errors import FederationFailed
from dyknow.model.instants import print_span
from dyknow.runtime.client import Client
from dyknow.runtime.configuration.instants import clock_time
from dyknow.runtime.library.calls import CallItem, OpenCall, wanted_of
from dyknow.runtime.library.meanings import meaning_to
from dyknow.runtime.library.results import UnitSample
from dyknow.runtime.library.watched import WatchedStreams

_STEP_S = 0.5
_WORDS = {
    "called": "called for",
    "proposed": "proposes",
    "refused": "is not taken",
    "taken": "is taken",
    "failed": "failed",
    "open": "the call waits",
}


@command(example="dyknow call gas-level --every 100ms --max-delay 500ms --min-certainty 0.8")
def call(
    call: Call,
    label: Label,
    *,
    every: Annotated[str, typer.Option(metavar="TIME", help="Sample period.")] = "200ms",
    max_delay: Annotated[str, typer.Option(metavar="TIME", help="How old a sample may be when it is sent.")] = "1s",
    min_certainty: Annotated[
        float, typer.Option(metavar="P", min=0.0, max=1.0, help="How sure each sample must be, at least.")
    ] = 0.0,
    wait: Annotated[
        str, typer.Option(metavar="TIME", help="How long without a proposal that would do before it is given up.")
    ] = "5s",
    count: Count = None,
) -> int:
    """A stream that platforms offer at a cost: the cheapest that is good enough is taken, and when it fails the next."""
    wanted = wanted_of(label, every, max_delay, min_certainty)
    wait_us = duration_us(wait, option="--wait", least_us=SHORTEST_US)
    came: list[CallItem] = []
    seen = 0
    with connected(call) as client:
        client.chosen(None)
        opened = OpenCall(client, WatchedStreams(client), wanted, came.append)
        idle_us, why = client.now_us(), ""
        try:
            while count is None or seen < count:
                client.wait_for(lambda: bool(came), _STEP_S)
                items, came[:] = came[:], []
                for item in items:
                    if isinstance(item, CallNews):
                        _tell_news(call, item)
                        why = item.text if item.event in {"open", "refused"} else why
                    elif count is None or seen < count:
                        _tell_sample(call, client, item)
                        seen += 1
                if opened.call.taken is not None:
                    idle_us = client.now_us()
                elif client.now_us() - idle_us > wait_us:
                    raise FederationFailed(
                        f"no platform streams {label}: {why}; dyknow ls --labels lists what is offered."
                    )
        finally:
            opened.end()
    return DONE if seen else NO


def _tell_news(call: Call, news: CallNews) -> None:
    if call.out.json_lines:
        unit = unit_json(news.unit) if news.unit else None
        call.out.line({"event": news.event, "label": news.label, "unit": unit, "text": news.text})
    elif news.unit:
        call.out.note(f"platform {news.unit} {_WORDS[news.event]}: {news.text}")
    else:
        call.out.note(f"{_WORDS[news.event]}: {news.text}")


def _tell_sample(call: Call, client: Client, sample: UnitSample) -> None:
    value = dict(sample.value) or None
    record: dict[str, Any] = {
        "unit": unit_json(sample.unit),
        "label": sample.label,
        "valid_us": sample.valid_us,
        "available_us": sample.available_us,
        "value": value,
        "certainty": sample.quality.certainty,
    }
    if call.out.json_lines:
        call.out.line(record)
        return
    delay = print_span(sample.available_us - sample.valid_us)
    when = styled(f"{clock_time(sample.valid_us)} + {delay}", "dim")
    meaning = meaning_to(client, sample.unit, sample.label)
    call.out.show(styled(sample.unit, "bold"), "  ", when, "  ", value_text(value, meaning))
