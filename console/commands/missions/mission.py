"""`dyknow mission`: have platforms reach the goals of a problem, and follow how they do."""

from pathlib import Path
from typing import Annotated, Any

import typer

from dyknow.console.centre.client import connected
from dyknow.console.command import Call, command
from dyknow.console.commands.texts.specification_files import read_text
from dyknow.console.errors import DONE, INTERRUPTED, NO
from dyknow.console.output.output import unit_json
from dyknow.console.output.shown import styled
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.federation.messages.contents import Done, MissionEntry, MissionProposal, Progress, Reason
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.model.errors import FederationFailed
from dyknow.runtime.client import Client
from dyknow.runtime.configuration.instants import clock_time
from dyknow.runtime.library.jobs import state_of
from dyknow.runtime.library.missions import (
    MissionRequest,
    abort_mission,
    answer_question,
    begin_mission,
    control_mission,
    listed_missions,
    name_of,
    platforms_given,
)

_STEP_S = 0.5
Name = Annotated[str | None, typer.Argument(metavar="[MISSION]", help="Its name; may be left out if only one runs.")]


@command(example="dyknow mission start survey.dom survey.prob --to 0")
def start(
    call: Call,
    domain: Annotated[Path, typer.Argument(metavar="DOMAIN.dom", help="Types, features, operators with commands.")],
    problem: Annotated[Path, typer.Argument(metavar="PROBLEM.prob", help="Objects, the initial state, goals.")],
    *,
    to: Annotated[
        str,
        typer.Option(metavar="U", help="The platform that leads it, else that of the first unit; of 0,1 the cheaper."),
    ] = "",
    consent: Annotated[bool, typer.Option("--consent", help="Show the plan, and ask before it is flown.")] = False,
    unit: Annotated[
        list[str] | None, typer.Option(metavar="NAME=U", help="The platform of a unit of the problem (repeatable).")
    ] = None,
    constraints: Annotated[
        Path | None, typer.Option(metavar="FILE", help="More statements of the problem: control formulas, goals.")
    ] = None,
    action: Annotated[
        list[str] | None,
        typer.Option(metavar="ACTION", help="An action that the plan must have, in this order (repeatable)."),
    ] = None,
    whole: Annotated[bool, typer.Option("--whole", help="The actions are all of the plan.")] = False,
    timeout: Annotated[str, typer.Option(metavar="TIME", help="How long to search for a plan.")] = "10s",
    name: Annotated[str, typer.Option(metavar="NAME", help="The name of the mission.")] = "",
    detach: Annotated[bool, typer.Option("--detach", "-d", help="Return when it is agreed to.")] = False,
) -> int:
    """Have platforms reach the goals of a problem; it continues when the command ends. Exit 1 if it is declined or not reached."""
    wanted = MissionRequest(
        read_text(domain),
        read_text(problem),
        "" if constraints is None else read_text(constraints),
        tuple(action or ()),
        whole,
        platforms_given(unit or ()),
        name,
        duration_us(timeout, option="--timeout", least_us=SHORTEST_US) / 1e6,
    )

    def asks(proposals: list[tuple[str, MissionProposal]]) -> bool:
        return _consented(call, proposals)

    with connected(call) as client:
        if not name:
            wanted = wanted._replace(name=name_of(problem, client.now_us()))
        dialogue = client.run(
            begin_mission(client, wanted, [one for one in to.split(",") if one], asks if consent else None)
        )
        call.out.say(
            f"mission {wanted.name}: platform {dialogue.unit} leads it", event="begun", mission=wanted.name,
            unit=unit_json(dialogue.unit), conversation=dialogue.conversation,
        )  # fmt: skip
        if detach:
            return DONE
        try:
            return _follow(call, client, dialogue, wanted.name)
        except KeyboardInterrupt:
            call.out.note(f"The mission continues; end it with: dyknow mission abort {wanted.name}")
            return INTERRUPTED


def _consented(call: Call, proposals: list[tuple[str, MissionProposal]]) -> bool:
    """Show what is proposed, the cheapest first; whether that is to be flown."""
    for unit, said in proposals:
        text = f"platform {unit} proposes {len(said.actions)} actions, {said.duration_s:g} s, cost {said.cost:g}"
        record = {"cost": said.cost, "duration_s": said.duration_s, "actions": list(said.actions)}
        call.out.say(text, event="proposed", unit=unit_json(unit), **record)
        for action in said.actions if not call.out.json_lines else ():
            call.out.show(f"  {action}")
    return typer.confirm("Fly the first?", err=True)


