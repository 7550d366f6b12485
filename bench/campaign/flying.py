"""A drawn situation as a simulated world: its vehicles, their platforms, the orders at the beginning, and what goes wrong.

The same situation is also flown without neighbours: no platform hears another one, and nothing is monitored. How long each
vehicle takes then is what its time among the others is compared with.
"""

from dataclasses import replace
from typing import NamedTuple

from bench.campaign import situations as ways
from bench.campaign.personas import PersonaVehicle
from bench.campaign.situations import WITH_LEAVE, DrawnVehicle, Situation, Trouble
from dyknow.agents.config import PlatformConfig
from dyknow.agents.places import FlightPlan, Waypoint
from dyknow.federation.messages.contents import Goto, Land, MonitorProximity, ReturnHome
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.vehicle import Command
from dyknow.sim_uavs.dynamics.flight import GoingTo, Mode
from dyknow.sim_uavs.dynamics.missions import Item, MissionAction
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from dyknow.sim_uavs.dynamics.scenarios import ORIGIN
from dyknow.sim_uavs.dynamics.settings import HomePlace, VehicleConfig
from dyknow.sim_uavs.dynamics.vehicles import SimulatedVehicle
from dyknow.sim_uavs.world.sessions import SessionLink
from dyknow.sim_uavs.world.units import WorldNode, WorldProcess
from dyknow.sim_uavs.world.world import World

S = 1_000_000
TASK_S, BEGIN_S = 2.0, 6.0
"""When, after the world began, the monitoring is delegated, and the vehicles set out."""
AGAIN_US = 2 * S
"""How often the user who delegates looks whether the task has failed."""
FRAME = LocalFrame(*ORIGIN)
CENTRE = "cc"
LOSSY = SessionLink(delay_us=300, jitter_us=0, loss=0.3)


class SentOrder(NamedTuple):
    """An order of a platform to its vehicle, and when it left (world)."""

    at_us: int
    command: Command


class CampaignWorld(World):
    """A world that notes the orders of each platform, and whose vehicles hear no heartbeat without a process.

    Attributes:
        sent: the orders since they were looked at last, by unit.
    """

    sent: dict[str, list[SentOrder]]

    def _command(self, node: WorldNode, command: Command) -> None:
        self.sent.setdefault(node.unit, []).append(SentOrder(self.now_us, command))
        super()._command(node, command)

    def _boot(self, node: WorldNode) -> None:
        self._attend(node, is_attended=True)
        if isinstance(node.vehicle, PersonaVehicle):
            node.vehicle.restart()
        super()._boot(node)

    def kill(self, unit: str) -> None:
        self._attend(self.nodes[unit], is_attended=False)
        super().kill(unit)

    def mislead(self, unit: str, step_us: int, drift_ppm: float) -> None:
        """The clock of its machine is wrong from now on, also for the processes that it starts later."""
        node = self.nodes[unit]
        node.clock.mislead(self.now_us, step_us, node.drift_ppm + drift_ppm)
        node.offset_us, node.drift_ppm, node.due_us = node.offset_us + step_us, node.drift_ppm + drift_ppm, None
        self._wake(node)

    def pause(self, unit: str, for_us: int) -> None:
        """Its machine stands still, and so does its clock."""
        node = self.nodes[unit]
        if node.process is None or node.frozen:
            return
        self._attend(node, is_attended=False)
        self.freeze(unit)
        self.at(self.now_us + for_us, self._resume, unit, node.process, for_us)

    def _resume(self, unit: str, process: WorldProcess, for_us: int) -> None:
        node = self.nodes[unit]
        if node.process is process:
            self._attend(node, is_attended=True)
            self.mislead(unit, -for_us, 0.0)
            self.thaw(unit)

    @staticmethod
    def _attend(node: WorldNode, *, is_attended: bool) -> None:
        if isinstance(node.vehicle, PersonaVehicle | SimulatedVehicle):
            node.vehicle.is_attended = is_attended


