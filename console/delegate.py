"""`dyknow delegate`, `tasks`, `cancel` and `fault`: what platforms are asked to do."""

from collections.abc import Iterator, Sequence
from typing import Any

from console.client import Client, connected
from console.command import Call
from console.dialogue import Dialogue
from console.errors import DONE, INTERRUPTED, NO, WRONG, FederationFailed, NothingFound, WrongCall
from console.instants import SHORTEST_US, clock_time, duration_us
from console.output import unit_json, verbatim
from console.wording import content_of
from dyknow.errors import TextError
from federation.acts import Act, Performative
from federation.contents import (
    Alarm,
    Content,
    Done,
    Fault,
    MonitorProximity,
    Progress,
    Reason,
    Rejoin,
    Task,
    TaskList,
    Tasks,
    Verdict,
)
from federation.keys import unit as unit_name

P = Performative
ANSWER_S = 3.0
_STEP_S = 0.5
HEIR_S = 8.0
_ENDS = (Done, Verdict)


def delegate(call: Call, task: str, pairs: Sequence[str], *, to: str | None, wait: bool) -> int:
    """Ask for a task; with `wait` hear what follows until it is done or somebody interrupts (the task goes on)."""
    with connected(call) as client:
        content = content_of(task, pairs, client.federation_us())
        unit = _receiver(client, content, to)
        dialogue = client.say(unit, P.REQUEST, content, within_s=ANSWER_S, standing=True)
        heard = 0

        def tell() -> None:
            nonlocal heard
            for act, said in dialogue.said[heard:]:
                _tell(call, dialogue, act, said)
            heard = len(dialogue.said)

        try:
            with call.out.waiting(f"platform {unit} is considering it"):
                client.wait_for(lambda: bool(dialogue.said or dialogue.over), ANSWER_S + 0.5)
            tell()
            while wait and not dialogue.over and not _finished(dialogue):
                client.wait_for(lambda: len(dialogue.said) > heard or dialogue.over, _STEP_S)
                tell()
        except KeyboardInterrupt:
            if not call.out.json_lines:
                call.out.note(f"The task goes on; end it with: dyknow cancel {dialogue.conversation}")
            return INTERRUPTED
        if wait and dialogue.agreed and dialogue.failed and not _finished_well(dialogue):
            raise FederationFailed(f"{dialogue.failed}. {_heir(client, dialogue)}")
        return _outcome(dialogue)


def _receiver(client: Client, content: Content, to: str | None) -> str:
    """Who is asked; one that has left, and so is in no directory, hears that it may come back."""
    if isinstance(content, Rejoin):
        if to is None:
            raise WrongCall("--to: say which platform shall come back; who has left is not listed.")
        client.settle()
        return unit_name(to)
    units = client.chosen(to)
    if len(units) > 1 and not isinstance(content, MonitorProximity):
        raise WrongCall(f"--to: say which platform shall do it; there are {', '.join(units)}.")
    return units[0]


def _finished(dialogue: Dialogue) -> bool:
    return dialogue.trouble is not None or _finished_well(dialogue)


def _finished_well(dialogue: Dialogue) -> bool:
    return any(isinstance(said, _ENDS) for said in dialogue.results)


def _heir(client: Client, dialogue: Dialogue) -> str:
    """Who leads the task on, in words; another platform takes a few seconds to."""
    found: list[str] = []

    def look() -> bool:
        others = [unit for unit in client.chosen(None) if unit != dialogue.unit]
        found[:] = [unit for unit, task in all_tasks(client, others) if task.conversation == dialogue.conversation]
        return bool(found)

    until = client.federation_us() + round(HEIR_S * 1e6 * client.centre.clock.speed)
    while not look() and client.federation_us() < until:
        client.wait_for(lambda: False, _STEP_S)
    if not found:
        return "No other platform leads the task on; delegate it anew."
    return (
        f"Platform {found[0]} leads the task on: dyknow alarms --follow tells of it, "
        f"dyknow cancel {dialogue.conversation} ends it."
    )


def _outcome(dialogue: Dialogue) -> int:
    """0 agreed or done, 1 refused, 2 not understood, 3 failed or silent."""
    answers = {act.performative for act, _ in dialogue.said}
    if P.NOT_UNDERSTOOD in answers:
        return WRONG
    if P.REFUSE in answers:
        return NO
    if P.FAILURE in answers or (dialogue.failed and not dialogue.agreed) or not answers:
        raise FederationFailed(f"platform {dialogue.unit}: {dialogue.trouble or 'no answer in time'}")
    return DONE


def _tell(call: Call, dialogue: Dialogue, act: Act, said: Content | None) -> None:
    text = str(act.content) if act.content is not None else None
    if call.out.json_lines:
        record: dict[str, Any] = {
            "conversation": dialogue.conversation,
            "performative": act.performative.value,
            "unit": unit_json(dialogue.unit),
        }
        call.out.line(record | ({"content": text} if text else {}))
        return
    good = act.performative in {P.AGREE, P.INFORM}
    colour = "green" if good else "red"
    words = verbatim(plain(said)) if said is not None else ""
    suffix = f"  [dim]{dialogue.conversation}[/dim]" if act.performative is P.AGREE else ""
    call.out.console.print(
        f"[bold]{dialogue.unit}[/bold]  [{colour}]{act.performative}[/{colour}]  {words}{suffix}", soft_wrap=True
    )


