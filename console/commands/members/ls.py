"""`dyknow ls`: the directory as this command finds it, with the age of each label's last sample."""

import time
from collections.abc import Mapping
from typing import Annotated, Any

import typer

from console.centre.client import connected
from console.command import Call, command
from console.commands.members.ended_tasks import warn_of_ended
from console.errors import DONE, NO
from console.output.output import unit_json, verbatim
from dyknow.model.instants import US_PER_S, print_span
from federation.members.command_centre import PlatformView
from federation.members.directory import unit_order
from federation.members.liveness import PeerState
from federation.messages.acts import Performative
from federation.messages.contents import Query, Samples
from federation.messages.dialogue import Dialogue
from runtime.client import Client
from runtime.library.questions import ask_who_is_missing, missing_units

AGES_S = 1.0
_STATES = {"alive": "green", "suspect": "yellow", "refused": "red"}


@command(example="dyknow ls --json")
def ls(call: Call, *, all_kinds: Annotated[bool, typer.Option("--all", help="Command centres too.")] = False) -> int:
    """The directory: platforms, services, labels, age of samples, clock offsets; exit 1 if no platform is there."""
    with connected(call) as client:
        with call.out.waiting("looking for platforms"):
            client.settle()
            there = client.centre.platforms(all_kinds=all_kinds)
            alive = [seen.unit for seen in there if seen.kind == "uav" and seen.state == PeerState.ALIVE.value]
            around = ask_who_is_missing(client, alive)
            warn_of_ended(call, client, alive)
            ages = label_ages(client, there)
            # Who came or went while they were asked is listed as it is now.
            there = _with_missed(client, client.centre.platforms(all_kinds=all_kinds), around)
        records = [_record(client, seen, ages) for seen in there]
        centre = client.centre.unit
    if call.out.json_lines:
        for record in records:
            call.out.line(record)
    elif records:
        show(call, records)
    else:
        call.out.note(f"{centre} sees no platform of federation {call.settings.federation}: start some with dyknow up.")
    return DONE if any(seen.state in {"alive", "suspect"} for seen in there) else NO


def _with_missed(client: Client, there: list[PlatformView], around: list[Dialogue]) -> list[PlatformView]:
    """Platforms that are there and those they miss: one that was lost before this command began is unknown to it."""
    known = [seen.unit for seen in there]
    silent = [
        PlatformView(unit, "uav", PeerState.SUSPECT.value, None) for unit in client.run(missing_units(known, around))
    ]
    return sorted([*there, *silent], key=lambda seen: unit_order(seen.unit))


def label_ages(client: Client, there: list[PlatformView]) -> Mapping[tuple[str, str], int]:
    """How old the newest sample of each (unit, label) is, in federation time, by asking the platforms themselves."""
    asked = [
        (client.say(seen.unit, Performative.QUERY_REF, Query(semantic_label=entry.label), within_s=AGES_S), entry.label)
        for seen in there
        if seen.state == "alive" and seen.entry is not None
        for entry in seen.entry.labels
    ]
    client.wait_for(lambda: all(dialogue.over for dialogue, _ in asked), AGES_S + 0.2)
    ages = {}
    for dialogue, label in asked:
        for act, said in dialogue.said:
            if isinstance(said, Samples) and said.samples:
                # Both times are of the clock of the platform that answers.
                ages[dialogue.unit, label] = (
                    client.centre.clock.federation_us(act.created_us) - said.samples[-1].valid_us
                )
    return ages


def _record(client: Client, seen: PlatformView, ages: Mapping[tuple[str, str], int]) -> dict[str, Any]:
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
                "age_ms": age_us // 1000 if (age_us := ages.get((seen.unit, label.label))) is not None else None,
            }
            for label in (entry.labels if entry else ())
        ],
    }
    if entry is not None and entry.conditions:
        ahead_us = offset.offset_us if offset else 0
        record["conditions"] = [{"text": c.text, "since_us": c.since_us - ahead_us} for c in entry.conditions]
    if entry is not None and entry.refusal:
        record["error"] = entry.refusal
    return record


def show(call: Call, records: list[dict[str, Any]]) -> None:
    """One block of rows a platform: labels next to services."""
    rows = []
    for record in records:
        colour = _STATES.get(record["state"], "red")
        clock = (
            ""
            if record["offset_us"] is None
            else f"{print_span(record['offset_us'])} ± {print_span(record['bound_us'])}"
        )
        services = [
            f"[dim]{visibility}[/dim] {', '.join(names)}"
            for visibility in ("public", "protected")
            if (names := [s["service"] for s in record["services"] if s["visibility"] == visibility])
        ]
        labels = [f"{label['label']} [dim]{_age(label['age_ms'])}[/dim]" for label in record["labels"]]
        if "error" in record:
            services = [f"[red]{verbatim(record['error'])}[/red]"]
        rows.append(
            (
                str(record["unit"]),
                f"[{colour}]{record['state']}[/{colour}]",
                clock,
                "\n".join(labels),
                "\n".join(services),
            )
        )
    call.out.table("", ("unit", "state", "clock", "labels (age)", "services"), rows, wraps=("clock", "services"))
    now_us = time.time_ns() // 1000
    for record in records:
        for condition in record.get("conditions", ()):
            since = print_span(max(0, now_us - condition["since_us"]) // US_PER_S * US_PER_S)
            call.out.say(f"[yellow]{record['unit']}: {verbatim(condition['text'])}[/yellow] [dim](for {since})[/dim]")


def _age(age_ms: int | None) -> str:
    return "no sample" if age_ms is None else print_span(age_ms * 1000)