class CampaignFlight:
    """One situation under way.

    Args:
        is_alone: whether it is flown without neighbours.

    Attributes:
        begin_us: when the vehicles set out (world).
        offsets: where the home of each vehicle is, metres north and east of the origin.
        task: the monitoring, as its delegator follows it; asked: the last order of a user to each vehicle.
    """

    def __init__(self, drawn: Situation, *, is_alone: bool = False) -> None:
        self.drawn, self.is_alone = drawn, is_alone
        reach = _centre_alone if is_alone else _everyone
        self.world = CampaignWorld(drawn.seed, truth_us=None, link=SessionLink(jitter_us=0), reach=reach)
        self.world.sent = {}
        self.begin_us = self.world.start_us + round(BEGIN_S * S)
        self.vehicles: list[SimulatedVehicle | PersonaVehicle] = []
        self.offsets: list[Vector] = []
        self.task: Dialogue | None = None
        self.asked: dict[int, Dialogue] = {}
        for number, vehicle in enumerate(drawn.vehicles):
            self._add(number, vehicle)
        self.world.add_command_centre(CENTRE)
        for trouble in drawn.troubles:
            self._arrange(trouble)
        if not is_alone:
            self.world.at(self.world.start_us + round(TASK_S * S), self._delegate)

    def place(self, number: int) -> Vector:
        """Where the vehicle really is now, metres north, east and down of the origin."""
        vehicle = self.vehicles[number]
        vehicle.flight.on_time(self.world.now_us)
        return self.offsets[number].plus(vehicle.flight.body.position)

    def seconds(self) -> float:
        """Since setting out."""
        return (self.world.now_us - self.begin_us) / S

    # -- vehicles ----------------------------------------------------------------------------------------------

    def _add(self, number: int, drawn: DrawnVehicle) -> None:
        world, way = self.world, drawn.way
        home = (way.end if way.kind in {ways.RTL, ways.RTL_LEAVE} else way.start)._replace(down=0.0)
        latitude_deg, longitude_deg, _ = FRAME.from_ned(*home)
        config = VehicleConfig(
            number + 1, HomePlace(latitude_deg, longitude_deg, ORIGIN.altitude_m), drawn.persona,
            airborne_m=-way.start.down, seed=self.drawn.seed, fence=drawn.fence, limits=drawn.limits,
            settings=replace(drawn.settings), wind=self.drawn.wind,
        )  # fmt: skip
        kind = PersonaVehicle if self.drawn.is_wired else SimulatedVehicle
        vehicle = kind(config, world.now_us, phase_us=world.random.randrange(100_000))
        here = way.start.minus(home)
        vehicle.flight.body = vehicle.flight.body._replace(position=here)
        vehicle.flight.target = GoingTo(here)
        self.vehicles.append(vehicle)
        self.offsets.append(home)
        if way.kind in {ways.AUTO, ways.AUTO_LEAVE}:
            self._load(vehicle, [place.minus(home) for place in way.places[1:]], LocalFrame(*config.home))
        offset_us, drift_ppm = drawn.clock
        plan = None
        if way.kind == ways.PLAN:
            places = tuple(Waypoint(*FRAME.from_ned(*place)) for place in way.places[1:])
            drifted_us = round(BEGIN_S * drift_ppm)
            plan = FlightPlan(places, way.speed_m_s, self.begin_us + offset_us + drifted_us)
        platform = PlatformConfig(
            str(number), 0, control=True, simulated=True, plan=plan, missions=way.kind in WITH_LEAVE,
            limits=drawn.flight_limits,
        )  # fmt: skip
        world.add(str(number), platform, vehicle, offset_us=offset_us, drift_ppm=drift_ppm)
        world.at(self.begin_us, self._set_out, number)

    def _load(self, vehicle: SimulatedVehicle | PersonaVehicle, places: list[Vector], frame: LocalFrame) -> None:
        if isinstance(vehicle, PersonaVehicle):
            vehicle.upload(places, frame, self.world.now_us)
        else:
            vehicle.flight.items = tuple(Item(MissionAction.FLY_TO, place) for place in places)

    def _set_out(self, number: int) -> None:
        """The order that a user, a ground station or the autopilot itself has it fly by; a plan begins by itself."""
        way, flight = self.drawn.vehicles[number].way, self.vehicles[number].flight
        flight.on_time(self.world.now_us)
        places = [place.minus(self.offsets[number]) for place in way.places[1:]]
        match way.kind:
            case ways.GOTO:
                self._send_to(number, way.end)
            case ways.STATION | ways.STREAMED:
                flight.go_to(places[-1])
                if way.kind == ways.STREAMED:
                    self.world.inject(str(number), "stream-target=1")
            case ways.AUTO | ways.AUTO_LEAVE:
                flight.set_mode(Mode.AUTO)
            case ways.RTL | ways.RTL_LEAVE | ways.LAND | ways.LAND_LEAVE if way.by_user:
                is_return = way.kind in {ways.RTL, ways.RTL_LEAVE}
                self.asked[number] = self.world.ask(CENTRE, str(number), ReturnHome() if is_return else Land())
            case ways.RTL | ways.RTL_LEAVE:
                flight.set_mode(Mode.RTL)
            case ways.LAND | ways.LAND_LEAVE:
                flight.set_mode(Mode.LAND)

    def _send_to(self, number: int, place: Vector) -> None:
        latitude_deg, longitude_deg, altitude_m = FRAME.from_ned(*place)
        goto = Goto(latitude_deg=latitude_deg, longitude_deg=longitude_deg, altitude_m=altitude_m)
        self.asked[number] = self.world.ask(CENTRE, str(number), goto)

    def _delegate(self) -> None:
        """As a user does: to the first platform that runs, and again when that is reported as not delivered."""
        self.world.at(self.world.now_us + AGAIN_US, self._delegate)
        if self.task is not None and self.task.failed is None:
            return
        for unit, node in self.world.nodes.items():
            if unit != CENTRE and node.process is not None:
                self.task = self.world.ask(CENTRE, unit, MonitorProximity())
                return

    # -- troubles ----------------------------------------------------------------------------------------------

    def _arrange(self, trouble: Trouble) -> None:
        world, unit = self.world, str(trouble.unit)
        at_us = self.begin_us + round(trouble.at_s * S)
        lasts_us = None if trouble.for_s is None else round(trouble.for_s * S)
        if trouble.fault:
            world.at(at_us, world.inject, unit, trouble.fault, lasts_us)
        elif any(trouble.clock):
            step_us, drift_ppm = trouble.clock
            lie = (world.pause, unit, -step_us) if step_us < 0 else (world.mislead, unit, step_us, drift_ppm)
            world.at(at_us, *lie)
        elif trouble.kind == "process dies":
            world.at(at_us, world.kill, unit)
            if lasts_us is not None:
                world.at(at_us + lasts_us, world.restart, unit)
        elif self.is_alone:
            return
        elif trouble.kind == "30 % loss":
            for other in self._others(unit):
                world.wire.set_link(unit, other, LOSSY)
                world.wire.set_link(other, unit, LOSSY)
        elif trouble.kind != "clock lies":
            ends = [str(trouble.other)] if trouble.other is not None else self._others(unit)
            both = trouble.kind != "link is cut one way"
            world.at(at_us, self._cut, unit, ends, both)
            if lasts_us is not None:
                world.at(at_us + lasts_us, self._mend, unit, ends, both)

    def _others(self, unit: str) -> list[str]:
        return [other for other in self.world.nodes if other != unit]

    def _cut(self, unit: str, ends: list[str], both: bool) -> None:
        for other in ends:
            self.world.wire.cut(unit, other)
            if both:
                self.world.wire.cut(other, unit)

    def _mend(self, unit: str, ends: list[str], both: bool) -> None:
        for other in ends:
            self.world.wire.mend(unit, other)
            if both:
                self.world.wire.mend(other, unit)


def _everyone(_one: str, _other: str) -> bool:
    return True


def _centre_alone(one: str, other: str) -> bool:
    """Only the command centre hears anybody: its orders arrive."""
    return CENTRE in {one, other}