def plain(said: Content) -> str:
    """An answer in words."""
    match said:
        case Reason():
            return said.text
        case Progress():
            return f"{said.step}{f' (platform {said.unit})' if said.unit else ''}"
        case Done():
            return said.text or "done"
        case Alarm():
            return f"alarm {said.event}: {said.monitor} between {', '.join(said.units)}, {clock_time(said.valid_us)}"
        case _:
            return str(said.expr())


# Tasks anywhere


def all_tasks(client: Client, units: list[str]) -> Iterator[tuple[str, Task]]:
    """(platform, task) as each platform tells."""
    for dialogue in client.ask(units, Tasks(), P.QUERY_REF, 2.0):
        for said in dialogue.results:
            if isinstance(said, TaskList):
                yield from ((dialogue.unit, task) for task in said.tasks)


def tasks(call: Call) -> int:
    """Every delegated task; 1 if there is none."""
    with connected(call) as client, call.out.waiting("asking for tasks"):
        found = [task for _, task in all_tasks(client, client.chosen(None))]
    if call.out.json_lines:
        for task in found:
            call.out.line(
                {
                    "conversation": task.conversation,
                    "task": task.task,
                    "unit": unit_json(task.unit),
                    "state": task.state,
                    "delegator": task.delegator,
                    "since_us": task.since_us,
                }
            )
    elif found:
        rows = [
            (
                f"{t.task}\n[dim]for {verbatim(_delegator(t))}[/dim]" if _delegator(t) else t.task,
                t.unit,
                verbatim(t.state),
                clock_time(t.since_us or 0).partition(".")[0],
                t.conversation,
            )
            for t in sorted(found, key=lambda task: not _delegator(task).startswith("cc"))
        ]
        call.out.table("", ("task", "on", "state", "since", "conversation"), rows, whole=("conversation",))
    else:
        call.out.note("no task is delegated; begin one with dyknow delegate monitor-proximity.")
    return DONE if found else NO


def _delegator(task: Task) -> str:
    """The unit that delegated it."""
    return (task.delegator or "").partition("@")[2]


def cancel(call: Call, conversation: str) -> int:
    """End a task by its conversation, or by the beginning of it if that is clear."""
    with connected(call) as client:
        units = client.chosen(None)
        found = [(unit, task.conversation) for unit, task in all_tasks(client, units)]
        named = sorted({name for _, name in found if name.startswith(conversation)})
        if conversation in named:
            named = [conversation]
        if not named:
            raise NothingFound(f"no platform has a task {conversation!r}; dyknow tasks lists those there are.")
        if len(named) > 1:
            raise WrongCall(f"CONVERSATION: {conversation!r} is the beginning of {', '.join(named)}; write more of it.")
        ends = [client.cancel(unit, name) for unit, name in found if name == named[0]]
        with call.out.waiting("taking down what the task set up"):
            client.wait_for(lambda: all(end.over for end in ends), ANSWER_S)
        for end in ends:
            for act, said in end.said:
                _tell(call, end, act, said)
        if all(end.trouble or not end.said for end in ends):
            raise FederationFailed(f"platform {ends[0].unit}: {ends[0].trouble or 'no answer in time'}")
    return DONE


def _fault(kind: str) -> tuple[str, str]:
    """The name and the amount of a fault; raises WrongCall."""
    from sim_uavs.faults import parse_fault

    name, _, value = kind.partition("=")
    if name == "clock" and value:
        duration_us(value.lstrip("+-"), option="KIND: clock")
    try:
        parse_fault(kind)
    except TextError as error:
        raise WrongCall(f"KIND: {error.message}; write {error.repair}.") from None
    return name, value


def fault(call: Call, unit: str, kind: str, duration: str | None) -> int:
    """Make a simulated vehicle fail."""
    name, value = _fault(kind)
    for_us = duration_us(duration, option="--for", least_us=SHORTEST_US) if duration else None
    with connected(call) as client:
        client.chosen(unit)
        content = Fault(kind=name, value=value or None, duration_s=for_us / 1e6 if for_us else None)
        dialogue = client.say(unit, P.REQUEST, content, within_s=ANSWER_S)
        began_us = client.federation_us()
        client.wait_for(lambda: bool(dialogue.results) or dialogue.over, ANSWER_S + 0.5)
        if dialogue.trouble is not None and not dialogue.trouble.startswith("failure"):
            raise NothingFound(f"platform {unit}: {dialogue.trouble}")
        if dialogue.trouble is not None or not dialogue.said:
            raise FederationFailed(f"platform {unit}: {dialogue.trouble or 'no answer in time'}")
    until_us = began_us + for_us if for_us else None
    ends = f" until {clock_time(until_us)}" if until_us else " until it is restarted"
    call.out.say(f"platform {unit}: {verbatim(kind)}{ends}", unit=unit_json(unit), fault=kind, until_us=until_us)
    return DONE
