"""`dyknow ls`: the directory as this command finds it, with the age of each label's last sample."""

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import typer

from dyknow.console.arguments import Follow
from dyknow.console.centre.client import connected, note_unreached
from dyknow.console.command import Call, command
from dyknow.console.commands.members.ended_tasks import warn_of_ended
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import unit_json
from dyknow.console.output.shown import Shown, line, stacked, styled
from dyknow.federation.members.command_centre import PlatformView
from dyknow.federation.members.liveness import PeerState
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Query, Samples
from dyknow.model.instants import US_PER_S, print_span
from dyknow.runtime.client import Client
from dyknow.runtime.library.jobs import all_platforms
from dyknow.runtime.library.questions import gone_text, is_stale

AGES_S = 1.0
WATCH_S = 1.0
LOW_BATTERY = 0.2
CLOCKS_S = 0.3
"""How long the clocks of platforms are waited for; questions to them begin a tenth of a second after the first sight."""
_STATES = {"alive": "green", "suspect": "yellow", "refused": "red"}


@command(example="dyknow ls --json")
def ls(
    call: Call,
    *,
    all_kinds: Annotated[bool, typer.Option("--all", help="Command centres too.")] = False,
    long: Annotated[bool, typer.Option("--long", "-l", help="Labels with their ages, services, clocks.")] = False,
    follow: Follow = False,
    watch: Annotated[bool, typer.Option("--watch", "-w", help="Again every second, until Ctrl-C.")] = False,
) -> int:
    """The platforms, a line each: state, battery, altitude, age of the oldest data; exit 1 if none is there."""
    with connected(call) as client:
        if follow:
            from dyknow.console.commands.members.directory_news import follow_directory

            _list(call, client, all_kinds=all_kinds, long=long)
            follow_directory(call, client)
        if not watch:
            return _list(call, client, all_kinds=all_kinds, long=long)
        while True:
            _list(call, client, all_kinds=all_kinds, long=long, clears=True)
            client.wait_for(lambda: False, WATCH_S)


def _list(call: Call, client: Client, *, all_kinds: bool, long: bool, clears: bool = False) -> int:
    """Look and print once; `clears` a terminal before."""
    with call.out.waiting("" if clears else "looking for platforms"):
        there = client.run(all_platforms(client, all_kinds=all_kinds))
        alive = [seen.unit for seen in there if seen.kind == "uav" and seen.state == PeerState.ALIVE.value]
        newest = newest_samples(client, there)
        if long or call.out.json_lines:
            client.wait_for(lambda: all(client.centre.member.offsets.of(unit) for unit in alive), CLOCKS_S)
    if clears:
        call.out.clear()
    warn_of_ended(call, client, alive)
    records = [_record(client, seen, newest) for seen in there]
    if call.out.json_lines:
        for record in records:
            call.out.line(record)
    elif not records:
        call.out.note(client.no_platform())
    elif long:
        show(call, records, client.now_us())
    else:
        _show_short(call, records, newest, client.now_us())
    note_unreached(call, client)
    return DONE if any(seen.state in {"alive", "suspect"} for seen in there) else NO


class _Newest(NamedTuple):
    """The newest sample of a label: its age in microseconds of federation time, and its value by field."""

    age_us: int
    value: Mapping[str, Any]


def newest_samples(client: Client, there: list[PlatformView]) -> Mapping[tuple[str, str], _Newest]:
    """The newest sample of each (unit, label), by asking the platforms themselves."""
    asked = [
        (client.say(seen.unit, Performative.QUERY_REF, Query(semantic_label=entry.label), within_s=AGES_S), entry.label)
        for seen in there
        if seen.state == "alive" and seen.entry is not None
        for entry in seen.entry.labels
    ]
    client.wait_for(lambda: all(dialogue.over for dialogue, _ in asked), AGES_S + 0.2)
    newest = {}
    for dialogue, label in asked:
        for act, said in dialogue.said:
            if isinstance(said, Samples) and said.samples:
                # Both times are of the clock of the platform that answers.
                last = said.samples[-1]
                age_us = client.centre.clock.federation_us(act.created_us) - last.valid_us
                newest[dialogue.unit, label] = _Newest(age_us, last.value if isinstance(last.value, Mapping) else {})
    return newest


