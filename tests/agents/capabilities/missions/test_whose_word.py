"""A mission flies by the word of the command centre that permitted it: never after that ended it, held it, or named others.

Hostile are members with valid keys, by the acts that missions consist of.
"""

from collections.abc import Iterator

import pytest

from dyknow.agents.capabilities.missions.leading import MissionLeading
from dyknow.agents.capabilities.missions.performing import Performing
from dyknow.agents.config import PlatformConfig
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import (
    CallForMission,
    CommandEntry,
    Content,
    FlyMission,
    Hold,
    JoinMission,
    KeepMission,
    PerformCommands,
    PermitMission,
    Query,
    Resume,
    TakeMission,
    TaskOver,
)
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.federation.security.trust import Role, Roster, RosterMember, Signer, Trust
from dyknow.sim_uavs.dynamics.scenarios import scenario
from dyknow.sim_uavs.world.world import START_US, World
from tests.agents.capabilities.missions.flown import DOMAIN, ONE, Noting

P = Performative
ROLES: dict[str, Role] = {"0": "uav", "1": "uav", "2": "uav", "cc": "command-centre"}
GO = PerformCommands(
    mission="m1", step=1, action="flies", commands=(CommandEntry(name="goto", numbers=(58.001, 15.0, 60.0)),)
)


def trust(unit: str) -> Trust:
    signers = {each: Signer(each.encode().ljust(32, b"."), "default") for each in ROLES}
    roster = Roster({each: RosterMember(each, signers[each].public_key, ROLES[each]) for each in ROLES})
    return Trust.of(roster, unit.encode().ljust(32, b"."), "default", START_US - 1_000_000)


class Flight:
    """Three UAVs in the air, a command centre, and what vehicle 0 was sent."""

    def __init__(self) -> None:
        self.world, self.vehicles = World(1, truth_us=None), dict[str, Noting]()
        for unit in scenario("hover", 3, 1).units:
            name = str(unit.number)
            self.vehicles[name] = Noting(unit.vehicle(unit.number + 1, airborne=True), START_US)
            config = PlatformConfig(name, 1, control=True, simulated=True, trust=trust(name))
            self.world.add(name, config, self.vehicles[name])
        self.world.add_command_centre("cc", trust=trust("cc"))
        self.world.run_for(2.0)

    def ask(self, by: str, to: str, content: Content, how: Performative = P.REQUEST, for_s: float = 0.5) -> Dialogue:
        asked = self.world.ask(by, to, content, how, within_us=60_000_000)
        self.world.run_for(for_s)
        return asked

    def permit(self, *leaders: str) -> None:
        for unit in "01":
            self.ask("cc", unit, PermitMission(mission="m1", leaders=leaders, vehicles=("0", "1")))

    def join(self, by: str) -> str:
        return self.ask(by, "0", JoinMission(mission="m1")).conversation

    @property
    def performing(self) -> Performing:
        return self.world.platform("0").part(Performing)

    def commands(self) -> int:
        return len(self.vehicles["0"].commands)


@pytest.fixture
def flight() -> Iterator[Flight]:
    yield Flight()


def codes(dialogue: Dialogue) -> list[str]:
    return [getattr(said, "code", None) or str(act.performative) for act, said in dialogue.said]


def test_a_hold_of_the_centre_stays_though_the_leader_gives_the_vehicle_back_and_takes_it_again(flight: Flight) -> None:
    flight.permit("1")
    joined = flight.join("1")
    permit = flight.performing.permits.of("m1", flight.world.now_us)
    assert permit is not None
    flight.ask("cc", "0", Hold())
    flight.world.speak("1", lambda member, now_us: member.acts.cancel("0", joined, now_us))
    flight.world.run_for(1.0)
    assert not flight.performing.mission
    sent, again = flight.commands(), JoinMission(mission="m1")
    flight.world.speak("1", lambda member, now_us: member.acts.ask("0", again, now_us, evidence=permit.payload))
    flight.world.run_for(1.0)
    assert flight.performing.leader == "1"
    assert flight.performing.waits.startswith("a user ordered")
    flight.ask("1", "0", GO, for_s=3.0)
    assert flight.commands() == sent


