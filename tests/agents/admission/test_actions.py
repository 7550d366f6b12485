"""The table of actions is what platforms do: every content, every role, every way, generated from the table itself."""

import pytest

from dyknow.agents.actions import COMMON_ANSWERS, QUERIED, Action, Role
from dyknow.agents.capabilities.missions.relaying import MissionRelay
from dyknow.agents.extensions import own_parts
from dyknow.federation.members.offers import Service, Visibility
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.codec import encode_act
from dyknow.federation.messages.contents import Content, Hold, parts, read
from dyknow.navigation.cameras.rig import CameraRig
from dyknow.navigation.geodesy import LocalFrame
from tests.agents.admission.test_hostile import signer, trust
from tests.box import Box
from tests.federation.expressions import parse_expr
from tests.federation.messages.test_contents import TEXTS

P = Performative
WITH_VEHICLE = [part for part in own_parts() if part is not MissionRelay]
"""A relay takes what the leading of missions does, on platforms that have no vehicle to lead with."""
ACTIONS = [(offer.service, action) for part in WITH_VEHICLE for offer in part.offers for action in offer.actions]
IDS = [action.head for _, action in ACTIONS]
ROLES = {"eye": Role.OBSERVER, "1": Role.DELEGATE, "cc": Role.COMMAND_CENTRE}


def own(kind: type[Content]) -> bool:
    return kind.__module__.startswith("dyknow.federation.")


def test_every_content_is_an_action_of_one_part_or_an_answer() -> None:
    handled = [action.content for _, action in ACTIONS]
    answers = {kind for part in own_parts() for kind in part.answers} | set(COMMON_ANSWERS)
    assert len(handled) == len(set(handled))
    kinds = set(parts._CONTENTS.values())
    assert {kind for kind in kinds if own(kind)} == set(handled) | answers
    assert not answers & set(handled)


def test_every_action_has_a_handler() -> None:
    for part in own_parts():
        for offer in part.offers:
            for action in offer.actions:
                assert callable(getattr(part, action.handler)), f"{part.__name__}.{action.handler}"


@pytest.fixture(scope="module")
def roster() -> Box:
    """0 has every service; cc commands, 1 is a platform, eye observes."""
    wire = Box()
    rig = CameraRig({}, LocalFrame(58.4, 15.6, 0.0))
    wire.join("0", simulated=True, control=True, cameras=rig, trust=trust("0"))
    wire.join("1", trust=trust("1"))
    for unit in ("cc", "eye"):
        wire.centre(unit, trust=trust(unit))
    wire.run(1.0)
    return wire


def example(action: Action) -> Content:
    return next(read(parse_expr(text)) for text in TEXTS if parse_expr(text).head == action.head)


def denied(wire: Box, by: str, agent: str, action: Action) -> str | None:
    """By which code the door refuses it; None if it gets through to the part."""
    platform = wire.platform("0")
    before = dict(platform.ports.agent.audit_log.counts)
    performative = P.QUERY_REF if action.performatives == QUERIED else next(iter(action.performatives))
    number = next(wire.numbers)
    boot = wire.member(by).boot
    act = Act(
        performative, AgentName("interface", by), AgentName(agent, "0"), example(action).expr(),
        conversation_id=f"{by}-{boot + 1:x}-{number}", boot=boot + 1, seq=number, created_us=wire.now_us,
    )  # fmt: skip
    wire.put(act.key, encode_act(act, signer(by)))
    wire.run(0.2)
    after = platform.ports.agent.audit_log.counts
    changed = {name for name, n in after.items() if n != before.get(name, 0) and name[0] == "in"}
    codes = {name[1] for name in changed} & {"role", "protected"}
    return next(iter(codes), None)


@pytest.mark.parametrize(("service", "action"), ACTIONS, ids=IDS)
@pytest.mark.parametrize("by", list(ROLES))
@pytest.mark.parametrize("way", ["directly", "through the interface"])
def test_the_answer_is_what_the_action_says(roster: Box, service: Service, action: Action, by: str, way: str) -> None:
    through = way != "directly"
    agent = "interface" if through else service.agent
    if service.visibility is Visibility.PROTECTED and not through:
        expected: str | None = "protected"
    else:
        expected = None if ROLES[by] >= action.role else "role"
    assert denied(roster, by, agent, action) == expected


def test_hold_is_typed_and_commands() -> None:
    (hold,) = [action for _, action in ACTIONS if action.content is Hold]
    assert (hold.typed, hold.role, hold.lasting) == (True, Role.COMMAND_CENTRE, False)