def _record(client: Client, seen: PlatformView, newest: Mapping[tuple[str, str], _Newest]) -> dict[str, Any]:
    offset, entry = client.centre.member.offsets.of(seen.unit), seen.entry
    record: dict[str, Any] = {
        "unit": unit_json(seen.unit),
        "kind": seen.kind,
        "state": seen.state,
        # A life is numbered by the millisecond in which it began, on the platform's own clock.
        "since_us": entry.boot * 1000 if entry and entry.boot else None,
        "offset_us": offset.offset_us if offset else None,
        "bound_us": offset.bound_us if offset else None,
        "clock": offset.standing.value if offset else "unknown",
        "services": [
            {"agent": service.agent, "service": service.service, "visibility": service.visibility.value}
            for service in (entry.services if entry else ())
        ],
        "labels": [
            {
                "label": label.label,
                "sort": label.sort,
                "period_ms": label.period_us // 1000,
                **({} if label.cost is None else {"cost": label.cost}),
                "age_ms": last.age_us // 1000 if (last := newest.get((seen.unit, label.label))) else None,
                "stale": last is not None and is_stale(client, last.age_us, label.period_us),
            }
            for label in (entry.labels if entry else ())
        ],
    }
    if seen.state == "alive":
        record["data"] = _data(record["labels"])
    if seen.gone_us is not None:
        record["gone_us"] = seen.gone_us
    if entry is not None and entry.conditions:
        ahead_us = offset.offset_us if offset else 0
        record["conditions"] = [{"text": c.text, "since_us": c.since_us - ahead_us} for c in entry.conditions]
    if entry is not None and entry.refusal:
        record["error"] = entry.refusal
    return record


def _data(labels: list[dict[str, Any]]) -> str:
    """`fresh`; `stale`: of some labels it is; `none`: of all, or there never was any."""
    if not labels:
        return "fresh"
    came = [label for label in labels if label["age_ms"] is not None]
    stale = [label for label in came if label["stale"]]
    return "none" if len(stale) == len(came) else "stale" if stale else "fresh"


def show(call: Call, records: list[dict[str, Any]], now_us: int) -> None:
    """One block of rows a platform: labels next to services. The time is the node clock."""
    rows = []
    for record in records:
        state, colour = _state(record, now_us)
        clock = (
            ""
            if record["offset_us"] is None
            else f"{print_span(record['offset_us'])} ± {print_span(record['bound_us'])}"
        )
        services: list[Shown] = [
            line(styled(visibility, "dim"), f" {', '.join(names)}")
            for visibility in ("public", "protected")
            if (names := [s["service"] for s in record["services"] if s["visibility"] == visibility])
        ]
        labels = [line(label["label"], " ", _age(label)) for label in record["labels"]]
        if "error" in record:
            services = [styled(record["error"], "red")]
        rows.append(
            (
                str(record["unit"]),
                styled(state, colour),
                clock,
                stacked(labels),
                stacked(services),
            )
        )
    call.out.table("", ("unit", "state", "clock", "labels (age)", "services"), rows, wraps=("clock", "services"))
    _show_conditions(call, records, now_us)


def _show_short(
    call: Call, records: list[dict[str, Any]], newest: Mapping[tuple[str, str], _Newest], now_us: int
) -> None:
    """One row a platform. The time is the node clock."""
    rows = []
    for record in records:
        state, colour = _state(record, now_us)
        unit, ages = (
            str(record["unit"]),
            [label for label in record["labels"] if label["age_ms"] is not None and label["period_ms"]],
        )
        oldest = max(ages, key=lambda label: (label["stale"], label["age_ms"]), default=None)

        def last(label: str, field: str, unit: str = unit) -> float | None:
            sample = newest.get((unit, label))
            value = None if sample is None else sample.value.get(field)
            return float(value) if isinstance(value, int | float) else None

        battery, altitude_m, height_m = (
            last("battery", "fraction"),
            last("heli-altitude", "altitude_m"),
            last("heli-height", "height_m"),
        )
        rows.append(
            (
                unit,
                styled(state, colour),
                "" if battery is None else styled(f"{battery:.0%}", "red" if battery < LOW_BATTERY else ""),
                "" if altitude_m is None else f"{altitude_m:.0f} m",
                "" if height_m is None else f"{height_m:.0f} m",
                str(len(record["labels"])),
                "" if oldest is None else _age(oldest),
            )
        )
    columns = ("unit", "state", "battery", "altitude", "height", "labels", "oldest")
    call.out.table("", columns, rows, right=columns[2:])
    for record in records:
        if "error" in record:
            call.out.show(styled(f"{record['unit']}: {record['error']}", "red"))
    _show_conditions(call, records, now_us)


def _show_conditions(call: Call, records: list[dict[str, Any]], now_us: int) -> None:
    """Print the platforms' conditions, e.g. `avoidance off: mode AUTO`."""
    for record in records:
        for condition in record.get("conditions", ()):
            since = print_span(max(0, now_us - condition["since_us"]) // US_PER_S * US_PER_S)
            text = styled(f"{record['unit']}: {condition['text']}", "yellow")
            call.out.show(text, styled(f" (for {since})", "dim"))


def _state(record: dict[str, Any], now_us: int) -> tuple[str, str]:
    """The state in words, and its colour: a platform without fresh data is not green."""
    state = record["state"]
    if "gone_us" in record:
        return gone_text(now_us - record["gone_us"]), "red"
    data = {"none": "no data", "stale": "stale data"}.get(record.get("data", ""))
    return (f"{state}, {data}", "red") if data else (state, _STATES.get(state, "red"))


def _age(label: dict[str, Any]) -> Shown:
    age_ms, colour = label["age_ms"], "red" if label["stale"] else "dim"
    return styled("no sample" if age_ms is None else print_span(age_ms * 1000), colour)
