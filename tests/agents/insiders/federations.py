"""Federations with a hostile member: platforms 0 and 1 of a scenario, a UAV 2 and an observer that say anything, a command centre.

What a platform raises is raised here: containment is off. Every order that reaches a vehicle is kept with who commanded it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from hashlib import sha256
from random import Random
from typing import Any, Final, NamedTuple

from dyknow.agents.admission.admission import Admission
from dyknow.agents.capabilities.areas.assignment import MOST_OF_ONE, AreaAssignment
from dyknow.agents.capabilities.flight.arbiter import Commander
from dyknow.agents.capabilities.flight.flight import FlightAgent
from dyknow.agents.config import PlatformConfig
from dyknow.agents.effects import Specify
from dyknow.agents.exchange.import_proxy import STREAMS_OF_ONE
from dyknow.agents.places import FlightLimits
from dyknow.compunits import catalogue
from dyknow.federation.members.command_centre import CommandCentre
from dyknow.federation.members.member import Member
from dyknow.federation.messages import contents
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.codec import encode_act
from dyknow.federation.messages.protocols import OPENING, Conversation
from dyknow.federation.messages.unpacking import MAX_BYTES
from dyknow.federation.security.trust import Role, Roster, RosterMember, Signer, Trust
from dyknow.model.errors import ContentError
from dyknow.model.instants import LATEST_US
from dyknow.navigation.geodesy import LocalFrame, distance_m
from dyknow.navigation.vehicle import Command, Order, Report
from dyknow.sim_uavs.boxes.shared import HandlingList
from dyknow.sim_uavs.cameras.onboard import OnboardCameras
from dyknow.sim_uavs.depot import boxes_of, hoist_of, loader, scene_of
from dyknow.sim_uavs.dynamics.scenarios import Scenario, Unit, scenario
from dyknow.sim_uavs.dynamics.settings import HomePlace
from dyknow.sim_uavs.dynamics.vehicles import SimulatedVehicle
from dyknow.sim_uavs.monitoring.specifications import READY
from dyknow.sim_uavs.roads.layouts import network_of
from dyknow.sim_uavs.streets import carried_over, roads_of, watching
from dyknow.sim_uavs.world.units import DriftingClock, WorldNode
from dyknow.sim_uavs.world.world import START_US, World
from tests.agents.insiders.drawing import LASTING, Drawing

P = Performative
HONEST: Final = ("0", "1")
SCENARIOS: Final = ("hover", "emergency", "traffic", "logistics")
ROLES: Final[dict[str, Role]] = {"0": "uav", "1": "uav", "2": "uav", "cc": "command-centre", "obs": "observer"}
UNITS: Final = ("0", "1", "2", "cc", "obs", "9", "cc-1")
LABELS: Final = (
    "heli-position", "heli-altitude", "heli-velocity", "heli-height", "heli-home", "battery", "nonsense", "object-tracks",
    "object-identities", "global-objects", "saliency-entries", "saliency-map", "camera-state", "camera-view",
    "vision-percepts", "scanned-area", "assigned-area", "top-speed", "believed-objects", "pair-events",
    "object-attributes",
)  # fmt: skip
IMAGE_US: Final = 1_000_000
OVER: Final = ((-20.0, 10.0), (30.0, 20.0))
"""Where platforms are at work, metres east and north, at a height of 45 m."""
NEAR_M: Final = 400.0
"""Vehicles that are nearer may give way to each other."""
ASKED_EVERY: Final = 60
ASKED_MOST: Final = 12
"""What the command centre wants at once: an older wish is cancelled."""
GONE_EVERY: Final = 600
"""Acts."""
_FIELD: Final = ("55.7240 13.4570", "55.7240 13.4620", "55.7260 13.4620", "55.7260 13.4570")
ASKED: Final[tuple[tuple[contents.Content, Performative], ...]] = (
    (contents.Query(semantic_label="heli-position", scope="global"), P.QUERY_REF),
    (contents.Query(semantic_label="heli-altitude", scope="global", merge="inverse-variance"), P.QUERY_REF),
    (contents.Query(semantic_label="heli-altitude", scope="global", merge="mean"), P.QUERY_REF),
    (contents.Query(semantic_label="battery", scope="global", select="best"), P.QUERY_REF),
    (contents.DivideArea(area=_FIELD), P.REQUEST),
    (contents.DivideArea(area=_FIELD, sensor="heli-position"), P.REQUEST),
    (contents.MonitorProximity(avoidance=False), P.REQUEST),
    (contents.CheckFormula(text="eventually[0, 5s] heli-altitude[2] > 10000", timeout_s=10.0), P.REQUEST),
    (contents.Alarms(), P.SUBSCRIBE),
    (contents.MonitorList(monitors=()), P.QUERY_REF),
)
ANSWERS: Final[dict[str, list[type[contents.Content]]]] = {
    "query": [contents.Samples, contents.Answers, contents.Reason],
    "create-multicast": [contents.Stream, contents.EndStream, contents.Done, contents.Reason],
    "create-monitor": [contents.Reason, contents.Done, contents.Progress, contents.HandOver],
    "call-for-stream": [contents.StreamProposal, contents.Reason],
    "call-for-mission": [contents.MissionProposal, contents.Reason],
    "fly-mission": [contents.Progress, contents.Done, contents.Reason],
    "join-mission": [contents.Done, contents.VehicleNews, contents.Reason],
    "perform-commands": [contents.Performed, contents.Reason],
    "alarms": [contents.Alarm],
    "directory": [contents.DirectoryEvent],
    "acts": [contents.ActLog],
}
"""What a question of an honest platform may be answered with."""
MOST: Final = 4200
"""Entries that a collection of a platform may hold."""


class OrderGiven(NamedTuple):
    """An order as it reached a vehicle: to whom, which, who commanded it, and of which mission."""

    unit: str
    order: Order
    commander: Commander
    mission: str


class Watched(SimulatedVehicle):
    """Reports images of its cameras, and keeps the orders that it gets."""

    def __init__(self, onboard: OnboardCameras | None, *given: Any) -> None:
        super().__init__(*given)
        self._onboard, self._image_us = onboard, 0
        self.orders: list[Order] = []

    def on_time(self, now_us: int, stamp_us: int) -> list[Report]:
        reports = list(super().on_time(now_us, stamp_us))
        if self._onboard is None or now_us < self._image_us + IMAGE_US:
            return reports
        self._image_us = now_us
        looking = self.looking(now_us)
        image = None if looking is None else self._onboard.image(stamp_us, *looking)
        return reports if image is None else [*reports, image]

    def on_command(self, command: Command, now_us: int, stamp_us: int) -> list[tuple[int, Report]]:
        self.orders.append(command.order)
        return super().on_command(command, now_us, stamp_us)


def trust(unit: str) -> Trust:
    """Of a member of the roster, with its own key."""
    seeds = {each: sha256(each.encode()).digest() for each in ROLES}
    members = {
        each: RosterMember(each, Signer(seed, "default").public_key, ROLES[each]) for each, seed in seeds.items()
    }
    return Trust.of(Roster(members), seeds[unit], "default", START_US - 1_000_000)


class HostileFederation:
    """One scenario, one seed; `speakers` say what is drawn.

    Attributes:
        orders: all that reached the vehicles of honest platforms.
        log: the acts said so far, for the message of a failure.
    """

    def __init__(self, name: str, seed: int, speakers: Sequence[str] = ("2", "obs")) -> None:
        self.name, self.random, self._speakers = name, Random(f"{name} {seed}"), tuple(speakers)
        self.drawing = Drawing(self.random, UNITS, LABELS)
        self.world = World(seed, truth_us=None)
        self.orders: list[OrderGiven] = []
        self.acts = self._heard_before = 0
        self.log: list[str] = []
        self._asked: list[tuple[str, str]] = []
        self.vehicles: dict[str, Watched] = {}
        situation = scenario("hover" if name == "hover" else name, 3 if name == "hover" else 2, seed)
        for unit in situation.units[:2]:
            self._add(situation, unit, seed)
        self.world.add("2", self._config("2", {}), self._bystander(seed))
        self.world.add_command_centre("cc", trust=trust("cc"))
        self._add_observer()
        actions = self.world.platform("0").part(Admission).table.actions
        self._taken = {action.head: sorted(action.performatives) for _, action in actions}
        self.world.run_for(2.0)
        if name in READY:
            self._specify(name)
        self._delegate()
        self._remember_boots()
        self.world.run_for(1.0)

    # -- who is there ------------------------------------------------------------------------------------------

    def _config(self, unit: str, given: dict[str, Any]) -> PlatformConfig:
        limits = FlightLimits(2.0, 120.0, 1000.0)
        find = catalogue(READY[self.name].modules if self.name in READY else ()).offered
        fields = {"control": True, "simulated": True, "limits": limits, "trust": trust(unit), "contained": False}
        fields |= {"acts_per_s": 1e6, "acts_burst": 1e6, "catalogue": find}
        return PlatformConfig(unit, 1, **{**fields, **given})

    def _add(self, situation: Scenario, standing: Unit, seed: int) -> None:
        name, given = str(standing.number), dict[str, Any]()
        unit = standing if self.name == "hover" else self._above(situation, standing)
        flown, onboard = unit.vehicle(unit.number + 1, airborne=True), None
        if situation.streets is not None:
            onboard, given["cameras"] = carried_over(situation, unit, seed)
            flown, given["roads"] = replace(flown, has_mount=True), network_of(roads_of(situation))
        hoist = None
        if situation.depot is not None:
            boxes = boxes_of(situation, seed, HandlingList())
            onboard, given["cameras"] = watching(situation, unit, seed, scene_of(situation, seed, boxes))
            flown, hoist = loader(flown, situation.depot), hoist_of(situation, unit, seed, boxes)
        vehicle = Watched(onboard, flown, START_US)
        if hoist is not None:
            vehicle.carry(hoist)
        self.vehicles[name] = vehicle
        self.world.add(name, self._config(name, given), vehicle)

    def _above(self, situation: Scenario, unit: Unit) -> Unit:
        east_m, north_m = OVER[unit.number]
        latitude_deg, longitude_deg, _ = LocalFrame(*situation.origin).from_ned(north_m, east_m, 0.0)
        return unit._replace(home=HomePlace(latitude_deg, longitude_deg, unit.home.altitude_m), height_m=45.0)

    def _bystander(self, seed: int) -> Watched:
        unit = scenario("hover", 3, seed).units[2]
        return Watched(None, unit.vehicle(3, airborne=True), START_US)

    def _add_observer(self) -> None:
        world = self.world

        def make(zid: str, node_us: int) -> CommandCentre:
            return CommandCentre("obs", node_us, zid=zid, trust=trust("obs"))

        clock = DriftingClock(world.now_us)
        world._join(WorldNode("obs", make, None, clock, world.nodes["0"].federation_clock))

    def _specify(self, name: str) -> None:
        ready = READY[name]
        folder, text = ready.file.parent, ready.file.read_text("utf-8")
        named = tuple(
            (path, (folder / path).read_text("utf-8")) for path in ("turns.chr", "world.toml") if path in text
        )
        for unit in HONEST:
            event = Specify(self.world.now_us, text, ready.file.name, named)
            self.world._reach(self.world.nodes[unit], event)
            assert not [each for each in self.world.nodes[unit].results if each["event"] == "not-specified"]

    def _delegate(self) -> None:
        """What a command centre has asked for: monitors."""
        task = self.world.ask("cc", "0", contents.MonitorProximity(avoidance=False))
        self.world.run_for(0.5)
        self.drawing.conversations.append(task.conversation)
        self.task = task.conversation

    # -- what is said ------------------------------------------------------------------------------------------

    def say(self, count: int) -> None:
        """Have at least `count` more acts said, while time passes and members come and go."""
        until = self.acts + count
        while self.acts < until:
            before = self.acts
            for _ in range(self.random.choice((1, 2, 4, 8))):
                self._one()
            chance = self.random.random()
            self.world.run_for(0.03 if chance < 0.9 else 0.3 if chance < 0.99 else 4.0)
            self.check()
            if before // ASKED_EVERY < self.acts // ASKED_EVERY:
                self._ask()
            if before // GONE_EVERY < self.acts // GONE_EVERY:
                self._come_and_go()

    def _ask(self) -> None:
        """The command centre asks for something that makes platforms ask each other, and the hostile ones, but moves nothing."""
        content, performative = self.random.choice(ASKED)
        question = self.world.ask("cc", self.random.choice(HONEST), content, performative)
        self.drawing.conversations.append(question.conversation or "t")
        self._asked.append((question.unit, question.conversation))
        if len(self._asked) > ASKED_MOST:
            self.world.cancel("cc", *self._asked.pop(0))

    def _one(self) -> None:
        by, to = self.random.choice(self._speakers), self.random.choice(HONEST)
        node = self.world.nodes[by]
        if node.process is None or node.frozen:
            return
        talk = self._open(by, to) if self.random.random() < 0.35 else None
        kinds = self.drawing.kinds
        if talk is not None and self.random.random() < 0.8:
            kinds = ANSWERS.get(talk.opening.content.head if talk.opening.content else "", kinds)
        content = self.drawing.content(self.random.choice(kinds))
        if content is None:
            return
        act = self._act(by, to, content, talk)
        try:
            size = len(encode_act(act))
        except ContentError:
            return
        if size > MAX_BYTES - 256:  # with its signature it is too large to be said
            return
        self.log.append(f"{by} to {to}: {act.performative.value} {act.conversation_id} {act.content}"[:600])
        del self.log[:-12]
        self.acts += 1

        def speak(member: Member, now_us: int) -> None:
            _, put = member.acts.conversations.delivery.send(act, now_us, patient=False)
            self.world.wire.perform(by, put)

        self.world.speak(by, speak)

    def _act(self, by: str, to: str, content: contents.ContentPart, talk: Conversation | None) -> Act:
        random = self.random
        now_us = self.world.now_us
        process = self.world.nodes[by].process
        assert process is not None
        conversation, answers = process.member.acts.conversations.new_conversation(to), None
        if talk is not None:
            conversation = talk.opening.conversation_id or "t"
            answers = talk.opening.reply_with if talk.ours else None
        elif random.random() < 0.3:
            conversation = random.choice(self.drawing.conversations[-40:])
        performative = self._performative(content, answers)
        if performative in OPENING and len(self.drawing.conversations) < 100_000:
            self.drawing.conversations.append(conversation)
            del self.drawing.conversations[len(LASTING) : -40]
        return Act(
            performative,
            AgentName("interface", by),
            AgentName(random.choice(("interface",) * 20 + ("federation", "pilot", "coordination")), to),
            content.expr(),
            conversation,
            random.choice((None, "fipa-request", "fipa-contract-net")),
            f"r{self.acts}" if random.random() < 0.9 else None,
            answers,
            random.choice((None, 0, LATEST_US, now_us + 1_000_000, now_us + 30_000_000)),
            ontology="dyknow",
        )

    def _performative(self, content: contents.ContentPart, answers: str | None) -> Performative:
        """Mostly one with which the platform takes that content."""
        random = self.random
        if random.random() < 0.1:
            return random.choice(list(P))
        if answers is not None:
            return random.choice(
                (P.AGREE, P.INFORM, P.INFORM, P.REFUSE, P.FAILURE, P.PROPOSE, P.NOT_UNDERSTOOD, P.CONFIRM)
            )
        if random.random() < 0.05:
            return P.CANCEL
        return random.choice(self._taken.get(content.head, (P.INFORM, P.INFORM, P.REQUEST, P.PROPOSE)))

    def _open(self, by: str, to: str) -> Conversation | None:
        """A conversation that the honest platform has with the speaker."""
        node = self.world.nodes[to]
        if node.process is None:
            return None
        open_now = [each for each in node.process.member.acts.conversations.conversations() if each.peer == by]
        ours = [each for each in open_now if each.ours]
        return self.random.choice(ours or open_now) if open_now else None

    # -- who comes and goes ------------------------------------------------------------------------------------

    def _come_and_go(self) -> None:
        """A hostile member is killed, falls silent or says good-bye, and comes back; or an honest one does."""
        world = self.world
        unit = self.random.choice(("2", "2", "2", "1", "obs"))
        how = self.random.choice(("kill", "freeze", "leave", "restart", "cut"))
        away_s = self.random.choice((0.5, 4.0, 8.0, 40.0))
        match how:
            case "kill":
                self._heard_before += self._heard(unit) if unit in HONEST else 0
                world.kill(unit)
                self._pass(away_s)
                world.restart(unit)
            case "freeze":
                world.freeze(unit)
                self._pass(away_s)
                world.thaw(unit)
            case "leave" if world.nodes[unit].platform is not None:
                world.leave(unit)
                self._pass(away_s)
                world.rejoin(unit)
            case "cut":
                world.partition([unit], ["0"])
                self._pass(away_s)
                world.heal([unit], ["0"])
            case _:
                self._heard_before += self._heard(unit) if unit in HONEST else 0
                world.restart(unit)
        world.run_for(2.0)
        self._remember_boots()
        for node in world.nodes.values():
            node.lives = node.lives[-1:]
            for kept in (node.notes, node.results, node.kept, node.truth):
                kept.clear()

    def _remember_boots(self) -> None:
        nodes = self.world.nodes.values()
        self.drawing.boots = [node.process.member.boot for node in nodes if node.process is not None]

    def _pass(self, seconds: float) -> None:
        self.world.run_for(seconds)
        self.check()

    # -- what holds --------------------------------------------------------------------------------------------

    def check(self) -> None:
        """No honest vehicle is moved but by who may."""
        for unit, vehicle in self.vehicles.items():
            for order in vehicle.orders:
                pilot = self.world.platform(unit).part(FlightAgent).pilot
                given = OrderGiven(unit, order, pilot.claims.commander, pilot.claims.mission)
                self.orders.append(given)
                assert self._is_due(given), f"{given} after\n" + "\n".join(self.log)
            vehicle.orders.clear()
        assert self._stands("0"), "what the command centre delegated has ended at its delegate, after\n" + "\n".join(
            self.log
        )

    def _stands(self, unit: str) -> bool:
        """Whether a platform takes part in what the command centre delegated, or that may have ended it."""
        led = self.world.platform(unit).built.tasks.coordinated.get(self.task)
        return "cc" in self._speakers or (led is not None and led.leader == "0" and bool(led.plans))

    def check_standing(self) -> None:
        """After a while without hostile acts both honest platforms take part in it."""
        self.world.run_for(15.0)
        for unit in HONEST:
            assert self._stands(unit), f"{unit} takes no part in what the command centre delegated"

    def _is_due(self, given: OrderGiven) -> bool:
        """Whether a command centre may be behind it, or vehicles are near each other."""
        if "cc" in self._speakers:
            return True
        places = [vehicle.truth(self.world.now_us) for vehicle in self.vehicles.values()]
        apart_m = distance_m(*places[0][1:3], *places[1][1:3])
        return given.commander is Commander.AVOIDANCE and apart_m < NEAR_M

    @property
    def answered(self) -> int:
        """How many acts honest platforms have heard, in all their lives, whatever became of them."""
        return self._heard_before + sum(map(self._heard, HONEST))

    def _heard(self, unit: str) -> int:
        platform = self.world.nodes[unit].platform
        counts = {} if platform is None else platform.ports.agent.audit_log.counts
        return sum(number for (direction, _), number in counts.items() if direction == "in")

    def collections(self) -> Iterator[tuple[str, int]]:
        """The collections that parts of honest platforms hold, by place, with their sizes."""
        for unit in HONEST:
            node = self.world.nodes[unit]
            if node.platform is None:
                continue
            owners = [*node.platform.parts, node.platform.containment, node.platform.member, node.platform.member.acts]
            owners += [node.platform.member.acts.conversations, node.platform.member.acts.conversations.delivery]
            for owner in owners:
                for name, held in _attributes(owner):
                    if isinstance(held, dict | list | set):
                        yield f"{type(owner).__name__}.{name}", len(held)

    def of_the_gone(self, unit: str) -> list[str]:
        """What honest platforms still hold of a member that has been gone for long: of its streams and pieces more than it may have."""
        found = []
        for each in HONEST:
            platform = self.world.platform(each)
            streams = [name for name in platform.member.imports.streams if name[0] == unit]
            found += [f"{each}: stream {name}" for name in streams[STREAMS_OF_ONE:]]
            talks = platform.member.acts.conversations.conversations()
            found += [f"{each}: conversation {talk.opening}" for talk in talks if talk.peer == unit]
            pieces = platform.part(AreaAssignment).pieces
            found += [f"{each}: piece {task}" for task, piece in pieces.items() if piece.leader == unit][MOST_OF_ONE:]
            exports = platform.built.gateway.exporter.exports
            found += [
                f"{each}: export {name}"
                for name, contract in exports._contracts.items()
                if contract.receivers == {unit}
            ]
        return found


def _attributes(owner: object) -> Iterator[tuple[str, Any]]:
    yield from getattr(owner, "__dict__", {}).items()
    for kind in type(owner).__mro__:
        for name in getattr(kind, "__slots__", ()):
            if hasattr(owner, name):
                yield name, getattr(owner, name)
