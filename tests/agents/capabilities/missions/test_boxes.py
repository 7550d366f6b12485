"""A box is delivered by a mission: the winch and the magnet are commanded, what hangs on the line tells the rest, and a box that
was dropped is looked for by sight."""

from collections.abc import Sequence
from dataclasses import replace
from math import hypot
from pathlib import Path
from typing import Any

import pytest

from dyknow.agents.config import PlatformConfig
from dyknow.agents.places import FlightLimits
from dyknow.federation.messages.contents import AnswerQuestion, Attend, FlyMission, Resume
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.navigation.vehicle import Report
from dyknow.planning import parse_domain
from dyknow.sim_uavs.boxes.handled import Placed
from dyknow.sim_uavs.boxes.shared import BoxesOnGround, HandlingList
from dyknow.sim_uavs.cameras.onboard import OnboardCameras
from dyknow.sim_uavs.depot import boxes_of, hoist_of, loader
from dyknow.sim_uavs.dynamics.faults import ScheduledFault, SimulatedFault
from dyknow.sim_uavs.dynamics.scenarios import scenario
from dyknow.sim_uavs.streets import watching
from dyknow.sim_uavs.world.world import START_US, World
from tests.agents.capabilities.missions.flown import Noting, is_over, told

EXAMPLES = Path(__file__).parents[4] / "examples" / "logistics"
DOMAIN = (EXAMPLES / "logistics.dom").read_text("utf-8")
PROBLEM, CARRIER = ((EXAMPLES / f"{name}.prob").read_text("utf-8") for name in ("one", "carrier"))
IMAGE_US = 200_000


class Seeing(Noting):
    """Reports images of its cameras, too."""

    def __init__(self, onboard: OnboardCameras, *given: Any) -> None:
        super().__init__(*given)
        self._onboard, self._image_us = onboard, 0
        self.sees_boxes = True

    def on_time(self, now_us: int, stamp_us: int) -> Sequence[Report]:
        found = list(super().on_time(now_us, stamp_us))
        looking = self.looking(now_us) if now_us >= self._image_us + IMAGE_US else None
        if looking is not None:
            self._image_us = now_us
            image = self._onboard.image(stamp_us, *looking)
            found += [] if image is None else [image if self.sees_boxes else image._replace(detections=())]
        return found


class Depot:
    """Platforms of the scenario `logistics`, which are to deliver one box."""

    def __init__(
        self, seed: int = 2, problem: str = PROBLEM, faults: tuple[ScheduledFault, ...] = (), uavs: int = 1
    ) -> None:
        situation = scenario("logistics", uavs, seed)
        assert situation.depot is not None
        self.problem, self.boxes = problem, boxes_of(situation, seed, HandlingList())
        self.world = World(1, truth_us=None)
        self.vehicles = []
        for unit in situation.units:
            onboard, rig = watching(situation, unit, seed, BoxesOnGround(self.boxes))
            flown = replace(loader(unit.vehicle(1), situation.depot), faults=faults)
            vehicle = Seeing(onboard, flown, START_US)
            vehicle.carry(hoist_of(situation, unit, seed, self.boxes))
            limits = FlightLimits(2.0, 120.0, 1000.0)
            config = PlatformConfig(str(unit.number), 1, control=True, simulated=True, cameras=rig, limits=limits)
            self.world.add(str(unit.number), config, vehicle)
            self.vehicles.append(vehicle)
        self.vehicle = self.vehicles[0]
        self.world.add_command_centre("cc")
        self.world.run_for(2.0)

    @property
    def box(self) -> Placed:
        return self.thing("b1")

    def thing(self, name: str) -> Placed:
        return next(each for each in self.boxes.at(self.world.now_us) if each.thing.name == name)

    def begin(self) -> Dialogue:
        return self.world.ask("cc", "0", FlyMission(mission="m1", domain=DOMAIN, problem=self.problem))

    def until(self, dialogue: Dialogue, text: str = "", within_s: int = 300) -> None:
        for _ in range(within_s * 2):
            if any(text in each for each in told(dialogue)) if text else is_over(dialogue):
                return
            self.world.run_for(0.5)
        raise AssertionError(f"not within {within_s} s: {told(dialogue)}")

    def drop(self, dialogue: Dialogue) -> None:
        """Let the box fall while it is brought to its goal."""
        self.until(dialogue, "started: fly-box-to-goal")
        self.world.run_for(1.5)
        self.world.inject("0", "dropped-box", 1_000_000)
        self.until(dialogue, "looking for b1")

    def is_delivered(self) -> bool:
        return self.box.holder is None and hypot(self.box.place[0] - 30.0, self.box.place[1] - 20.0) < 3.0


def test_a_box_that_comes_down_elsewhere_is_seen_there_and_delivered_again() -> None:
    depot = Depot(faults=(ScheduledFault(SimulatedFault("misplaced-box", 8.0), 0, "load", 30 * 1_000_000),))
    dialogue = depot.begin()
    depot.until(dialogue, "fault: ")
    assert not depot.is_delivered()
    (fault,) = [each for each in told(dialogue) if each.startswith("fault: ")]
    assert fault.startswith("fault: operator of detach-box(uav0, b1) is violated") and "; misplaced, time 1" in fault
    depot.until(dialogue)
    lines = told(dialogue)
    assert lines[-1].startswith("inform: reached"), lines
    assert len([each for each in lines if each.startswith("seen: ")]) == 2 and depot.is_delivered()


