"""What really happens in a flight of the campaign, step by step, and which invariants that breaks.

A pair is nearer than `LEAST_M` in space when both are airborne and neither falls without motors. That is a breach if both
had heard each other within `HEARD_US`, and one of them could be commanded for `REACT_US` before. Any other such pair is
untold unless for `TOLD_US` before an alarm was open, at each of the two platforms that runs, that names the other.
"""

from collections import deque
from dataclasses import dataclass, field
from itertools import combinations, permutations
from math import sqrt

from bench.campaign.adapter import LEAVES, is_aside, manoeuvre, why_not
from bench.campaign.flying import FRAME, CampaignFlight, S
from bench.campaign.situations import ENDS_ON_GROUND, HOVER, STREAMED, WITH_LEAVE
from dyknow import NO_VALUE, Label, Sample
from dyknow.agents.monitoring.alarm_log import AlarmLog
from dyknow.agents.platform import Platform
from dyknow.model.errors import ValueNotAvailable
from dyknow.reasoning import AlarmEvent, builtin_profiles
from dyknow.sim_uavs.dynamics.flight import GUIDED_MODES, Mode
from dyknow.sim_uavs.dynamics.quadcopter import Vector

STEP_US = 100_000
LEAST_M, APART_AGAIN_M = 10.0, 12.0
HEARD_US, REACT_US, TOLD_US = 20 * S, 8 * S, 5 * S
FLICKER_US = S
"""An alarm that opens again so soon counts as open all the time."""
LISTEN_STEPS = 5
TRUTHFUL_M = 50.0
"""A position that is so far off is not heard: it is a lie."""
THERE_M, STAYS_M = 5.0, 10.0
REASONLESS_US, DEAD_US, HANDS_US = 1_500_000, 3_500_000, 1_500_000
"""How long a manoeuvre may stand without a reason; and after what an order shows that it is not known that the vehicle is silent, or in its pilot's hands."""
OBSTRUCTING = (
    "silence",
    "refuse",
    "forget",
    "stream-target",
    "gps-loss",
    "nan",
    "frozen-position",
    "teleport",
)
"""Faults with which a vehicle cannot be commanded, or its platform does not know where it is."""


@dataclass(slots=True)
class WatchedUnit:
    """One vehicle and its platform.

    Attributes:
        arrived_s: when it was first where its orders send it, since setting out.
        able_since_us, mode_since_us, silent_since_us: since when without a break it can be commanded, its mode is what it
            is, and its autopilot is silent.
        flies_itself: whether its autopilot returns or lands by itself: its link, its battery or its fence was the reason.
        taken_since_us: since when its pilot has it, which ends only when a user asks for it: in no flight of the campaign.
        manoeuvres: how many orders to keep apart it was given.
        is_stranded: whether its process ended during a manoeuvre: the vehicle carries that out, and stands there.
    """

    arrived_s: float | None = None
    able_since_us: int | None = None
    mode: Mode | None = None
    mode_since_us: int = 0
    silent_since_us: int | None = None
    flies_itself: bool = False
    is_outside: bool = False
    number: int = -1
    manoeuvres: int = 0
    is_manoeuvring: bool = False
    is_aside: bool = False
    is_stranded: bool = False
    reasonless_since_us: int | None = None
    last_alarm: AlarmEvent | None = None
    taken_since_us: int | None = None
    life: Platform | None = None
    explained: str = ""


