"""Record `encounter.mcap` and `encounter.jsonl` again: `python -m tests.runtime.journal.recording`.

Only when what a platform does in such an encounter has changed on purpose: the commit says what and why.
"""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from dyknow.agents.capabilities.flight.options import AvoidanceOptions
from dyknow.agents.config import PlatformConfig
from dyknow.agents.effects import Fed, LeaveRequested, Specify
from dyknow.agents.options import Chosen
from dyknow.federation.messages.contents import MonitorProximity
from dyknow.navigation.geodesy import LocalFrame
from dyknow.proxies.recordings.journal_file import CLOCK_EPOCH, CLOCK_SPEED, read_about, read_journal
from dyknow.runtime.journal.journal import Journal
from dyknow.sim_uavs.dynamics.flight_plans import plan_of
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from dyknow.sim_uavs.dynamics.routes import through
from dyknow.sim_uavs.dynamics.scenarios import ORIGIN
from dyknow.sim_uavs.dynamics.settings import HomePlace, VehicleConfig
from dyknow.sim_uavs.dynamics.vehicles import SimulatedVehicle
from dyknow.sim_uavs.world.units import WorldNode
from dyknow.sim_uavs.world.world import START_US, World
from tests.runtime.journal.effects import replayed_effects

HERE = Path(__file__).parent
SECONDS = 26
FRAME = LocalFrame(*ORIGIN)
S = 1_000_000


class JournalledWorld(World):
    """A world in which all that reaches platform 0 is written down."""

    def __init__(self, path: Path, about: dict[str, str]) -> None:
        self._path, self._about = path, about
        super().__init__(seed=1)

    def _boot(self, node: WorldNode) -> None:
        super()._boot(node)
        platform = node.platform
        if node.unit != "0" or platform is None:
            return
        self._about["zid"] = platform.config.zid
        self.journal = Journal(self._path, self._about)
        on_event, on_time = platform.on_event, platform.on_time

        def noted_event(event: Any, now_us: int) -> Any:
            self.journal.on_event(event, now_us)
            return on_event(event, now_us)

        def noted_time(now_us: int) -> Any:
            self.journal.on_time(now_us)
            return on_time(now_us)

        platform.on_event, platform.on_time = noted_event, noted_time  # type: ignore[method-assign]


def record(path: Path, config: str, specification: Specify) -> None:
    """Two fly towards each other and are monitored; platform 0 gives way to 1, which gives way to none, flies on, and leaves."""
    legs = [
        (Vector(-48.0, 0.0, -40.0), Vector(48.0, 0.0, -40.0)),
        (Vector(48.0, 0.0, -40.0), Vector(-48.0, 0.0, -40.0)),
    ]
    plans = [plan_of(through(FRAME, leg, 6.0), START_US + 4 * S) for leg in legs]
    about = {
        "config": config, CLOCK_EPOCH: str(START_US), CLOCK_SPEED: "1.0", "started_us": str(START_US),
        "plan": json.dumps(asdict(plans[0]) | {"waypoints": [list(each) for each in plans[0].waypoints]}),
    }  # fmt: skip
    world = JournalledWorld(path, about)
    for number, plan in enumerate(plans):
        start = plan.waypoints[0]
        home = HomePlace(start.latitude_deg, start.longitude_deg, ORIGIN.altitude_m)
        vehicle = SimulatedVehicle(VehicleConfig(number + 1, home, airborne_m=40.0, seed=1), world.now_us)
        world.add(
            str(number),
            PlatformConfig(
                str(number),
                0,
                control=True,
                options=Chosen(AvoidanceOptions(avoidance=number == 0)),
                simulated=True,
                plan=plan,
            ),
            vehicle,
        )
    world.add_command_centre()
    world.run_for(0.5)
    node = world.nodes["0"]
    world._reach(node, specification._replace(at_us=world.now_us))
    for count in range(SECONDS * 2):
        late_us = 350_000 if count % 4 == 0 else 30_000
        valid_us = START_US + 600_000 + count * 400_000
        fed = Fed(valid_us + late_us, "thermometer", valid_us, 20.0 + count / 8.0)
        world.at(fed.at_us, world._reach, node, fed)
    world.run_until(START_US + 2 * S)
    world.ask("cc", "0", MonitorProximity())
    world.run_until(START_US + (SECONDS - 1) * S + S // 2)
    world._reach(node, LeaveRequested(world.now_us))
    world.run_until(START_US + SECONDS * S)
    world.journal.close()


def main() -> None:
    path, events = HERE / "encounter.mcap", read_journal(HERE / "encounter.mcap")
    specification = next(each.event for each in events if isinstance(getattr(each, "event", None), Specify))
    record(path, read_about(path)["config"], specification)
    lines = [[kind, *effect] for kind, effects in replayed_effects(path).items() for effect in effects]
    text = "".join(json.dumps(line) + "\n" for line in lines)
    (HERE / "encounter.jsonl").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
