"""`dyknow watch`: a federated stream under a policy, imported by this command."""

from typing import Annotated, Any, NamedTuple

import typer

from dyknow.console.arguments import Count, Label, Unit
from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.commands.members.query import value_text
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import unit_json
from dyknow.console.output.predictions import prediction_json, prediction_text
from dyknow.console.output.shown import styled
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.codec import StreamSample
from dyknow.federation.messages.contents import Query, Samples
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.model.errors import FederationFailed, WrongCall
from dyknow.model.instants import print_span
from dyknow.model.values import NO_VALUE
from dyknow.runtime.client import Client
from dyknow.runtime.configuration.instants import clock_time, instant_us
from dyknow.runtime.library.jobs import SET_UP_S, agreeing, request_streams
from dyknow.runtime.library.meanings import differing, meaning_to, record_of
from dyknow.runtime.library.questions import check_label, check_streamed

SILENT_US = 2_000_000
"""After this long, or two periods, without a sample the reason is printed."""
_STEP_S = 0.5


@command(example="dyknow watch heli-position --every 200ms --count 10")
def watch(
    call: Call,
    label: Label,
    *,
    unit: Unit = None,
    every: Annotated[str, typer.Option(metavar="TIME", help="Sample period.")] = "200ms",
    max_delay: Annotated[
        str, typer.Option(metavar="TIME", help="A sample that is older when it is sent is dropped.")
    ] = "1s",
    from_: Annotated[
        str | None, typer.Option("--from", metavar="T", help="Valid from then on: now, +5s, ISO 8601, microseconds.")
    ] = None,
    to: Annotated[str | None, typer.Option(metavar="T", help="Valid until then, which also ends it.")] = None,
    count: Count = None,
) -> int:
    """A federated stream under a policy, sample by sample; it ends with the command."""
    check_streamed(label)
    every_us = duration_us(every, option="--every", least_us=SHORTEST_US)
    delay_us = duration_us(max_delay, option="--max-delay", least_us=SHORTEST_US)
    seen = 0
    with connected(call) as client:
        came: list[dict[str, Any]] = []
        client.centre.on_sample = lambda name, sample, at_us: came.append(
            _record(client, name[0], name[1], sample, at_us)
        )
        if from_ is not None or to is not None:
            client.settle()  # the clock of the federation may be learned meanwhile
        duration = _duration(client, from_, to, every_us)
        tasks = _set_up(call, client, label, unit, every_us, delay_us, duration)
        begins_us = max(0, (duration.from_us or 0) - client.federation_us())
        silent_from_us: int | None = client.now_us() + begins_us
        try:
            while count is None or seen < count:
                client.wait_for(lambda: bool(came), _STEP_S)
                if came:
                    silent_from_us = client.now_us()
                elif silent_from_us is not None and client.now_us() - silent_from_us >= max(SILENT_US, 2 * every_us):
                    silent_from_us = None
                    silent = [task.unit for task in tasks if not task.over]
                    for other, phase_us in _tell_silence(call, client, label, silent, every_us, delay_us):
                        tasks += _on_own_grid(
                            client, label, other, every_us, delay_us, duration.at_phase(phase_us, every_us)
                        )
                for record in came[: None if count is None else count - seen]:
                    _tell(call, client, record)
                    seen += 1
                came.clear()
                if duration.to_us is not None and client.federation_us() > duration.to_us + delay_us:
                    break
                if all(task.over for task in tasks):
                    raise FederationFailed(f"the streams have ended: {tasks[0].failed or 'their platforms are gone'}")
        finally:
            ends = [client.cancel(task.unit, task.conversation) for task in tasks if not task.over]
            client.wait_for(lambda: all(end.over for end in ends), SET_UP_S)
    return DONE if seen else NO


class _Duration(NamedTuple):
    """The valid times that are wanted; None is no bound. A beginning lies on the grid of the samples."""

    from_us: int | None
    to_us: int | None

    def at_phase(self, phase_us: int, every_us: int) -> "_Duration":
        """The same on the grid of instants that are so much after multiples of the period."""
        from_us = self.from_us or 0
        return self._replace(from_us=from_us + (phase_us - from_us) % every_us)