@dataclass(slots=True)
class Watch:
    """Looks at one flight after every step.

    Attributes:
        breaches, untold, told: pairs that came too near, in words.
        violations: what was done that must not be done.
        least_m: the least distance of a pair.
        track: sums that are equal if two flights are.
    """

    flight: CampaignFlight
    units: list[WatchedUnit] = field(default_factory=list)
    breaches: list[str] = field(default_factory=list)
    untold: list[str] = field(default_factory=list)
    told: list[str] = field(default_factory=list)
    violations: list[str] = field(default_factory=list)
    least_m: float = 1e9
    track: float = 0.0
    orders: int = 0
    _labels: list[Label] = field(default_factory=list)
    _steps: int = 0
    _near: set[tuple[int, int]] = field(default_factory=set)
    _heard_us: dict[tuple[int, int], tuple[int, int]] = field(default_factory=dict)
    _open: dict[tuple[int, int], dict[str, AlarmEvent]] = field(default_factory=dict)
    _told_since_us: dict[tuple[int, int], int] = field(default_factory=dict)
    _told_until_us: dict[tuple[int, int], int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.units = [WatchedUnit() for _ in self.flight.vehicles]
        self._labels = [Label("heli-position", (str(number),)) for number in range(len(self.units))]

    @property
    def manoeuvres(self) -> int:
        return sum(each.manoeuvres for each in self.units)

    @property
    def is_calm(self) -> bool:
        """Whether no vehicle is kept from its way."""
        return not any(each.is_manoeuvring for each in self.units)

    def step(self) -> None:
        """Look, at the present time of the world."""
        flight, now_us = self.flight, self.flight.world.now_us
        places = [flight.place(number) for number in range(len(self.units))]
        self._steps += 1
        for number, unit in enumerate(self.units):
            self._look_at_vehicle(number, unit, places[number], now_us)
        if flight.is_alone:
            return
        for number, unit in enumerate(self.units):
            self._look_at_orders(number, unit)
            self._look_at_platform(number, unit, now_us)
        if self._steps % LISTEN_STEPS == 0:
            self._listen(places, now_us)
            self.track += sum(place.north + 2.0 * place.east + 3.0 * place.down for place in places) * self._steps
        self._measure(places, now_us)

    # -- vehicles ----------------------------------------------------------------------------------------------

    def _look_at_vehicle(self, number: int, unit: WatchedUnit, place: Vector, now_us: int) -> None:
        vehicle = self.flight.vehicles[number]
        if vehicle.flight.mode is not unit.mode:
            unit.mode, unit.mode_since_us = vehicle.flight.mode, now_us
            unit.flies_itself = self._flies_itself(number)
        silent = vehicle._faults.holds("silence", now_us)
        unit.silent_since_us = (unit.silent_since_us or now_us) if silent else None
        if unit.taken_since_us is None and vehicle._faults.holds("takeover", now_us):
            unit.taken_since_us = now_us
        unit.able_since_us = (unit.able_since_us or now_us) if self._is_able(number, now_us) else None
        self._look_at_fence(number, unit, now_us)
        if now_us >= self.flight.begin_us and (unit.arrived_s is None or self._stays(number)):
            there = self._is_there(number, place)
            if there and unit.arrived_s is None:
                unit.arrived_s = self.flight.seconds()
            elif not there and self._stays(number):
                unit.arrived_s = None

    def _flies_itself(self, number: int) -> bool:
        """Whether the mode that it has taken is the doing of its autopilot; where a return was ordered that shows in what is lost."""
        vehicle, kind = self.flight.vehicles[number], self.flight.drawn.vehicles[number].way.kind
        if vehicle.flight.mode not in {Mode.RTL, Mode.LAND}:
            return False
        settings, charge = vehicle.flight.settings, vehicle.flight.body.charge
        is_low = charge <= (settings.battery_low if settings.battery_low_action else settings.battery_critical)
        return kind not in ENDS_ON_GROUND or is_low or vehicle._failsafe.has_acted

    def _stays(self, number: int) -> bool:
        return self.flight.drawn.vehicles[number].way.kind == HOVER

    def _is_there(self, number: int, place: Vector) -> bool:
        way, flight = self.flight.drawn.vehicles[number].way, self.flight.vehicles[number].flight
        if way.kind in ENDS_ON_GROUND:
            return not flight.airborne
        return place.is_close_to(way.end, STAYS_M if way.kind == HOVER else THERE_M)

    def _is_able(self, number: int, now_us: int) -> bool:
        """Whether the vehicle could be commanded to make room, by a platform that knows where it is."""
        return not self.flight.drawn.vehicles[number].is_hemmed and self._obeys(number, now_us)

    def _obeys(self, number: int, now_us: int) -> bool:
        node, vehicle = self.flight.world.nodes[str(number)], self.flight.vehicles[number]
        mode, kind = vehicle.flight.mode, self.flight.drawn.vehicles[number].way.kind
        takes = mode in GUIDED_MODES or (mode in LEAVES and kind in WITH_LEAVE)
        if node.process is None or node.frozen or not takes or kind == STREAMED or self.units[number].flies_itself:
            return False
        if self.units[number].taken_since_us is not None or not (vehicle.flight.armed and vehicle.flight.airborne):
            return False
        return not any(vehicle._faults.holds(fault, now_us) for fault in OBSTRUCTING)

    def _look_at_fence(self, number: int, unit: WatchedUnit, now_us: int) -> None:
        """A manoeuvre leaves no fence."""
        vehicle = self.flight.vehicles[number]
        flight, here = vehicle.flight, vehicle.flight.body.position
        outside = flight.airborne and (
            flight.settings.is_fenced_off(here.horizontal, -here.down) or vehicle.fence.is_outside(here)
        )
        if outside and not unit.is_outside and unit.is_manoeuvring and self._obeys(number, now_us):
            self._violate(number, "left its fence in a manoeuvre")
        unit.is_outside = outside

    # -- orders and manoeuvres ---------------------------------------------------------------------------------

    def _look_at_orders(self, number: int, unit: WatchedUnit) -> None:
        sent = self.flight.world.sent.pop(str(number), [])
        self.orders += len(sent)
        has_leave = self.flight.drawn.vehicles[number].way.kind in WITH_LEAVE
        for order in sent:
            name = type(order.command.order).__name__
            if unit.silent_since_us is not None and order.at_us > unit.silent_since_us + DEAD_US:
                self._violate(number, f"{name} over a dead link")
            if unit.taken_since_us is not None and order.at_us > unit.taken_since_us + HANDS_US:
                self._violate(number, f"{name} while its pilot has it")
            flies_itself = unit.mode not in GUIDED_MODES and not (has_leave and unit.mode in LEAVES)
            if flies_itself and order.at_us > unit.mode_since_us + HANDS_US:
                self._violate(number, f"{name} in mode {unit.mode}")

    def _look_at_platform(self, number: int, unit: WatchedUnit, now_us: int) -> None:
        node = self.flight.world.nodes[str(number)]
        platform = node.platform
        if platform is not unit.life:
            unit.life, unit.last_alarm, unit.number = platform, None, -1
            for pair in [pair for pair in self._open if pair[0] == number]:
                self._close_all(pair, now_us)
        if platform is None:
            unit.is_stranded = unit.is_stranded or unit.is_aside
            unit.is_manoeuvring, unit.reasonless_since_us = False, None
            return
        self._read_alarms(number, unit, platform, now_us)
        found = manoeuvre(platform)
        unit.is_manoeuvring, unit.is_aside = found is not None, is_aside(platform)
        if found is not None and found.number != unit.number:
            unit.number = found.number
            unit.manoeuvres += 1
        if found is None or found.reasons or unit.silent_since_us is not None:
            unit.reasonless_since_us = None
        elif unit.reasonless_since_us is None:
            unit.reasonless_since_us = now_us
        elif unit.reasonless_since_us and now_us - unit.reasonless_since_us > REASONLESS_US:
            self._violate(number, "a manoeuvre without an open reason")
            unit.reasonless_since_us = 0
        if self._steps % LISTEN_STEPS == 0:
            asked = self.flight.asked.get(number)
            refused = "" if asked is None else asked.trouble
            by_itself = "its autopilot flies it by itself" if unit.flies_itself else ""
            stranded = "its process ended while it made room, and others were notified" if unit.is_stranded else ""
            why = why_not(platform, node.notes) or self._explaining_alarm(number) or stranded
            unit.explained = refused or by_itself or why

    def _violate(self, number: int, what: str) -> None:
        self.violations.append(f"{number} at {self.flight.seconds():.1f} s: {what}")

    # -- alarms ------------------------------------------------------------------------------------------------

    def _read_alarms(self, number: int, unit: WatchedUnit, platform: Platform, now_us: int) -> None:
        events = platform.part(AlarmLog).events
        if not events or events[-1] is unit.last_alarm:
            return
        news: deque[AlarmEvent] = deque()
        for event in reversed(events):
            if event is unit.last_alarm:
                break
            news.appendleft(event)
        unit.last_alarm = events[-1]
        for event in news:
            for named in event.units:
                if named.isdigit() and int(named) != number:
                    self._on_alarm((number, int(named)), event, now_us)

    def _on_alarm(self, pair: tuple[int, int], event: AlarmEvent, now_us: int) -> None:
        held = self._open.setdefault(pair, {})
        if event.event == "opened":
            if not held and now_us - self._told_until_us.get(pair, 0) > FLICKER_US:
                self._told_since_us[pair] = now_us
            held[event.id] = event
        elif held.pop(event.id, None) is not None and not held:
            self._told_until_us[pair] = now_us

    def _close_all(self, pair: tuple[int, int], now_us: int) -> None:
        if self._open.pop(pair, None):
            self._told_until_us[pair] = now_us

    def _explaining_alarm(self, number: int) -> str:
        """An open alarm that is no monitor's: that neither can avoid, that one is silent."""
        profiles = builtin_profiles()
        for (by, other), held in self._open.items():
            for event in held.values():
                if number in {by, other} and event.monitor not in profiles:
                    return f"alarm {event.monitor}"
        return ""

    def _is_told(self, number: int, other: int, now_us: int) -> bool:
        node = self.flight.world.nodes[str(number)]
        if node.process is None or node.frozen:
            return True
        pair = number, other
        is_open = bool(self._open.get(pair)) or now_us - self._told_until_us.get(pair, 0) <= FLICKER_US
        return is_open and now_us - self._told_since_us.get(pair, now_us) >= TOLD_US

    # -- distances ---------------------------------------------------------------------------------------------

    def _listen(self, places: list[Vector], now_us: int) -> None:
        """Note which platform has a true position of which vehicle that is newer than before."""
        world = self.flight.world
        for number, other in permutations(range(len(self.units)), 2):
            platform = world.nodes[str(number)].platform
            if platform is None:
                continue
            sample = _newest(platform, self._labels[other])
            valid_us, _ = self._heard_us.get((number, other), (0, 0))
            if sample is None or sample.valid_us <= valid_us:
                continue
            latitude_deg, longitude_deg = sample.value
            north_m, east_m, _ = FRAME.to_ned(latitude_deg, longitude_deg, FRAME.altitude_m)
            if Vector(north_m, east_m, 0.0).minus(places[other]).horizontal <= TRUTHFUL_M:
                self._heard_us[number, other] = sample.valid_us, now_us

    def _measure(self, places: list[Vector], now_us: int) -> None:
        vehicles = self.flight.vehicles
        for pair in combinations(range(len(places)), 2):
            (a, b, c), (d, e, f) = places[pair[0]], places[pair[1]]
            if abs(a - d) > APART_AGAIN_M or abs(b - e) > APART_AGAIN_M or abs(c - f) > APART_AGAIN_M:
                self._near.discard(pair)
                if self.least_m <= APART_AGAIN_M:
                    continue
            flights = [vehicles[number].flight for number in pair]
            if not all(flight.airborne and flight.armed for flight in flights):
                continue
            apart_m = sqrt((a - d) ** 2 + (b - e) ** 2 + (c - f) ** 2)
            self.least_m = min(self.least_m, apart_m)
            if apart_m > APART_AGAIN_M:
                self._near.discard(pair)
            elif apart_m < LEAST_M and pair not in self._near:
                self._near.add(pair)
                self._judge(pair, apart_m, now_us)

    def _judge(self, pair: tuple[int, int], apart_m: float, now_us: int) -> None:
        one, other = pair
        heard = all(now_us - self._heard_us.get(sides, (0, 0))[1] <= HEARD_US for sides in ((one, other), (other, one)))
        able = [
            number
            for number in pair
            if (since_us := self.units[number].able_since_us) is not None and now_us - since_us >= REACT_US
        ]
        told = [self._is_told(*sides, now_us) for sides in ((one, other), (other, one))]
        words = f"{one}-{other} at {self.flight.seconds():.1f} s: {apart_m:.1f} m"
        if heard and able:
            self.breaches.append(f"{words}, {' and '.join(map(str, able))} could be commanded")
        elif all(told):
            self.told.append(words)
        else:
            why = "not heard" if not heard else "neither could be commanded"
            self.untold.append(f"{words}, {why}, told at {sum(told)} of 2 sides")


def _newest(platform: Platform, label: Label) -> Sample | None:
    """The newest sample of a stream of the platform's own instance, if there is one with a value."""
    network = platform.ports.network
    if not network.has(label):
        return None
    try:
        sample = network.snapshot(label).get_latest_vtime()
    except ValueNotAvailable:
        return None
    return None if sample.value is NO_VALUE else sample
