"""A simulated UAV in flight with a camera, and one car that drives east, seen as percepts that are fed, or not seen."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from dyknow import Label, Policy, Sample
from dyknow.agents.capabilities.attention.camera_attention import CameraAttention
from dyknow.agents.capabilities.attention.following import Following
from dyknow.agents.config import PlatformConfig
from dyknow.agents.effects import Fed, Specify
from dyknow.agents.platform import Platform
from dyknow.federation.messages.contents import Content, Done, Progress, Reason
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.federation.security.trust import Trust
from dyknow.navigation.cameras.pinhole import Intrinsics
from dyknow.navigation.cameras.rig import CameraRig
from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.vehicle import Command, GoToOrder, LookAtOrder, Report
from dyknow.sim_uavs.dynamics.scenarios import ORIGIN, scenario
from dyknow.sim_uavs.dynamics.vehicles import SimulatedVehicle
from dyknow.sim_uavs.world.world import START_US, World

LINKS = """
sort vision-object(symbol in text, x_m in m, y_m in m, end in bool)
sort car(symbol in text, x_m in m, y_m in m, vx_m_s in m/s, vy_m_s in m/s, anchored in bool, end in bool)
source vision-object camera
compunit car WorldObject(vision-object)
strmgen percepts = camera
strmgen cars = link(percepts, WorldObject,
  eventually [1000, oo] true, eventually [0, 1000] xy_dist[from, to] < thresh, true)
for c in cars stream x = cars.x_m[c]
"""
FED = """
sort car(symbol in text, x_m in m, y_m in m, anchored in bool, end in bool)
source car feed
strmgen cars = feed
"""
FRAME = LocalFrame(*ORIGIN)


class Chased(SimulatedVehicle):
    """Keeps the orders that it gets."""

    def __init__(self, *given: Any, **more: Any) -> None:
        super().__init__(*given, **more)
        self.commands: list[tuple[int, Command]] = []

    def on_command(self, command: Command, now_us: int, stamp_us: int) -> Sequence[tuple[int, Report]]:
        self.commands.append((now_us, command))
        return super().on_command(command, now_us, stamp_us)


class Chase:
    """Platform 0 with its vehicle over the origin, and the command centre `cc`."""

    def __init__(
        self, specification: str = LINKS, *, trust: Callable[[str], Trust | None] = lambda _unit: None, **config: Any
    ) -> None:
        unit = scenario("hover", 1, 1).units[0]
        self.vehicle = Chased(replace(unit.vehicle(1, airborne=True), has_mount=True), START_US)
        home = FRAME.to_ned(*unit.home)
        self.start_m = home[1], home[0]
        rig = CameraRig({"colour": Intrinsics.of_view(640, 512, 1.0)}, FRAME)
        self.world = World(1, truth_us=None)
        given = {"control": True, "cameras": rig, "simulated": True, "trust": trust("0"), **config}
        self.world.add("0", PlatformConfig("0", 1, **given), self.vehicle)
        self.world.add_command_centre("cc", trust=trust("cc"))
        self.world.run_for(1.0)
        self.happens(Specify(self.world.now_us, specification, "cars.kpl"))
        self.world.run_for(1.0)
        self.gazes: list[Sample] = []
        if config.get("cameras", rig) is not None:
            label = Label.parse("camera-attention[0]")
            self.platform.ports.network.connect(label, Policy(), self.gazes.append)
        self.x_m, self.y_m = self.start_m

    @property
    def platform(self) -> Platform:
        found = self.world.nodes["0"].platform
        assert found is not None
        return found

    @property
    def notes(self) -> list[str]:
        return self.world.nodes["0"].notes

    @property
    def conditions(self) -> list[str]:
        parts = (self.platform.part(Following), self.platform.part(CameraAttention))
        return [each.text for part in parts for each in part.conditions()]

    @property
    def orders(self) -> list[GoToOrder]:
        return [each.order for _, each in self.vehicle.commands if isinstance(each.order, GoToOrder)]

    @property
    def looks(self) -> list[LookAtOrder]:
        return [each.order for _, each in self.vehicle.commands if isinstance(each.order, LookAtOrder)]

    @property
    def at_m(self) -> tuple[float, float]:
        """Where the vehicle really is, metres east and north."""
        truth = self.vehicle.truth(self.world.now_us)
        north_m, east_m, _ = FRAME.to_ned(truth.latitude_deg, truth.longitude_deg, truth.altitude_m)
        return east_m, north_m

    def happens(self, event: Any) -> None:
        self.world._reach(self.world.nodes["0"], event)

    def drive(self, seconds: float, speed_m_s: float = 0.0, *, percept: str | None = "vp1") -> None:
        """The car drives east; without a percept it is not seen."""
        for _ in range(round(seconds * 10)):
            self.x_m += speed_m_s / 10.0
            if percept is not None:
                value = (percept, self.x_m, self.y_m, False)
                self.happens(Fed(self.world.now_us, "camera", self.world.now_us, value))
            self.world.run_for(0.1)

    def end(self, percept: str) -> None:
        value = (percept, self.x_m, self.y_m, True)
        self.happens(Fed(self.world.now_us, "camera", self.world.now_us, value))

    def feed(self, symbol: str, x_m: float, y_m: float, seconds: float = 0.1) -> None:
        """A state of an object of whose links nothing is known, again and again."""
        for _ in range(round(seconds * 10)):
            self.happens(Fed(self.world.now_us, "feed", self.world.now_us, (symbol, x_m, y_m, True, False)))
            self.world.run_for(0.1)

    def ask(self, content: Content, seconds: float = 3.0) -> Dialogue:
        dialogue = self.world.ask("cc", "0", content)
        self.world.run_for(0.2)
        self.pass_time(seconds - 0.2)
        return dialogue

    def pass_time(self, seconds: float) -> None:
        if seconds > 0.0:
            self.world.run_for(seconds)


def said(dialogue: Dialogue) -> list[tuple[str, str]]:
    """Performatives and texts of all answers."""
    texts = []
    for act, content in dialogue.said:
        match content:
            case Done() | Reason():
                text = content.text or ""
            case Progress():
                text = content.step
            case _:
                text = ""
        texts.append((str(act.performative), text))
    return texts
