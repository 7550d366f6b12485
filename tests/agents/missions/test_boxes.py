"""A box is delivered by a mission: the winch and the magnet are commanded, and what hangs on the line tells the rest."""

from math import hypot
from pathlib import Path

from agents.config import PlatformConfig
from agents.flight.places import FlightLimits
from federation.messages.contents import FlyMission
from sim_uavs.boxes.shared import BoxesOnGround, HandlingList
from sim_uavs.depot import boxes_of, hoist_of, loader
from sim_uavs.dynamics.scenarios import scenario
from sim_uavs.streets import watching
from sim_uavs.world.world import START_US, World
from tests.agents.missions.flown import Noting, is_over, told

EXAMPLES = Path(__file__).parents[3] / "examples" / "logistics"
DOMAIN = (EXAMPLES / "logistics.dom").read_text("utf-8")
PROBLEM = (EXAMPLES / "one.prob").read_text("utf-8")


def test_a_box_is_taken_and_put_down_near_its_goal() -> None:
    situation = scenario("logistics", 1, 2)
    assert situation.depot is not None
    unit = situation.units[0]
    boxes = boxes_of(situation, 2, HandlingList())
    world = World(1, truth_us=None)
    vehicle = Noting(loader(unit.vehicle(1), situation.depot), START_US)
    vehicle.carry(hoist_of(situation, unit, 2, boxes))
    _, rig = watching(situation, unit, 2, BoxesOnGround(boxes))
    limits = FlightLimits(2.0, 120.0, 1000.0)
    world.add("0", PlatformConfig("0", 1, control=True, simulated=True, cameras=rig, limits=limits), vehicle)
    world.add_command_centre("cc")
    world.run_for(2.0)
    dialogue = world.ask("cc", "0", FlyMission(mission="m1", domain=DOMAIN, problem=PROBLEM))
    for _ in range(300):
        if is_over(dialogue):
            break
        world.run_for(1.0)
    box = next(each for each in boxes.at(world.now_us) if each.thing.name == "b1")
    assert told(dialogue)[-1].startswith("inform"), told(dialogue)
    assert box.holder is None
    assert hypot(box.place[0] - 30.0, box.place[1] - 20.0) < 3.0
