"""Missions of a federation, for programs and commands: delegated, listed, answered and ended."""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from dyknow.model.errors import NothingFound, Refused, WrongCall
from federation import keys
from federation.messages.acts import Performative
from federation.messages.contents import (
    AnswerQuestion,
    ControlMission,
    FlyMission,
    MissionEntry,
    MissionList,
    MissionQuery,
    PermitMission,
)
from federation.messages.dialogue import Dialogue
from runtime.client import Client, Job, Wait
from runtime.library.jobs import GRACE_S, failure_of, lists, platforms

P = Performative
ANSWER_S: Final = 5.0
AGREE_S: Final = 15.0
"""How long a platform may take to read what is delegated, and agree."""


class MissionRequest(NamedTuple):
    """What is to be flown, in one of four degrees: goals only, with constraints, with some actions, with all of them.

    Attributes:
        name: of the mission; empty: one is made.
        platforms: by unit of the problem, its platform, where the names do not say it.
        search_s: how long a search for a plan may take.
    """

    domain: str
    problem: str
    constraints: str = ""
    actions: tuple[str, ...] = ()
    is_whole: bool = False
    platforms: Mapping[str, str] = {}
    name: str = ""
    search_s: float = 10.0


def platforms_given(pairs: Sequence[str]) -> dict[str, str]:
    """`uav1=0` and the like; raises WrongCall."""
    found = {}
    for pair in pairs:
        unit, equals, platform = pair.partition("=")
        if not (unit and equals and platform):
            raise WrongCall(f"--unit: {pair!r}: write UNIT=PLATFORM, uav1=0.")
        found[unit] = platform
    return found


def name_of(file: Path, now_us: int) -> str:
    """A name for a mission over the problem of a file."""
    stem = "".join(one if one.isalnum() else "-" for one in file.stem.lower())[:24].strip("-") or "mission"
    return f"{stem}-{now_us // 100_000 % 0x10000:04x}"


def begin_mission(client: Client, wanted: MissionRequest, to: str | None) -> Job[Dialogue]:
    """Delegate a mission, its other platforms permitted to take part; returns once it is agreed to.

    Raises:
        NothingFound: a platform is not there.
        TextError, TextErrors: a text is wrong, and where.
        Refused: it is declined, or a platform does not permit it.
        FederationFailed: there is no answer.
    """
    from agents.missions.mission_texts import read_mission

    texts = read_mission(
        wanted.domain, wanted.problem, wanted.constraints, wanted.actions,
        is_whole=wanted.is_whole, platforms=wanted.platforms,
    )  # fmt: skip
    yield from platforms(client)
    taking_part = list(dict.fromkeys(texts.platforms.values()))
    leader = client.pick(to or taking_part[0])[0]
    name = wanted.name or name_of(Path("mission"), time.time_ns() // 1000)
    keys.conversation(name)
    for platform in taking_part:
        if platform != leader:
            yield from _asked(client, client.pick(platform)[0], PermitMission(mission=name, leaders=(leader,)))
    content = FlyMission(
        mission=name, domain=wanted.domain, problem=wanted.problem, constraints=wanted.constraints,
        actions=wanted.actions, is_whole=wanted.is_whole, platforms=dict(texts.platforms), timeout_s=wanted.search_s,
    )  # fmt: skip
    dialogue = client.say(leader, P.REQUEST, content, within_s=AGREE_S, standing=True)
    yield Wait(lambda: bool(dialogue.said or dialogue.over), AGREE_S + GRACE_S)
    if dialogue.trouble is not None or not dialogue.said:
        raise failure_of(dialogue, "no answer in time")
    return dialogue


def _asked(client: Client, unit: str, content: PermitMission | ControlMission | AnswerQuestion) -> Job[None]:
    dialogue = client.say(unit, P.REQUEST, content, within_s=ANSWER_S)
    yield Wait(lambda: dialogue.over or bool(dialogue.results), ANSWER_S + GRACE_S)
    if dialogue.trouble is not None or not dialogue.said:
        raise failure_of(dialogue, "no answer in time")


def listed_missions(client: Client) -> Job[list[tuple[str, MissionEntry]]]:
    """The missions of all platforms, each with the platform that leads it; those that are over come last."""
    yield from platforms(client)
    leading = [unit for unit in client.pick(None) if _leads(client, unit)]
    found = yield from lists(client, leading, MissionQuery(), MissionList)
    entries = [(unit, entry) for unit, said in found for entry in said.missions]
    return sorted(entries, key=lambda each: each[1].phase == "ended")


def _leads(client: Client, unit: str) -> bool:
    entry = client.centre.member.directory.entry(unit)
    return entry is not None and any(service.service == "flight" for service in entry.services)


def find_mission(client: Client, name: str | None) -> Job[tuple[str, MissionEntry]]:
    """The mission of that name, or the only one that runs; raises NothingFound, WrongCall."""
    found = yield from listed_missions(client)
    running = [each for each in found if each[1].phase != "ended"]
    named = [each for each in found if each[1].mission == name] if name else running
    if not named:
        known = ", ".join(entry.mission for _, entry in found) or "none"
        raise NothingFound(f"no mission {name or 'runs'}; missions are: {known}.")
    if len(named) > 1:
        raise WrongCall(f"several missions run: {', '.join(entry.mission for _, entry in named)}; name one.")
    return named[0]


def control_mission(client: Client, name: str | None, how: str) -> Job[str]:
    """`suspend`, `resume` or `abort` a mission; returns its name."""
    unit, entry = yield from find_mission(client, name)
    yield from _asked(client, unit, ControlMission.model_validate({"mission": entry.mission, "how": how}))
    return entry.mission


def answer_question(client: Client, name: str | None, answer: str) -> Job[str]:
    """Answer the open question of a mission; returns its name. Raises Refused: there is none, or that is no answer."""
    unit, entry = yield from find_mission(client, name)
    if entry.question is None:
        raise Refused(f"mission {entry.mission} asks nothing", "no-question")
    content = AnswerQuestion(mission=entry.mission, number=entry.question.number, answer=answer)
    yield from _asked(client, unit, content)
    return entry.mission
