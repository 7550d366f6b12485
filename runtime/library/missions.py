"""Missions of a federation, for programs and commands: delegated, listed, answered and ended."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from dyknow.federation import keys
from dyknow.federation.members.directory import unit_order
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import (
    AnswerQuestion,
    CallForMission,
    ControlMission,
    FlyMission,
    LeaveMission,
    MissionEntry,
    MissionList,
    MissionProposal,
    MissionQuery,
    PermitMission,
    TakeMission,
    TaskOver,
)
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.model.errors import DyknowError, FederationFailed, NothingFound, Refused, WrongCall
from dyknow.runtime.client import Client, Job, Wait
from dyknow.runtime.library.jobs import GRACE_S, MOST_LEADERS, failure_of, lists, platforms

if TYPE_CHECKING:
    from dyknow.agents.capabilities.missions.mission_texts import MissionTexts

P = Performative
Consent = Callable[[list[tuple[str, MissionProposal]]], bool]
ANSWER_S: Final = 5.0
AGREE_S: Final = 15.0
"""How long a platform may take to read what is delegated, and agree."""
AGAIN_S: Final = 0.5
"""The pause before a mission is requested again where home is not known yet, within AGREE_S."""


class MissionRequest(NamedTuple):
    """A wanted mission, in one of four degrees: goals only, with constraints, with some actions, with all of them.

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
    platforms: Mapping[str, str] = MappingProxyType({})
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


def begin_mission(
    client: Client, wanted: MissionRequest, to: Sequence[str] = (), consent: Consent | None = None
) -> Job[Dialogue]:
    """Delegate a mission, its other platforms permitted to take part; returns once it is agreed to.

    Args:
        client: of a command centre.
        wanted: the mission to fly.
        to: the platform that leads it; of several, or with `consent`, the one that proposes it at the least cost. Empty: that
            of the first unit.
        consent: shown the proposals, the cheapest first; whether that is to be flown.

    Raises:
        NothingFound: a platform is not there, or none has a plan.
        TextError, TextErrors: a text is wrong, and where.
        Refused: it is declined, a platform does not permit it, or it is not consented to.
        FederationFailed: there is no answer.
    """
    from dyknow.agents.capabilities.missions.mission_texts import read_mission

    texts = read_mission(
        wanted.domain, wanted.problem, wanted.constraints, wanted.actions,
        is_whole=wanted.is_whole, platforms=wanted.platforms,
    )  # fmt: skip
    yield from platforms(client)
    taking_part = list(dict.fromkeys(texts.platforms.values()))
    leaders = [client.pick(unit)[0] for unit in to or taking_part[:1]]
    name = keys.conversation(wanted.name or name_of(Path("mission"), client.now_us()))
    content = FlyMission(
        mission=name, domain=wanted.domain, problem=wanted.problem, constraints=wanted.constraints,
        actions=wanted.actions, is_whole=wanted.is_whole, platforms=dict(texts.platforms), timeout_s=wanted.search_s,
    )  # fmt: skip
    if consent is not None or len(leaders) > 1:
        call = CallForMission(**{field: getattr(content, field) for field in type(content).model_fields})
        return (yield from _called(client, call, texts, leaders, consent or (lambda _proposals: True)))
    yield from _permit(client, name, leaders[0], taking_part)
    return (yield from agreed(client, leaders[0], content))


def agreed(client: Client, leader: str, content: FlyMission) -> Job[Dialogue]:
    """Request a mission until it is agreed to; it is requested again while home is not known yet.

    Raises:
        Refused, ContentError, FederationFailed: as `begin_mission`.
    """
    until_us = client.now_us() + round(AGREE_S * 1e6)
    while True:
        dialogue = client.say(leader, P.REQUEST, content, within_s=AGREE_S, standing=True)
        client.centre.follow(dialogue, content.mission)
        yield Wait(lambda one=dialogue: bool(one.said or one.over), AGREE_S + GRACE_S)  # type: ignore[misc]
        if dialogue.trouble is None and dialogue.said:
            return dialogue
        failure = failure_of(dialogue, "no answer in time")
        if not _is_starting(failure) or client.now_us() >= until_us:
            raise failure
        yield Wait(lambda: False, AGAIN_S)


def _is_starting(failure: DyknowError) -> bool:
    """Whether the platform does not yet know its vehicle's home: one that has just started soon does."""
    return isinstance(failure, Refused) and failure.code == "no-origin"


def _permit(client: Client, mission: str, leader: str, taking_part: Sequence[str]) -> Job[None]:
    """Permit its leader, and then those that succeed it in their order, the vehicles of the others.

    A platform without a vehicle passes the mission on to the first that takes part.
    """
    first = dict.fromkeys((leader,) if leader in taking_part else (leader, *taking_part[:1]))
    leaders = tuple(dict.fromkeys((*first, *sorted(taking_part, key=unit_order))))[:MOST_LEADERS]
    permit = PermitMission(mission=mission, leaders=leaders, vehicles=tuple(taking_part))
    for platform in taking_part:
        if set(leaders) - {platform}:
            yield from _asked(client, client.pick(platform)[0], permit)


