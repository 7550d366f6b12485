"""Missions flown by simulated vehicles that stand on the ground at first, in the world in a box."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dyknow.agents.config import PlatformConfig
from dyknow.federation.messages.contents import (
    Content,
    Done,
    FlyMission,
    MissionEntry,
    MissionList,
    MissionQuery,
    Progress,
    Reason,
)
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.navigation.vehicle import Command, Order, Report
from dyknow.sim_uavs.dynamics.faults import SimulatedFault, parse_fault
from dyknow.sim_uavs.dynamics.scenarios import scenario
from dyknow.sim_uavs.dynamics.vehicles import SimulatedVehicle
from dyknow.sim_uavs.world.world import START_US, World

EXAMPLES = Path(__file__).parents[4] / "examples" / "missions"
DOMAIN = (EXAMPLES / "survey.dom").read_text("utf-8")
ONE, TWO = ((EXAMPLES / f"{name}.prob").read_text("utf-8") for name in ("one", "two"))
RESULTS = {"failure", "refuse", "not-understood"}


class Noting(SimulatedVehicle):
    """Keeps the orders that it gets, with their times."""

    def __init__(self, *given: Any, **more: Any) -> None:
        super().__init__(*given, **more)
        self.commands: list[tuple[int, Order]] = []
        self.injected: list[tuple[int, str]] = []

    def inject(self, fault: SimulatedFault, now_us: int, until_us: int | None = None) -> None:
        self.injected.append((now_us, fault.kind))
        super().inject(fault, now_us, until_us)

    def on_command(self, command: Command, now_us: int, stamp_us: int) -> Sequence[tuple[int, Report]]:
        self.commands.append((now_us, command.order))
        return super().on_command(command, now_us, stamp_us)


class Flown:
    """Platforms 0, 1, ... with a vehicle each, 150 m apart, and the command centre `cc`."""

    def __init__(self, count: int = 1, *, airborne: bool = False, **config: Any) -> None:
        self.world = World(1, truth_us=None)
        self.vehicles: list[Noting] = []
        for unit in scenario("hover", count, 1).units:
            name = str(unit.number)
            vehicle = Noting(unit.vehicle(unit.number + 1, airborne=airborne), START_US)
            self.vehicles.append(vehicle)
            given = {"control": True, "simulated": True, **config}
            self.world.add(name, PlatformConfig(name, 1, **given), vehicle)
        self.world.add_command_centre("cc")
        self.world.run_for(2.0)

    def begin(self, problem: str = ONE, domain: str = DOMAIN, to: str = "0", by: str = "cc", **more: Any) -> Dialogue:
        content = FlyMission(**{"mission": "m1", "domain": domain, "problem": problem, **more})
        dialogue = self.world.ask(by, to, content)
        self.world.run_for(1.0)
        return dialogue

    def until(self, dialogue: Dialogue, text: str = "", within_s: int = 200) -> None:
        """Fly the mission until it reports `text`; without one, until it is over."""
        for _ in range(within_s):
            if any(text in each for each in told(dialogue)) if text else is_over(dialogue):
                return
            self.world.run_for(1.0)
        raise AssertionError(f"not within {within_s} s: {told(dialogue)}")

    def ask(self, content: Content, to: str = "0") -> list[tuple[str, Content | None]]:
        dialogue = self.world.ask("cc", to, content)
        self.world.run_for(1.0)
        return [(str(act.performative), said) for act, said in dialogue.said]

    def missions(self, to: str = "0") -> tuple[MissionEntry, ...]:
        ((_, said),) = self.ask(MissionQuery(), to)
        assert isinstance(said, MissionList)
        return said.missions

    def entry(self, to: str = "0") -> MissionEntry:
        return self.missions(to)[0]

    def fault(self, text: str, unit: int = 0, seconds: float | None = None) -> None:
        until_us = None if seconds is None else self.world.now_us + round(seconds * 1e6)
        self.vehicles[unit].inject(parse_fault(text), self.world.now_us, until_us)

    def stands(self, unit: int = 0) -> bool:
        return not self.vehicles[unit].flight.armed


def told(dialogue: Dialogue) -> list[str]:
    """What was told of a mission, in order."""
    texts = []
    for act, said in dialogue.said:
        match said:
            case Progress():
                texts.append(said.step)
            case Done() | Reason():
                texts.append(f"{act.performative}: {said.text}")
            case _:
                texts.append(str(act.performative))
    return texts


def is_over(dialogue: Dialogue) -> bool:
    return any(isinstance(said, Done) or act.performative.value in RESULTS for act, said in dialogue.said)
