"""`dyknow query`: the latest value of a semantic label, its value at a time, all between two times, or by number."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import typer

from dyknow.agents.exchange.readings import merge_inverse_variance, merge_mean, select_best, select_newest
from dyknow.console.arguments import StreamLabel, Unit
from dyknow.console.centre.client import connected, note_unreached
from dyknow.console.command import Call, command
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import unit_json
from dyknow.console.output.predictions import prediction_json, prediction_text
from dyknow.console.output.shown import Shown, styled
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.federation.messages.contents import Query, Reading
from dyknow.model.errors import NothingFound, WrongCall
from dyknow.model.instants import print_span
from dyknow.model.sample import Predicted
from dyknow.model.semantic_labels import SemanticLabel
from dyknow.model.values import NoValue
from dyknow.runtime.configuration.instants import clock_time
from dyknow.runtime.library.jobs import readings_of, readings_via
from dyknow.runtime.library.meanings import differing, meaning_to
from dyknow.runtime.library.questions import Which, age_of, check_name, is_own_label, query_of
from dyknow.runtime.library.results import variances_in

SELECT = {"newest": select_newest, "best": select_best}
MERGE = {"mean": merge_mean, "inverse-variance": merge_inverse_variance}


@command(example="dyknow query heli-position --at -10s")
def query(
    call: Call,
    label: StreamLabel,
    *,
    unit: Unit = None,
    at: Annotated[
        str | None, typer.Option(metavar="T", help="The value at a time: -10s, ISO 8601, microseconds.")
    ] = None,
    between: Annotated[
        tuple[str, str] | None,
        typer.Option(metavar="T1 T2", help="All values between two times, e.g. --between -10s -5s."),
    ] = None,
    last: Annotated[int | None, typer.Option(metavar="N", help="The N samples that came last, oldest first.")] = None,
    nth: Annotated[
        int | None, typer.Option(metavar="N", help="The N-th sample before the one that came last, which is 0.")
    ] = None,
    slice_: Annotated[
        tuple[int, int] | None,
        typer.Option("--slice", metavar="I J", help="Samples by number; the oldest that the platform holds is 0."),
    ] = None,
    timeout: Annotated[str, typer.Option(metavar="TIME", help="How long to wait for answers.")] = "2s",
    select: Annotated[Literal["newest", "best"] | None, typer.Option(help="One of the platforms' values.")] = None,
    merge: Annotated[Literal["mean", "inverse-variance"] | None, typer.Option(help="One value made of all.")] = None,
    via: Annotated[
        str | None,
        typer.Option(metavar="U", help="Ask this platform alone, which asks all others and answers for all."),
    ] = None,
) -> int:
    """The latest value of a label, at a time, all between two, or by number; exit 1 if no platform has any."""
    check_name(label)
    if select and merge:
        raise WrongCall("--select takes one of the values, --merge makes one of all: give one of them.")
    which = Which(at, between, last, nth, slice_)
    which.check()
    timeout_s = duration_us(timeout, option="--timeout", least_us=SHORTEST_US) / 1e6
    one_of_all = select is not None or merge is not None
    nothing = f"no sample between {between[0]} and {between[1]}" if between else "no sample"
    found: list[tuple[str, Reading]] = []

    if via is not None:
        if unit is not None or is_own_label(label):
            raise WrongCall("--via asks all platforms for a semantic label: give it without --unit, and no own label.")
        return _query_via(call, via, label, which, select, merge, timeout_s)

    def take(name: str, readings: list[Reading], why: str, answered_us: int) -> None:
        found.extend((name, reading) for reading in readings)
        if not readings:
            _missing(call, name, why or nothing)
        for reading in () if one_of_all else readings:
            age = age_of(client, name, label, reading.valid_us, answered_us) if which.is_newest else None
            _tell(call, meaning_to(client, name, label), label, name, reading, age)

    with connected(call) as client:
        with call.out.waiting(f"asking for {label}"):
            client.settle()
        client.run(readings_of(client, label, unit, which, timeout_s, take))
        said = differing(client, label, dict.fromkeys(name for name, _ in found))
        if said and one_of_all:
            raise NothingFound(f"{said}; ask one of them: --unit {found[0][0]}.")
        if said:
            call.out.note(f"{said}.")
        note_unreached(call, client)
        if one_of_all and found:
            _tell_one(call, meaning_to(client, found[0][0], label), label, found, select, merge)
    return DONE if found else NO


def _query_via(
    call: Call,
    via: str,
    label: str,
    which: Which,
    select: Literal["newest", "best"] | None,
    merge: Literal["mean", "inverse-variance"] | None,
    timeout_s: float,
) -> int:
    """One platform queries all others, and selects or merges."""
    with connected(call) as client:
        with call.out.waiting(f"asking {via} for {label}"):
            client.settle()
        asked = query_of(label, which, client.federation_us())
        assert isinstance(asked, Query)  # noqa: S101  (no own label comes here)
        content = asked.model_copy(update={"select": select, "merge": merge})
        pages, why = client.run(readings_via(client, via, content, timeout_s))
        if why:
            raise NothingFound(f"platform {via}: {why}")
        parts = [part for page in pages for part in page.answers]
        found = [(part.unit, reading) for part in parts for reading in part.samples]
        for name, reason in ((each.unit, each.reason) for page in pages for each in page.missing):
            _missing(call, name, reason)
        meaning = meaning_to(client, via, label)
        if select is None and merge is None:
            for name, reading in found:
                _tell(call, meaning, label, name, reading)
        elif found:
            _tell_chosen(call, meaning, label, found, pages[-1].merged, merge)
    return DONE if found else NO


def _missing(call: Call, unit: str, why: str) -> None:
    if call.out.json_lines:
        call.out.line({"unit": unit_json(unit), "error": why})
    else:
        call.out.show(styled(unit, "bold"), "  ", styled(why, "red"))


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
    if reading.made_us is not None:
        record |= prediction_json(Predicted(reading.made_us, reading.branch, reading.weight))
    for square, stated in variances_in(value or {}, reading.variance or {}).items():
        record[f"variance_{square}" if square else "variance"] = stated
    return record


def value_text(value: Any, meaning: SemanticLabel | None = None) -> str:
    """A value as text: fields with the digits that are significant; a single one with its unit."""
    if value is None:
        return "no value"
    if not isinstance(value, Mapping):
        return str(value)
    if meaning is not None and not meaning.sort.fields and value.keys() == {"value"}:
        unit = meaning.sort.unit
        return f"{_number('', value['value'])}{'' if unit in {'1', 'bool', 'text'} else f' {unit}'}"
    return "  ".join(f"{name} {_number(name, number)}" for name, number in value.items())


def _number(name: str, value: Any) -> str:
    if not isinstance(value, float):
        return str(value)
    return f"{value:.7f}" if name in {"latitude_deg", "longitude_deg"} else f"{value:.2f}"


def _tell(
    call: Call,
    meaning: SemanticLabel | None,
    label: str,
    unit: str,
    reading: Reading,
    age: tuple[int, bool] | None = None,
) -> None:
    """One sample; `age` of the latest is how old it is, and whether it is older than its policy allows."""
    record = reading_json(label, unit, reading)
    age_us, stale = age or (0, False)
    if call.out.json_lines:
        call.out.line(record if age is None else record | {"age_ms": age_us // 1000, "stale": stale})
        return
    old: Shown = styled(f"  {print_span(age_us)} old", "red") if stale else ""
    when = styled(clock_time(reading.valid_us), "dim")
    text = value_text(record["value"], meaning) + prediction_text(record)
    call.out.show(styled(unit, "bold"), "  ", when, "  ", text, old)


def _tell_one(
    call: Call,
    meaning: SemanticLabel | None,
    label: str,
    found: list[tuple[str, Reading]],
    select: str | None,
    merge: str | None,
) -> None:
    """The one reading that was selected, or made of all."""
    by_unit = call.settings.by_unit
    readings = [(reading, by_unit[unit].trust if unit in by_unit else 1.0) for unit, reading in found]
    chosen = SELECT[select](readings) if select else MERGE[str(merge)](readings)
    _tell_chosen(call, meaning, label, found, chosen, merge)


def _tell_chosen(
    call: Call,
    meaning: SemanticLabel | None,
    label: str,
    found: list[tuple[str, Reading]],
    chosen: Reading | None,
    merge: str | None,
) -> None:
    """Of `found`, one was chosen, or one was made of all."""
    if chosen is None:
        raise NothingFound(f"the answers state no variance to weigh {label} by; use --merge mean, or --select newest.")
    unit = next((unit for unit, reading in found if merge is None and reading == chosen), None)
    if unit is not None:
        _tell(call, meaning, label, unit, chosen)
    elif call.out.json_lines:
        units = sorted({unit_json(unit) for unit, _ in found}, key=str)
        call.out.line(reading_json(label, "", chosen) | {"unit": None, "units": units, "merge": merge})
    else:
        whose, when = styled(f"{merge} of {len(found)}", "bold"), styled(clock_time(chosen.valid_us), "dim")
        call.out.show(whose, "  ", when, "  ", value_text(reading_json(label, "", chosen)["value"], meaning))
