"""Who proposes to lead a mission at no cost and does not, or a plan that cannot be, leads nothing: the next one does."""

from random import Random
from typing import Any

import pytest

from dyknow.agents.capabilities.missions.mission_texts import MissionTexts, read_mission
from dyknow.agents.capabilities.missions.proposal_checks import unbelievable
from dyknow.agents.capabilities.missions.proposing import MissionProposals
from dyknow.agents.config import PlatformConfig
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import CallForMission, MissionProposal
from dyknow.model.errors import FederationFailed, NothingFound
from dyknow.runtime.client import Client, command_centre
from dyknow.runtime.configuration.settings import Settings
from dyknow.runtime.library.missions import MissionRequest, begin_mission
from dyknow.sim_uavs.dynamics.scenarios import scenario
from dyknow.sim_uavs.dynamics.vehicles import SimulatedVehicle
from dyknow.sim_uavs.world.world import START_US
from tests.agents.capabilities.missions.flown import DOMAIN, ONE, TWO, Flown
from tests.box import Box

PLAN = ("0.0 s  fly-to(uav0, barn)", "12.0 s  fly-to(uav0, pond)", "27.3 s  land(uav0)")
ABSURD = {
    "an operator that is none": {"actions": ("0.0 s  conjure(uav0)",)},
    "an object that is none": {"actions": ("0.0 s  fly-to(uav0, moon)",)},
    "too few objects": {"actions": ("0.0 s  fly-to(uav0)",)},
    "words": {"actions": ("trust me",)},
    "shorter than its last action": {"actions": PLAN, "duration_s": 3.0},
    "no time at all": {"actions": PLAN[:1], "duration_s": 0.0},
}


def texts(problem: str = ONE) -> MissionTexts:
    return read_mission(DOMAIN, problem, "", (), is_whole=False, platforms={})


@pytest.mark.parametrize("fields", ABSURD.values(), ids=ABSURD)
def test_a_plan_that_cannot_be_is_not_believed(fields: dict[str, Any]) -> None:
    assert unbelievable(MissionProposal(**{"cost": 0.0, "duration_s": 60.0, "actions": PLAN, **fields}), texts())


@pytest.mark.parametrize("seed", range(20))
def test_a_plan_with_one_thing_wrong_is_not_believed_and_the_plan_itself_is(seed: int) -> None:
    random, plan = Random(seed), list(PLAN)
    assert unbelievable(MissionProposal(cost=96.0, duration_s=57.3, actions=PLAN), texts()) == ""
    at = random.randrange(len(plan))
    old, new = random.choice([("uav0", "uav9"), ("(", "-("), (" s  ", " s "), (")", ", barn)")])
    plan[at] = plan[at].replace(old, new)
    assert unbelievable(MissionProposal(cost=96.0, duration_s=57.3, actions=tuple(plan)), texts())


@pytest.mark.parametrize("problem", [ONE, TWO])
@pytest.mark.parametrize("airborne", [True, False])
def test_what_platforms_propose_is_believed(problem: str, airborne: bool) -> None:
    flown = Flown(2, airborne=airborne)
    dialogue = flown.world.ask(
        "cc", "0", CallForMission(mission="m1", domain=DOMAIN, problem=problem), Performative.CFP
    )
    flown.world.run_for(1.0)
    ((_, proposal),) = dialogue.said
    assert isinstance(proposal, MissionProposal)
    assert proposal.actions
    assert unbelievable(proposal, texts(problem)) == ""


def market() -> tuple[Box, Client, list[tuple[str, str]]]:
    """Two platforms whose vehicles fly, and a program that learns what is wrong with their answers."""
    box = Box()
    for unit in scenario("hover", 2, 1).units:
        name = str(unit.number)
        vehicle = SimulatedVehicle(unit.vehicle(unit.number + 1, airborne=True), START_US)
        box.add(name, PlatformConfig(name, 0, clock=box.clock, control=True, simulated=True), vehicle)
    box.run(2.0)
    client, troubles = Client(box.client_ports(), command_centre(Settings(), "cc-9")), list[tuple[str, str]]()
    client.on_trouble = lambda unit, why: troubles.append((unit, why))
    return box, client, troubles


def lies(box: Box, unit: str, **fields: Any) -> None:
    """The platform proposes that instead of a plan, and does nothing when it is taken."""
    part = box.platform(unit).part(MissionProposals)

    def on_search(act: Any, _content: Any, _texts: Any, now_us: int) -> None:
        proposal = MissionProposal(**{"cost": 0.0, "duration_s": 60.0, "actions": PLAN, **fields})
        box.platform(unit).ports.agent.answer(act, Performative.PROPOSE, proposal, now_us)

    part._search = on_search  # type: ignore[method-assign]
    box.platform(unit).part(MissionProposals)._forget = lambda _name: None  # type: ignore[method-assign]
    part._agent = _Silent(part._agent)  # type: ignore[assignment]


class _Silent:
    """An agent that does not answer."""

    def __init__(self, agent: Any) -> None:
        self._agent = agent

    def answer(self, *_what: Any) -> None:
        """Keep silent."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._agent, name)


REQUEST = MissionRequest(DOMAIN, ONE, name="m1")


@pytest.mark.parametrize("liar", ["0", "1"])
def test_one_that_wins_at_no_cost_and_flies_nothing_is_named_and_the_next_leads(liar: str) -> None:
    box, client, troubles = market()
    honest = {"0": "1", "1": "0"}[liar]
    lies(box, liar)
    dialogue = client.run(begin_mission(client, REQUEST, ["0", "1"]))
    assert dialogue.unit == honest
    assert troubles == [(liar, "it does not fly the plan that it proposed: no answer in time")]
    client.wait_for(lambda: bool(dialogue.results), 5.0)
    assert next(getattr(each, "step", "") for each in dialogue.results) == "taken: the plan is flown"


@pytest.mark.parametrize("fields", ABSURD.values(), ids=ABSURD)
def test_a_plan_that_cannot_be_is_not_taken_though_it_costs_nothing(fields: dict[str, Any]) -> None:
    box, client, troubles = market()
    lies(box, "1", **fields)
    dialogue = client.run(begin_mission(client, REQUEST, ["0", "1"]))
    assert dialogue.unit == "0"
    ((unit, why),) = troubles
    assert unit == "1"
    assert why.startswith("its proposal is not believed: ")


def test_where_no_proposal_is_kept_nothing_is_flown_and_that_is_reported() -> None:
    box, client, _ = market()
    for unit in "01":
        lies(box, unit)
    with pytest.raises(FederationFailed, match="no platform flies"):
        client.run(begin_mission(client, REQUEST, ["0", "1"]))
    for unit in "01":
        lies(box, unit, actions=("trust me",))
    with pytest.raises(NothingFound, match="trust me"):
        client.run(begin_mission(client, REQUEST._replace(name="m2"), ["0", "1"]))