def _duration(client: Client, from_: str | None, to: str | None, every_us: int) -> _Duration:
    """Both bounds on the clock of the federation, relative ones from now; raises WrongCall for one that is over."""
    now_us = client.federation_us()
    from_us = None if from_ is None else instant_us(from_, now_us, option="--from")
    to_us = None if to is None else instant_us(to, now_us, option="--to")
    if to_us is not None and to_us < now_us:
        raise WrongCall(f"--to: {to} was {print_span(now_us - to_us)} ago; dyknow query --between has what was.")
    if None not in (from_us, to_us) and (to_us or 0) < (from_us or 0):
        raise WrongCall(f"--to: {to} lies before --from {from_}.")
    return _Duration(None if from_us is None else from_us + -from_us % every_us, to_us)


def _set_up(
    call: Call, client: Client, label: str, unit: str | None, every_us: int, delay_us: int, duration: _Duration
) -> list[Any]:
    """Have the platforms export the stream to us; platforms that refuse are named."""
    with call.out.waiting(f"asking for a stream of {label}"):
        chosen = client.chosen(unit)
        units = agreeing(client, label, chosen, lambda name, why: call.out.note(f"platform {name}: {why}"))
        if not units:
            raise FederationFailed(f"no platform means by {label} what {call.settings.ontology} says.")
        asked = client.run(request_streams(client, label, units, every_us / 1e6, delay_us / 1e6, *duration))
    tasks = [task for task in asked if task.results]
    check_label(client, label, answered=bool(tasks))
    for task in asked:
        if task not in tasks:
            call.out.note(f"platform {task.unit}: {task.trouble or 'no answer'}")
    if said := differing(client, label, [task.unit for task in tasks]):
        call.out.note(f"{said}.")
    if not tasks:
        raise FederationFailed(f"no platform streams {label}; dyknow ls shows which labels there are.")
    return tasks


def _on_own_grid(
    client: Client, label: str, unit: str, every_us: int, delay_us: int, duration: _Duration
) -> list[Dialogue]:
    """Have a platform export the samples that lie on the grid of its own instants."""
    job = request_streams(client, label, [unit], every_us / 1e6, delay_us / 1e6, *duration)
    return [task for task in client.run(job) if task.results]


def _tell_silence(
    call: Call, client: Client, label: str, units: list[str], every_us: int, delay_us: int
) -> list[tuple[str, int]]:
    """No sample comes: print the reason for each platform, by its newest sample; once in each gap.

    Returns the platforms whose samples lie off the grid, and by how many microseconds.
    """
    off_grid: list[tuple[str, int]] = []
    for dialogue in client.ask(units, Query(semantic_label=label), Performative.QUERY_REF, SET_UP_S):
        newest = next(
            (said.samples[-1] for said in dialogue.results if isinstance(said, Samples) and said.samples), None
        )
        phase_us = 0 if newest is None else newest.valid_us % every_us
        age_us = 0 if newest is None else client.federation_us() - newest.valid_us
        if newest is None:
            why = dialogue.trouble or f"it has no sample of {label} yet"
        elif age_us > every_us + delay_us + SILENT_US:
            why = f"its newest sample is {print_span(age_us)} old"
        elif (took_us := newest.available_us - newest.valid_us) > delay_us:
            why = (
                f"its newest sample was there {print_span(took_us)} after it was valid, "
                f"and --max-delay {print_span(delay_us)} drops what is later"
            )
        elif phase_us:
            off_grid.append((dialogue.unit, phase_us))
            grid = print_span(every_us)
            why = (
                f"its samples arrive at x.{newest.valid_us // 1000 % 1000:03} s, off the grid of {grid}; "
                f"every {grid} at its own instants from now on"
            )
        else:
            why = f"its newest sample is {print_span(max(0, age_us))} old"
        call.out.note(f"no sample from platform {dialogue.unit}: {why}.")
    return off_grid


def _record(client: Client, owner: str, label: str, sample: StreamSample, at_us: int) -> dict[str, Any]:
    value = None if sample.value is NO_VALUE else record_of(client, owner, label, sample.value)
    return {
        "unit": unit_json(owner),
        "label": label,
        "valid_us": sample.valid_us,
        "available_us": client.centre.clock.federation_us(at_us),
        "value": value,
        **prediction_json(sample.quality.prediction),
    }


def _tell(call: Call, client: Client, record: dict[str, Any]) -> None:
    if call.out.json_lines:
        call.out.line(record)
        return
    delay_us = record["available_us"] - record["valid_us"]
    delay = f" + {print_span(delay_us)}" if delay_us >= 0 else ""
    when = styled(f"{clock_time(record['valid_us'])}{delay}", "dim")
    meaning = meaning_to(client, str(record["unit"]), record["label"])
    text = value_text(record["value"], meaning)
    call.out.show(styled(record["unit"], "bold"), "  ", when, "  ", text, prediction_text(record))
