"""`dyknow hz`: rate, loss and latency of a label, platform by platform."""

from collections.abc import Mapping, Sequence
from statistics import median
from typing import Annotated, Any, NamedTuple

import typer

from dyknow.console.arguments import Label, Unit
from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import unit_json
from dyknow.console.output.shown import styled
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Query, Samples
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.model.instants import US_PER_S, print_span
from dyknow.runtime.client import Client
from dyknow.runtime.library.jobs import SET_UP_S, request_streams
from dyknow.runtime.library.questions import GRACE_S, check_label, check_streamed

MAX_DELAY_S = 1.0
UNDECLARED_US = 100_000
"""The period in which streams are requested whose export has none, as imports do."""


class _Arrival(NamedTuple):
    valid_us: int
    latency_us: int


@command(example="dyknow hz heli-position --for 5s")
def hz(
    call: Call,
    label: Label,
    *,
    unit: Unit = None,
    duration: Annotated[str, typer.Option("--for", metavar="TIME", help="How long to listen.")] = "3s",
) -> int:
    """Rate, loss and latency of a label, platform by platform, at the platform's own period; exit 1 without a sample."""
    check_streamed(label)
    for_s = duration_us(duration, option="--for", least_us=SHORTEST_US) / 1e6
    arrived: dict[str, list[_Arrival]] = {}
    with connected(call) as client:

        def take(name: tuple[str, str, str], sample: Any, at_us: int) -> None:
            latency_us = client.centre.clock.federation_us(at_us) - sample.valid_us
            arrived.setdefault(name[0], []).append(_Arrival(sample.valid_us, latency_us))

        client.centre.on_sample = take
        periods = _periods(client, label, unit)
        check_label(client, label, answered=bool(periods))
        requested = {name: period_us or UNDECLARED_US for name, period_us in periods.items()}
        tasks = _request(client, label, requested, None)
        with call.out.waiting(f"looking for samples of {label}"):
            first_s = 2 * max(requested.values(), default=0) / US_PER_S + GRACE_S
            client.wait_for(lambda: all(len(arrived.get(task.unit, ())) > 1 for task in tasks), first_s)
            off_grid = [task.unit for task in tasks if len(arrived.get(task.unit, ())) < 2]
            tasks += _request(client, label, requested, _newest(client, label, off_grid))
        arrived.clear()
        with call.out.waiting(f"listening to {label}"):
            client.wait_for(lambda: False, for_s)
        ends = [client.cancel(task.unit, task.conversation) for task in tasks if not task.over]
        client.wait_for(lambda: all(end.over for end in ends), SET_UP_S)
    records = [_record(name, label, period_us, arrived.get(name, [])) for name, period_us in periods.items()]
    for record in records if call.out.json_lines else ():
        call.out.line(record)
    if records and not call.out.json_lines:
        columns = ("unit", "rate", "of", "lost", "latency", "worst")
        call.out.table("", columns, [_row(record) for record in records], right=columns[1:])
    return DONE if arrived else NO


def _periods(client: Client, label: str, unit: str | None) -> dict[str, int | None]:
    """The declared period of the label on each platform that has it, in microseconds; None without one."""
    units = client.chosen(unit)
    return {
        view.unit: entry.period_us or None
        for view in client.centre.platforms()
        if view.unit in units and view.entry is not None
        for entry in view.entry.labels
        if entry.label == label
    }


def _request(
    client: Client, label: str, periods: Mapping[str, int], begin_us: Mapping[str, int] | None
) -> list[Dialogue]:
    """Have platforms export the stream: on the grid of the epoch, or on that of an instant for each platform."""
    found: list[Dialogue] = []
    for name in periods if begin_us is None else begin_us:
        phase_us = None if begin_us is None else begin_us[name] % periods[name]
        asked = request_streams(client, label, [name], periods[name] / US_PER_S, MAX_DELAY_S, phase_us)
        found += [task for task in client.run(asked) if task.results]
    return found


def _newest(client: Client, label: str, units: Sequence[str]) -> dict[str, int]:
    """The valid time of the newest sample on each platform that has one."""
    asked = client.ask(units, Query(semantic_label=label), Performative.QUERY_REF, SET_UP_S)
    return {
        dialogue.unit: said.samples[-1].valid_us
        for dialogue in asked
        for said in dialogue.results
        if isinstance(said, Samples) and said.samples
    }


def _record(unit: str, label: str, period_us: int | None, arrived: list[_Arrival]) -> dict[str, Any]:
    """Rate and loss between the first and the last sample that came; of a single sample they are unknown.

    Without a declared period it is unknown how many were due, and so is the loss.
    """
    valid = sorted({one.valid_us for one in arrived})
    latencies = [one.latency_us for one in arrived]
    span_us = valid[-1] - valid[0] if valid else 0
    due = span_us // period_us + 1 if period_us else 0
    return {
        "unit": unit_json(unit),
        "label": label,
        "period_ms": period_us / 1000 if period_us else None,
        "samples": len(valid),
        "rate_hz": round((len(valid) - 1) * US_PER_S / span_us, 3) if span_us else None,
        "loss": round(max(0.0, 1 - len(valid) / due), 4) if span_us and due else None,
        "latency_us": round(median(latencies)) if latencies else None,
        "latency_max_us": max(latencies, default=None),
    }


def _row(record: dict[str, Any]) -> tuple[Any, ...]:
    period_ms, loss = record["period_ms"], record["loss"]
    declared = f"{1000 / period_ms:.1f} Hz" if period_ms else "any update"
    if record["rate_hz"] is None:
        few = "no sample" if not record["samples"] else "one sample"
        return (str(record["unit"]), styled(few, "red"), declared, "", "", "")
    return (
        str(record["unit"]),
        f"{record['rate_hz']:.1f} Hz",
        declared,
        "" if loss is None else styled(f"{loss:.1%}", "red" if loss else ""),
        print_span(record["latency_us"]),
        print_span(record["latency_max_us"]),
    )