def test_a_proposal_of_a_mission_that_the_centre_has_ended_is_not_flown(flight: Flight) -> None:
    flight.permit("1")
    call = flight.ask("1", "0", CallForMission(mission="m1", domain=DOMAIN, problem=ONE), P.CFP, for_s=3.0)
    assert codes(call)[-1] == str(P.PROPOSE)
    for unit in "01":
        flight.ask("cc", unit, TaskOver(task="m1"))
    sent = flight.commands()
    flight.world.speak(
        "1", lambda member, now_us: member.acts.decide("0", call.conversation, P.ACCEPT_PROPOSAL, TakeMission(), now_us)
    )
    flight.world.run_for(5.0)
    assert codes(call)[-1] == "failure"
    assert flight.commands() == sent
    assert not flight.world.platform("0").part(MissionLeading).led


@pytest.mark.parametrize("gives_back", [False, True])
@pytest.mark.parametrize("delegator", ["2", "cc"])
@pytest.mark.parametrize("leaders", [("1",), ("1", "2"), ("1", "0")])
def test_only_a_platform_that_the_permit_names_succeeds_a_leader_and_for_the_one_who_permitted(
    flight: Flight, leaders: tuple[str, ...], delegator: str, gives_back: bool
) -> None:
    flight.permit(*leaders)
    joined = flight.join("1")
    kept = KeepMission(
        mission="m1", delegator=delegator, conversation="x-1", problem=ONE, domain=DOMAIN, platforms={"uav0": "0"}
    )
    flight.world.speak("1", lambda member, now_us: member.acts.tell("0", kept, now_us))
    flight.world.run_for(0.5)
    if gives_back:
        flight.world.speak("1", lambda member, now_us: member.acts.cancel("0", joined, now_us))
        flight.world.run_for(0.5)
    sent = flight.commands()
    flight.world.kill("1")
    flight.world.run_for(25.0)
    may = "0" in leaders and delegator == "cc" and not gives_back
    assert list(flight.world.platform("0").part(MissionLeading).led) == (["m1"] if may else [])
    assert may or not [each for _, each in flight.vehicles["0"].commands[sent:] if "GoTo" in type(each).__name__]


@pytest.mark.parametrize("has_run_out", [False, True])
def test_what_a_successor_has_flown_ends_when_the_one_before_it_is_back(flight: Flight, has_run_out: bool) -> None:
    flight.permit("1", "2")
    flight.world.partition("1", ("0", "2", "cc"))
    flight.world.run_for(4.0)
    flight.ask("2", "0", FlyMission(mission="m1", domain=DOMAIN, problem=ONE), for_s=4.0)
    assert flight.performing.leader == "0"
    if has_run_out:
        flight.performing.permits.end("m1")  # as an hour later
    flight.world.heal("1", ("0", "2", "cc"))
    flight.world.run_for(10.0)
    assert not flight.performing.mission
    if has_run_out:
        return
    assert codes(flight.ask("1", "0", JoinMission(mission="m1")))[-1] == "inform"


def test_a_successor_stays_no_leader_when_the_permit_has_run_out(flight: Flight) -> None:
    flight.permit("1", "2")
    flight.world.partition("1", ("0", "2", "cc"))
    flight.world.run_for(4.0)
    flight.join("2")
    assert flight.performing.leader == "2"
    flight.performing.permits.end("m1")  # as an hour later
    flight.world.heal("1", ("0", "2", "cc"))
    flight.world.run_for(4.0)
    assert codes(flight.ask("2", "0", GO))[-1] in {"succession", "role"}


@pytest.mark.parametrize("by", ["2", "cc"])
def test_who_asks_in_the_conversation_of_a_leader_and_leaves_frees_no_vehicle(flight: Flight, by: str) -> None:
    flight.permit("1")
    joined = flight.join("1")

    def ask(member: object, now_us: int) -> None:
        content = Query(semantic_label="battery", scope="global")
        member.acts.ask("0", content, now_us, performative=P.QUERY_REF, conversation=joined)  # type: ignore[attr-defined]

    flight.world.speak(by, ask)
    flight.world.run_for(0.05)
    flight.world.kill(by)
    flight.world.run_for(6.0)
    assert flight.performing.leader == "1"


def test_a_user_who_resumes_lets_a_mission_fly_that_joins_later(flight: Flight) -> None:
    flight.permit("1")
    joined = flight.join("1")
    flight.ask("cc", "0", Hold())
    flight.world.speak("1", lambda member, now_us: member.acts.cancel("0", joined, now_us))
    flight.world.run_for(0.5)
    flight.ask("cc", "0", Resume())
    flight.permit("1")
    flight.join("1")
    assert not flight.performing.waits
