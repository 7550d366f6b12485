"""`dyknow delegate`, `tasks`, `cancel` and `fault`: requests to platforms."""

import time
from typing import Annotated, Any, Literal

import typer

from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command, search_working_directory
from dyknow.console.errors import DONE, INTERRUPTED, NO, WRONG
from dyknow.console.output.output import unit_json
from dyknow.console.output.shown import Shown, line, styled
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import (
    Alarm,
    Content,
    Done,
    Fault,
    Progress,
    Reason,
    TaskEntry,
)
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.model.errors import FederationFailed, NothingFound, TextError, WrongCall
from dyknow.runtime.client import Client
from dyknow.runtime.configuration.instants import clock_time
from dyknow.runtime.configuration.settings import load
from dyknow.runtime.configuration.wording import content_with, typed, values_of
from dyknow.runtime.library.jobs import begin_task, listed_tasks, running_already, state_of
from dyknow.runtime.library.jobs import tasks as all_tasks
from dyknow.runtime.library.listings import conversation_of

P = Performative
ANSWER_S = 3.0
_STEP_S = 0.5
SUCCESSOR_S = 8.0


def typed_names() -> list[str]:
    """The tasks that can be delegated, with those of extensions that a variable or a file names."""
    search_working_directory()
    return list(typed(load({}, None).extensions))