def _follow(call: Call, client: Client, dialogue: Dialogue, name: str) -> int:
    """Show its progress until it is over."""
    heard = 0
    with call.out.waiting(f"mission {name}") as progress:
        while True:
            client.wait_for(lambda known=heard: len(dialogue.said) > known or dialogue.over, _STEP_S)  # type: ignore[misc]
            for _, said in dialogue.said[heard:]:
                match said:
                    case Progress(step=step) if step.startswith("searching: "):
                        progress(f"mission {name}: {step}")
                    case Progress(step=step):
                        _tell(call, name, step)
                    case Done(text=text):
                        call.out.say(f"{name}: {text}", event="ended", mission=name, text=text)
                        return DONE
                    case Reason(text=text):
                        call.out.say(f"{name}: {text}", event="failed", mission=name, text=text)
                        return NO
            heard = len(dialogue.said)
            if dialogue.over and state_of(dialogue) != "running":
                raise FederationFailed(f"mission {name}: {dialogue.trouble or 'its platform is gone'}")


def _tell(call: Call, name: str, step: str) -> None:
    kind, _, text = step.partition(": ")
    call.out.say(f"{name}: {step}", event="progress", mission=name, what=kind, text=text)
    if kind == "asks" and not call.out.json_lines:
        call.out.note(f"Answer with: dyknow mission answer {name} ANSWER")


@command(example="dyknow mission status")
def status(call: Call, mission: Name = None) -> int:
    """The missions that platforms lead, how far each is, and its question; exit 1 if there is none."""
    with connected(call) as client, call.out.waiting("asking for missions"):
        found = client.run(listed_missions(client))
    chosen = [(unit, entry) for unit, entry in found if mission in {None, entry.mission}]
    for unit, entry in chosen:
        if call.out.json_lines:
            call.out.line(_record(unit, entry))
        else:
            _show(call, unit, entry)
    if not chosen and not call.out.json_lines:
        call.out.note("no platform leads a mission; begin one with dyknow mission start.")
    return DONE if chosen else NO


def _show(call: Call, unit: str, entry: MissionEntry) -> None:
    since = clock_time(entry.since_us).partition(".")[0]
    call.out.show(styled(entry.mission, "bold"), f"  {entry.phase}  on platform {unit} since {since}: {entry.why}")
    if len(entry.chain) > 1:
        call.out.show(f"  delegated by {' > '.join(entry.chain)}")
    for action in entry.actions:
        call.out.show(f"  {action}")
    asked = entry.question
    if asked is not None:
        until = clock_time(asked.until_us).partition(".")[0]
        call.out.show(f"  asks: {asked.text} ({', '.join(asked.options)}); at {until}: {asked.default}")


def _record(unit: str, entry: MissionEntry) -> dict[str, Any]:
    question = None if entry.question is None else entry.question.model_dump(mode="json")
    return {
        "mission": entry.mission, "unit": unit_json(unit), "phase": entry.phase, "since_us": entry.since_us,
        "why": entry.why, "actions": list(entry.actions), "replans": entry.replans, "chain": list(entry.chain),
        "question": question,
    }  # fmt: skip


def _control(call: Call, mission: str | None, how: str, said: str) -> int:
    with connected(call) as client:
        name = client.run(control_mission(client, mission, how))
    call.out.say(f"mission {name} {said}", event=how, mission=name)
    return DONE


@command(example="dyknow mission abort")
def abort(call: Call, mission: Name = None) -> int:
    """End a mission at each platform, whatever platform leads it: vehicles that fly for it hold where they are. Exit 1 if one does not answer."""
    with connected(call) as client:
        found = client.run(abort_mission(client, mission))
    at = ", ".join(found.ended) or "no platform"
    call.out.say(
        f"mission {found.name} is ended at {at}", event="abort", mission=found.name,
        units=[unit_json(unit) for unit in found.ended], unsure=dict(found.unsure),
    )  # fmt: skip
    for unit, why in found.unsure.items():
        call.out.note(f"platform {unit}: {why}: its vehicle may fly on; take it with: dyknow delegate hold --to {unit}")
    return DONE if not found.unsure else NO


@command(example="dyknow mission suspend")
def suspend(call: Call, mission: Name = None) -> int:
    """Have a mission wait: vehicles that fly for it hold where they are."""
    return _control(call, mission, "suspend", "waits")


@command(example="dyknow mission resume")
def resume(call: Call, mission: Name = None) -> int:
    """Have a mission continue that was suspended, with a new plan. A vehicle in its pilot's hands: dyknow delegate resume."""
    return _control(call, mission, "resume", "continues")


@command(example='dyknow mission answer "try again"')
def answer(
    call: Call,
    text: Annotated[str, typer.Argument(metavar="ANSWER", help="One of the answers that status shows.")],
    mission: Name = None,
) -> int:
    """The answer to the question of a mission."""
    with connected(call) as client:
        name = client.run(answer_question(client, mission, text))
    call.out.say(f"mission {name}: answered {text}", event="answered", mission=name, answer=text)
    return DONE
