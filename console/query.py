"""`dyknow query`: the latest value of a semantic label, its value at a time, or all values between two times."""

from typing import Any

from agents.readings import merge_inverse_variance, merge_mean, select_best, select_newest
from console.client import Client, connected
from console.command import Call
from console.dialogue import Dialogue
from console.errors import DONE, NO, NothingFound, WrongCall, did_you_mean
from console.instants import SHORTEST_US, clock_time, duration_us, instant_us
from console.output import unit_json, verbatim
from dyknow.values import NoValue
from federation.acts import Performative
from federation.contents import Found, Query, Reading, Samples, Search
from federation.directory import unit_order
from federation.keys import label as label_name

SELECT = {"newest": select_newest, "best": select_best}
LOOK_S = 1.0
MERGE = {"mean": merge_mean, "inverse-variance": merge_inverse_variance}


def query(
    call: Call,
    label: str,
    *,
    unit: str | None,
    at: str | None,
    between: tuple[str, str] | None,
    timeout: str,
    select: str | None,
    merge: str | None,
) -> int:
    """Ask every platform, print answers as they come, name those that do not answer; 1 if nobody answered."""
    label_name(label)
    if select and merge:
        raise WrongCall("--select takes one of the values, --merge makes one of all: give one of them.")
    if at is not None and between is not None:
        raise WrongCall("--at asks for one instant, --between for a span: give one of them.")
    timeout_s = duration_us(timeout, option="--timeout", least_us=SHORTEST_US) / 1e6
    found: list[tuple[str, Reading]] = []
    with connected(call) as client:
        with call.out.waiting(f"asking for {label}"):
            units = client.chosen(unit)
        around = asked_whom_they_miss(client, units) if unit is None else []
        content = _content(label, at, between, client)
        one_of_all = select is not None or merge is not None
        for dialogue in client.ask(units, content, Performative.QUERY_REF, timeout_s):
            pages = [said for said in dialogue.results if isinstance(said, Samples)]
            if dialogue.trouble is not None or not pages:
                _missing(call, dialogue.unit, dialogue.trouble or "no answer")
                continue
            readings = [(dialogue.unit, reading) for page in pages for reading in page.samples]
            found += readings
            if not readings:
                _missing(call, dialogue.unit, _nothing(between))
            if not one_of_all:
                for _, reading in readings:
                    _tell(call, label, dialogue.unit, reading)
        for name in missed(client, units, around):
            _missing(call, name, "not heard any more")
        check_label(client, label, answered=bool(found))
    if one_of_all and found:
        _tell_one(call, label, found, select, merge)
    return DONE if found else NO


def asked_whom_they_miss(client: Client, units: list[str]) -> list[Dialogue]:
    """Ask the platforms whom they miss: one that fell silent before this command began is unknown to it."""
    return [client.say(unit, Performative.QUERY_REF, Search(), within_s=LOOK_S) for unit in units]


def missed(client: Client, units: list[str], around: list[Dialogue]) -> list[str]:
    """The platforms that somebody misses, besides `units`."""
    client.wait_for(lambda: not around or any(dialogue.results for dialogue in around), LOOK_S)
    found = [said for dialogue in around for said in dialogue.results if isinstance(said, Found)]
    return sorted({name for said in found for name in said.missing_units} - set(units), key=unit_order)


def _content(label: str, at: str | None, between: tuple[str, str] | None, client: Client) -> Query:
    """What to ask; times are federation time."""
    now_us = client.federation_us()
    if at is not None:
        return Query(semantic_label=label, op="at", at_us=instant_us(at, now_us, option="--at"))
    if between is not None:
        from_us, to_us = (instant_us(text, now_us, option="--between") for text in between)
        if from_us > to_us:
            raise WrongCall(f"--between: {between[0]} is later than {between[1]}; write the earlier time first.")
        return Query(semantic_label=label, op="between", from_us=from_us, to_us=to_us)
    return Query(semantic_label=label)


def check_label(client: Client, label: str, *, answered: bool) -> None:
    """When nobody could answer because nobody has such a label, say which labels there are."""
    there = client.centre.platforms()
    known = sorted({entry.label for seen in there if seen.entry for entry in seen.entry.labels})
    if not answered and known and label not in known:
        raise NothingFound(f"no platform offers {label!r}.{did_you_mean(label, known)}")


def _nothing(between: tuple[str, str] | None) -> str:
    return f"no sample between {between[0]} and {between[1]}" if between else "no sample"


def _missing(call: Call, unit: str, why: str) -> None:
    if call.out.json_lines:
        call.out.line({"unit": unit_json(unit), "error": why})
    else:
        call.out.console.print(f"[bold]{unit}[/bold]  [red]{verbatim(why)}[/red]")


def reading_json(label: str, unit: str, reading: Reading) -> dict[str, Any]:
    """One sample as a JSON line has it."""
    value = None if isinstance(reading.value, NoValue) else dict(reading.value)
    record: dict[str, Any] = {
        "unit": unit_json(unit),
        "label": label,
        "valid_us": reading.valid_us,
        "available_us": reading.available_us,
        "value": value,
    }
    if reading.variance is not None:
        record["variance"] = dict(reading.variance)
    return record


def value_text(value: Any) -> str:
    """A value for people: fields with as many digits as mean something."""
    if value is None:
        return "no value"
    if not isinstance(value, dict):
        return str(value)
    return "  ".join(f"{name} {_number(name, number)}" for name, number in value.items())


def _number(name: str, value: Any) -> str:
    if not isinstance(value, float):
        return str(value)
    return f"{value:.7f}" if name in {"latitude_deg", "longitude_deg"} else f"{value:.2f}"


def _tell(call: Call, label: str, unit: str, reading: Reading) -> None:
    record = reading_json(label, unit, reading)
    if call.out.json_lines:
        call.out.line(record)
    else:
        call.out.console.print(
            f"[bold]{unit}[/bold]  [dim]{clock_time(reading.valid_us)}[/dim]  {verbatim(value_text(record['value']))}"
        )


def _tell_one(call: Call, label: str, found: list[tuple[str, Reading]], select: str | None, merge: str | None) -> None:
    """The one reading that was selected, or made of all."""
    readings = [reading for _, reading in found]
    chosen = SELECT[select](readings) if select else MERGE[str(merge)](readings)
    if chosen is None:
        raise NothingFound(f"the answers state no variance to weigh {label} by; use --merge mean, or --select newest.")
    unit = next((unit for unit, reading in found if reading is chosen), None)
    if unit is not None:
        _tell(call, label, unit, chosen)
    elif call.out.json_lines:
        units = sorted({unit_json(unit) for unit, _ in found}, key=str)
        call.out.line(reading_json(label, "", chosen) | {"unit": None, "units": units, "merge": merge})
    else:
        call.out.console.print(
            f"[bold]{merge} of {len(readings)}[/bold]  [dim]{clock_time(chosen.valid_us)}[/dim]  "
            f"{verbatim(value_text(reading_json(label, '', chosen)['value']))}"
        )