@command(example="dyknow delegate monitor-proximity --to 0 --wait")
def delegate(
    call: Call,
    task: Annotated[
        str,
        typer.Argument(
            metavar="TASK",
            help="monitor-proximity, create-multicast, goto, hold, ...",
            autocompletion=typed_names,
        ),
    ],
    pairs: Annotated[
        list[str] | None, typer.Argument(metavar="[KEY=VALUE]...", help="e.g. profile=proximity sample-period=1s")
    ] = None,
    *,
    to: Annotated[str | None, typer.Option(metavar="U", help="The platform that gets the task.")] = None,
    wait: Annotated[
        Literal["acceptance", "arrival"] | None,
        typer.Option(
            "--wait",
            "-w",
            metavar="[arrival]",
            help="Show its reports, until Ctrl-C; that does not end the task. arrival: until a goto has arrived.",
        ),
    ] = None,
    when: Annotated[
        str | None, typer.Option(metavar="FORMULA", help="Once this is true on that platform, and not before.")
    ] = None,
    waits: Annotated[str, typer.Option("--for", metavar="TIME", help="How long it waits for --when.")] = "10min",
) -> int:
    """A task for a platform, as a speech act to its interface agent; it continues when the command ends."""
    given = values_of(task, pairs or (), call.settings.extensions)
    if wait == "arrival":
        if task != "goto":
            raise WrongCall(f"--wait arrival belongs to goto; expected goto, got {task}. Write --wait.")
        given = {**given, "until": "arrival"}
    content_with(task, given, time.time_ns() // 1000, call.settings.extensions)  # errors, before anything is sent
    with connected(call) as client:
        condition = None if when is None else (when, waits)
        if condition is None and (running := client.run(running_already(client, task, to, given))) is not None:
            return _runs_already(call, running)
        dialogue = client.run(begin_task(client, task, to, given, ANSWER_S, condition))
        heard = 0

        def report() -> None:
            nonlocal heard
            for act, said in dialogue.said[heard:]:
                _tell(call, dialogue, act, said)
            heard = len(dialogue.said)

        try:
            with call.out.waiting(f"waiting for platform {dialogue.unit}"):
                client.wait_for(lambda: bool(dialogue.said or dialogue.over), ANSWER_S + 0.5)
            report()
            while wait and state_of(dialogue) == "running":
                client.wait_for(lambda: len(dialogue.said) > heard or dialogue.over, _STEP_S)
                report()
        except KeyboardInterrupt:
            if not call.out.json_lines:
                call.out.note(f"The task continues; end it with: dyknow cancel {dialogue.conversation}")
            return INTERRUPTED
        if wait and dialogue.agreed and dialogue.failed and state_of(dialogue) == "failed":
            raise FederationFailed(f"{dialogue.failed}. {_successor(client, dialogue)}")
        return _outcome(dialogue)


def _runs_already(call: Call, running: TaskEntry) -> int:
    """Name the task that does what was asked for, which holds it, and since when; 1, since none was begun."""
    since = clock_time(running.since_us or 0).partition(".")[0]
    call.out.say(
        f"{running.task} runs already: platform {running.unit} coordinates it since {since}, "
        f"for {_delegator(running) or 'no one'}, as {running.conversation}. "
        f"dyknow alarms --follow shows its alarms, dyknow cancel {running.conversation} ends it.",
        event="runs-already",
        **_record(running),
    )
    return NO


def _successor(client: Client, dialogue: Dialogue) -> str:
    """The successor of a coordinator that is gone, in words; it takes over within a few seconds."""
    found: list[str] = []

    def look() -> bool:
        others = [unit for unit in client.chosen(None) if unit != dialogue.unit]
        found[:] = [
            unit for unit, task in client.run(all_tasks(client, others)) if task.conversation == dialogue.conversation
        ]
        return bool(found)

    until = client.federation_us() + round(SUCCESSOR_S * 1e6 * client.centre.clock.speed)
    while not look() and client.federation_us() < until:
        client.wait_for(lambda: False, _STEP_S)
    if not found:
        return "No other platform takes over the task; delegate it again."
    return (
        f"Platform {found[0]} continues the task: dyknow alarms --follow shows its alarms, "
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
            "unit": unit_json(act.sender.unit),
        }
        call.out.line(record | ({"content": text} if text else {}))
        return
    good = act.performative in {P.AGREE, P.INFORM}
    colour = "green" if good else "red"
    words = plain(said) if said is not None else ""
    suffix: Shown = styled(f"  {dialogue.conversation}", "dim") if act.performative is P.AGREE else ""
    unit, how = styled(act.sender.unit, "bold"), styled(act.performative.value, colour)
    call.out.show(unit, "  ", how, "  ", words, suffix, whole=True)


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
            unseen = f" (reported by {said.by}, not seen by {', '.join(said.unseen_by)})" if said.unseen_by else ""
            between = ", ".join(said.units)
            return f"alarm {said.event}: {said.monitor} between {between}, {clock_time(said.valid_us)}{unseen}"
        case _:
            return str(said.expr())


# Tasks anywhere


@command(example="dyknow tasks")
def tasks(call: Call) -> int:
    """Delegated tasks of all platforms; exit 1 if there is none."""
    with connected(call) as client, call.out.waiting("asking for tasks"):
        found = [task for _, task in client.run(listed_tasks(client, client.chosen(None)))]
    if call.out.json_lines:
        for task in found:
            call.out.line(_record(task))
    elif found:
        rows = [
            (
                line(t.task, styled(f"\nfor {_delegator(t)}", "dim")) if _delegator(t) else t.task,
                t.unit,
                t.state,
                clock_time(t.since_us or 0).partition(".")[0],
                t.conversation,
            )
            for t in sorted(found, key=lambda task: not _delegator(task).startswith("cc"))
        ]
        call.out.table("", ("task", "on", "state", "since", "conversation"), rows, whole=("conversation",))
    else:
        call.out.note("no task is delegated; begin one with dyknow delegate monitor-proximity.")
    return DONE if found else NO


def _record(task: TaskEntry) -> dict[str, Any]:
    """A task, for `--json`."""
    ended = {} if task.ended_by is None else {"ended_by": unit_json(task.ended_by)}
    return {
        "conversation": task.conversation,
        "task": task.task,
        "unit": unit_json(task.unit),
        "state": task.state,
        "delegator": task.delegator,
        "since_us": task.since_us,
    } | ended


def _delegator(task: TaskEntry) -> str:
    """The unit that delegated it."""
    return (task.delegator or "").partition("@")[2]


@command(example="dyknow cancel cc-4711-5f3a-1")
def cancel(
    call: Call,
    conversation: Annotated[
        str, typer.Argument(metavar="CONVERSATION", help="As dyknow tasks shows it, or its beginning.")
    ],
) -> int:
    """End a task, and take down all it set up."""
    with connected(call) as client:
        ends = [client.cancel(unit, name) for unit, name in client.run(conversation_of(client, conversation))]
        with call.out.waiting("taking down what the task set up"):
            client.wait_for(lambda: all(end.over for end in ends), ANSWER_S)
        for end in ends:
            for act, said in end.said:
                _tell(call, end, act, said)
        if all(end.trouble or not end.said for end in ends):
            raise FederationFailed(f"platform {ends[0].unit}: {ends[0].trouble or 'no answer in time'}")
        client.over(ends[0].conversation)
    return DONE


def _fault(kind: str) -> tuple[str, str]:
    """The name and the amount of a fault; raises WrongCall."""
    from dyknow.sim_uavs.dynamics.faults import parse_fault

    name, _, value = kind.partition("=")
    if name == "clock" and value:
        duration_us(value.lstrip("+-"), option="KIND: clock")
    try:
        parse_fault(kind)
    except TextError as error:
        raise WrongCall(f"KIND: {error.message}; write {error.repair}.") from None
    return name, value


def _kinds() -> list[str]:
    from dyknow.sim_uavs.dynamics.faults import KINDS

    return list(KINDS)


@command(example="dyknow fault 1 gps-loss --for 5s")
def fault(
    call: Call,
    unit: Annotated[str, typer.Argument(metavar="UNIT", help="A simulated UAV.")],
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND",
            help="gps-loss, frozen-position, silence, packet-loss=30, clock=+5s, ...",
            autocompletion=_kinds,
        ),
    ],
    duration: Annotated[str | None, typer.Option("--for", metavar="TIME", help="How long, e.g. 5s.")] = None,
) -> int:
    """A fault in a simulated UAV."""
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
    call.out.say(f"platform {unit}: {kind}{ends}", unit=unit_json(unit), fault=kind, until_us=until_us)
    return DONE
