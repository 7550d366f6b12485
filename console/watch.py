"""`dyknow watch`: a federated stream under a policy, imported by this command."""

from typing import Any

from console.client import Client, connected
from console.command import Call
from console.errors import DONE, NO, FederationFailed
from console.instants import SHORTEST_US, clock_time, duration_us
from console.output import unit_json, verbatim
from console.query import check_label, value_text
from dyknow.instants import print_span
from dyknow.values import NO_VALUE
from federation.acts import Performative
from federation.codec import StreamSample
from federation.contents import CreateMulticast
from federation.keys import label as label_name
from federation.ontology import default_ontology

SET_UP_S = 2.0
_STEP_S = 0.5


def watch(call: Call, label: str, *, unit: str | None, every: str, max_delay: str, count: int | None) -> int:
    """One line a sample until `count` have come or somebody interrupts; the streams end with the command."""
    label_name(label)
    every_us = duration_us(every, option="--every", least_us=SHORTEST_US)
    delay_us = duration_us(max_delay, option="--max-delay", least_us=SHORTEST_US)
    seen = 0
    with connected(call) as client:
        came: list[dict[str, Any]] = []
        client.centre.on_sample = lambda owner, name, sample, at_us: came.append(
            _record(client, owner, name, sample, at_us)
        )
        tasks = _set_up(call, client, label, unit, every_us, delay_us)
        try:
            while count is None or seen < count:
                client.wait_for(lambda: bool(came), _STEP_S)
                for record in came[: None if count is None else count - seen]:
                    _tell(call, record)
                    seen += 1
                came.clear()
                if all(task.over for task in tasks):
                    raise FederationFailed(f"the streams have ended: {tasks[0].failed or 'their platforms are gone'}")
        finally:
            ends = [client.cancel(task.unit, task.conversation) for task in tasks if not task.over]
            client.wait_for(lambda: all(end.over for end in ends), SET_UP_S)
    return DONE if seen else NO


def _set_up(call: Call, client: Client, label: str, unit: str | None, every_us: int, delay_us: int) -> list[Any]:
    """Have the platforms export the stream to us; those that refuse are named."""
    content = CreateMulticast(
        semantic_labels=(label,),
        sample_period_s=every_us / 1e6,
        delay_s=delay_us / 1e6,
        to_units=(client.centre.unit,),
    )
    with call.out.waiting(f"asking for a stream of {label}"):
        asked = [
            client.say(name, Performative.REQUEST, content, within_s=SET_UP_S, standing=True)
            for name in client.chosen(unit)
        ]
        client.wait_for(lambda: all(task.results or task.trouble for task in asked), SET_UP_S + 0.5)
    tasks = [task for task in asked if task.results]
    check_label(client, label, answered=bool(tasks))
    for task in asked:
        if task not in tasks:
            call.out.note(f"platform {task.unit}: {task.trouble or 'no answer'}")
    if not tasks:
        raise FederationFailed(f"no platform streams {label}; dyknow ls shows which labels there are.")
    return tasks


def _record(client: Client, owner: str, label: str, sample: StreamSample, at_us: int) -> dict[str, Any]:
    ontology = default_ontology()
    value: Any = sample.value
    if value is NO_VALUE:
        value = None
    elif label in ontology:
        value = ontology[label].sort.as_record(value)
    return {
        "unit": unit_json(owner),
        "label": label,
        "valid_us": sample.valid_us,
        "available_us": client.centre.clock.federation_us(at_us),
        "value": value,
    }


def _tell(call: Call, record: dict[str, Any]) -> None:
    if call.out.json_lines:
        call.out.line(record)
        return
    delay = print_span(record["available_us"] - record["valid_us"])
    call.out.console.print(
        f"[bold]{record['unit']}[/bold]  [dim]{clock_time(record['valid_us'])} + {delay}[/dim]  "
        f"{verbatim(value_text(record['value']))}"
    )