def mission_of(
    client: Client, domain: str, problem: str, to: str | int | None, given: Mapping[str, Any]
) -> Job[Dialogue]:
    """The same from the fields of a `MissionRequest`; `to` may name several platforms, `0,1`."""
    return begin_mission(client, MissionRequest(domain, problem, **given), [] if to is None else str(to).split(","))


def _called(
    client: Client, call: CallForMission, texts: "MissionTexts", leaders: Sequence[str], consent: Consent
) -> Job[Dialogue]:
    """The contract net: the cheapest proposal that can be is taken, the next if it is not kept, and the others are left."""
    from dyknow.agents.capabilities.missions.proposal_checks import unbelievable

    within_s = AGREE_S + call.timeout_s
    calls = [client.say(unit, P.CFP, call, within_s=within_s, standing=True) for unit in leaders]
    yield Wait(lambda: all(one.said or one.over for one in calls), within_s + GRACE_S)
    found, reasons = list[tuple[Dialogue, MissionProposal]](), list[str]()
    for one in calls:
        said = next((each for _, each in one.said if isinstance(each, MissionProposal)), None)
        why = (one.trouble or "no answer in time") if said is None else unbelievable(said, texts)
        if why:
            reasons.append(f"platform {one.unit}: {why}")
        if said is not None and why:
            client.on_trouble(one.unit, f"its proposal is not believed: {why}")
            client.decide(one, P.REJECT_PROPOSAL, LeaveMission(because=why))
        elif said is not None:
            found.append((one, said))
    found.sort(key=lambda each: (len(each[1].unreached), each[1].cost, each[1].duration_s))
    if not found:
        raise NothingFound(f"no platform proposes a plan: {'; '.join(reasons)}")
    is_wanted = consent([(one.unit, proposal) for one, proposal in found])
    taken = (yield from _taken(client, call, texts, [one for one, _ in found])) if is_wanted else None
    for one, _ in found:
        if not one.over and one is not taken:
            because = "it is not consented to" if not is_wanted else "another one is taken"
            client.decide(one, P.REJECT_PROPOSAL, LeaveMission(because=because))
    if not is_wanted:
        raise Refused("the plan is not consented to: nothing is flown", "no-consent")
    if taken is None:
        raise FederationFailed("no platform flies the plan that it proposed")
    return taken


def _taken(
    client: Client, call: CallForMission, texts: "MissionTexts", found: Sequence[Dialogue]
) -> Job[Dialogue | None]:
    """Take the first that says it flies its plan; those before it have not kept what they proposed."""
    for one in found:
        yield from _permit(client, call.mission, one.unit, list(dict.fromkeys(texts.platforms.values())))
        heard = len(one.said)
        client.decide(one, P.ACCEPT_PROPOSAL, TakeMission())
        yield Wait(lambda one=one, heard=heard: len(one.said) > heard or one.over, ANSWER_S)  # type: ignore[misc]
        if not one.over and len(one.said) > heard:
            del one.said[:heard]
            client.centre.follow(one, call.mission)
            return one
        client.on_trouble(one.unit, f"it does not fly the plan that it proposed: {one.trouble or 'no answer in time'}")
        if not one.over:
            client.cancel(one.unit, one.conversation)
            one.over = True
    return None


def _asked(client: Client, unit: str, content: PermitMission | ControlMission | AnswerQuestion) -> Job[None]:
    dialogue = client.say(unit, P.REQUEST, content, within_s=ANSWER_S)
    yield Wait(lambda: dialogue.over or bool(dialogue.results), ANSWER_S + GRACE_S)
    if dialogue.trouble is not None or not dialogue.said:
        raise failure_of(dialogue, "no answer in time")


def listed_missions(client: Client) -> Job[list[tuple[str, MissionEntry]]]:
    """The missions of all platforms, each with the platform that leads it; ended ones come last."""
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


class AbortedMission(NamedTuple):
    """The result of aborting a mission: where it is over, and why it may continue elsewhere, by platform."""

    name: str
    ended: tuple[str, ...]
    unsure: Mapping[str, str]


def abort_mission(client: Client, name: str | None) -> Job[AbortedMission]:
    """End a mission at each platform, though its leader may not answer: vehicles that fly for it hold.

    Raises:
        NothingFound: no platform lists a mission of that name, and no vehicle shows that it flies for it.
        WrongCall: several run, and none is named.
    """
    try:
        _, entry = yield from find_mission(client, name)
        name = entry.mission
    except NothingFound:
        if name is None or not any(_flies_for(client, unit, name) for unit in client.pick(None)):
            raise
    over, units = TaskOver(task=name), client.pick(None)
    asked = [client.say(unit, P.REQUEST, over, within_s=ANSWER_S) for unit in units]
    yield Wait(lambda: all(one.over or bool(one.results) for one in asked), ANSWER_S + GRACE_S)
    unsure = {one.unit: one.trouble or "no answer in time" for one in asked if not one.results}
    return AbortedMission(name, tuple(one.unit for one in asked if one.results), unsure)


def _flies_for(client: Client, unit: str, mission: str) -> bool:
    entry = client.centre.member.directory.entry(unit)
    return entry is not None and any(each.text.startswith(f"mission {mission},") for each in entry.conditions)


def control_mission(client: Client, name: str | None, how: str) -> Job[str]:
    """`suspend` or `resume` a mission; returns its name."""
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