OPERATORS = {one.name for one in parse_domain(DOMAIN).operators}
ONE_ON_CARRIER = (
    CARRIER.replace("b1 .. b2", "b1 .. b1")
    .replace("#init xpos(b2) := 4.0, ypos(b2) := 0.0, goal-x(b2) := -20.0, goal-y(b2) := 450.0\n", "")
    .replace(", colour(b2) := blue", "")
)


def flown_on_carrier(problem: str, seed: int) -> tuple[Depot, list[str]]:
    depot = Depot(seed, problem)
    dialogue = depot.begin()
    depot.until(dialogue, within_s=500)
    lines = told(dialogue)
    assert lines[-1].startswith("inform"), lines
    assert {each.split("started: ")[1].partition("(")[0] for each in lines if "started: " in each} == OPERATORS
    return depot, lines


def test_all_thirteen_operators_are_flown_with_a_box_on_a_carrier() -> None:
    depot, _ = flown_on_carrier(ONE_ON_CARRIER, 1)
    assert hypot(depot.box.place[0] - 20.0, depot.box.place[1] - 450.0) < 3.0
    assert (depot.box.on, depot.box.holder) == (None, None)
    carrier = depot.thing("c1")
    assert hypot(carrier.place[0], carrier.place[1] - 440.0) < 3.0


@pytest.mark.full
@pytest.mark.parametrize("seed", range(1, 13))
def test_two_boxes_are_delivered_on_a_carrier_that_the_magnet_may_take_instead_of_them(seed: int) -> None:
    depot, lines = flown_on_carrier(CARRIER, seed)
    for name, x_m in (("b1", 20.0), ("b2", -20.0)):
        box = depot.thing(name)
        assert hypot(box.place[0] - x_m, box.place[1] - 450.0) < 3.0 and box.on is None, (name, box, lines)
    assert all("wrong-cargo" in each for each in lines if each.startswith("fault: ")), lines


@pytest.mark.full
def test_two_uavs_load_one_carrier_in_turn_and_bring_the_boxes_to_their_goals() -> None:
    both = CARRIER.replace("uav0 .. uav0", "uav0 .. uav1").replace(
        "ypos(uav0) := -10.0", "ypos(uav0) := -10.0, xpos(uav1) := -50.0, ypos(uav1) := -10.0"
    )
    depot = Depot(1, both, uavs=2)
    dialogue = depot.begin()
    depot.until(dialogue, within_s=600)
    lines = told(dialogue)
    assert lines[-1].startswith("inform: reached"), lines
    assert {each.partition("started: ")[2][-5:-1] for each in lines if "started: climb-for-flying-e" in each} == {
        "uav0",
        "uav1",
    }
    assert lines.index("ended: detach-box(uav0, b1)") < lines.index("started: fly-box-to-carrier(uav1, b2, c1)")
    for name, x_m in (("b1", 20.0), ("b2", -20.0)):
        assert hypot(depot.thing(name).place[0] - x_m, depot.thing(name).place[1] - 450.0) < 3.0, lines


def test_a_box_that_was_dropped_on_its_way_is_found_by_sight_and_delivered() -> None:
    depot = Depot()
    depot.world.ask("cc", "0", Attend())
    dialogue = depot.begin()
    depot.drop(dialogue)
    depot.until(dialogue, "found: ")
    lies, (found,) = depot.box, [each for each in told(dialogue) if each.startswith("found: ")]
    x_m, y_m = (float(each.partition(" = ")[2]) for each in found.split(", "))
    assert hypot(lies.place[0] - 30.0, lies.place[1] - 20.0) > 5.0
    assert hypot(x_m - lies.place[0], y_m - lies.place[1]) < 1.0
    depot.until(dialogue)
    assert told(dialogue)[-1].startswith("inform"), told(dialogue)
    assert depot.is_delivered()


def test_a_search_waits_while_the_pilot_has_the_vehicle_and_goes_on_afterwards() -> None:
    depot = Depot()
    dialogue = depot.begin()
    depot.drop(dialogue)
    depot.world.inject("0", "takeover", 10_000_000)
    depot.until(dialogue, "waits: waiting for the pilot")
    sent = len(depot.vehicle.commands)
    depot.world.run_for(12.0)
    assert len(depot.vehicle.commands) == sent and not any(each.startswith("found: ") for each in told(dialogue))
    depot.world.ask("cc", "0", Resume())
    depot.until(dialogue)
    assert told(dialogue)[-1].startswith("inform"), told(dialogue)
    assert depot.is_delivered()


def test_a_box_that_is_not_seen_becomes_a_question_that_says_how_much_was_looked_at() -> None:
    depot = Depot()
    dialogue = depot.begin()
    depot.vehicle.sees_boxes = False
    depot.drop(dialogue)
    depot.until(dialogue, "asks: ", within_s=110)
    (asked,) = [each for each in told(dialogue) if each.startswith("asks: ")]
    assert asked.startswith("asks: b1 was not found from 9 places: 100% of where it can lie was in view"), asked
    depot.vehicle.sees_boxes = True
    depot.world.ask("cc", "0", AnswerQuestion(mission="m1", number=1, answer="try again"))
    depot.until(dialogue)
    assert depot.is_delivered(), told(dialogue)
