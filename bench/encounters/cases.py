"""What is flown, as data: where each vehicle flies, how fast and how high, and what goes wrong."""

import random
from collections.abc import Mapping
from typing import Final, Literal, NamedTuple, TypeAlias

from bench.encounters.arducopter import Place

HALF_M, UP_M, LOW_M = 120.0, 45.0, 20.0
"""`UP_M` is high enough to climb or to descend by 25 m between floor (10 m) and ceiling (120 m); `LOW_M` is not."""
THERE_M: Final = 3.0
YIELDS: Final = 1
"""Of two that are equal the first by name goes first: what goes wrong with one of two goes wrong with the other."""
LOOK_S, MEETING_M = 12.0, 15.0
"""A meeting is one that comes nearer than this so soon."""
Begins: TypeAlias = Literal["goto", "AUTO", "RTL", "LAND", "land task", "hover"]


class Way(NamedTuple):
    """From here to there: north and east as parts of the half way, then metres beside that (to the north) and of height.

    Attributes:
        late_s: how far behind its place it starts, in its own time.
        is_other: whether it flies at the other speed of the case.
        via: a waypoint between them, as parts of the half way.
    """

    start: tuple[float, float]
    end: tuple[float, float]
    beside_m: float = 0.0
    higher_m: float = 0.0
    late_s: float = 0.0
    is_other: bool = False
    begins: Begins = "goto"
    via: tuple[float, float] | None = None


_THIRD = 3.0**0.5 / 2.0
_HEAD_ON = (Way((0, -1), (0, 1)), Way((0, 1), (0, -1), is_other=True), Way((1, 0), (-1, 0), is_other=True))
_HOVER = Way((0, 0), (0, 0), begins="hover")
WAYS: Final[Mapping[str, tuple[Way, ...]]] = {
    "head-on": _HEAD_ON,
    "crossing": (Way((-1, 0), (1, 0)), Way((0, -1), (0, 1), is_other=True), Way((0.7, -0.7), (-0.7, 0.7))),
    "overtaking": (
        Way((0, -1), (0, 2)), Way((0, 85 / 120 - 1), (0, 1.2), is_other=True), Way((0, 2), (0, -1)),
    ),
    "one point": (
        Way((-1, 0), (1, 0)), Way((0.5, -_THIRD), (-0.5, _THIRD)), Way((0.5, _THIRD), (-0.5, -_THIRD)),
    ),
    "one waypoint": (
        Way((-1, 0), (1, 0), via=(0, 0)), Way((0, -1), (0, 1), via=(0, 0)), Way((1, 0), (0, -1), via=(0, 0)),
    ),
    "opposite, 50 m beside": (Way((0, -1), (0, 1)), Way((0, 1), (0, -1), beside_m=50.0, is_other=True)),
    "same way, 50 m beside": (Way((0, -1), (0, 1)), Way((0, -0.8), (0, 0.8), beside_m=50.0, is_other=True)),
    "past one that hovers 45 m beside": (
        Way((0, -1), (0, 1)), _HOVER._replace(beside_m=45.0),
    ),
    "crossing behind": (Way((0, -1), (0, 1)), Way((-1, 0), (1, 0), late_s=8.0)),
    "landing above": (_HOVER, Way((0, 0), (0, 0), higher_m=40.0, begins="LAND")),
    "landing above by a task": (_HOVER, Way((0, 0), (0, 0), higher_m=40.0, begins="land task")),
}  # fmt: skip
HARMLESS: Final = frozenset(
    {"opposite, 50 m beside", "same way, 50 m beside", "past one that hovers 45 m beside", "crossing behind"}
)
"""Where nothing has to be ordered."""


class Trouble(NamedTuple):
    """What happens in flight to a vehicle's platform or link.

    Attributes:
        vehicle: None: the first that is ordered to manoeuvre.
        before_s: so long before the meeting can be seen; None: `after_s` the first order.
    """

    what: Literal["kill platform", "cut link"]
    vehicle: int | None = None
    before_s: float | None = None
    after_s: float = 2.0
    lasts_s: float = float("inf")


TROUBLES: Final[Mapping[str, Trouble]] = {
    "platform of the one that manoeuvres killed": Trouble("kill platform"),
    "link of the one that manoeuvres cut for 15 s": Trouble("cut link", lasts_s=15.0),
    "link of 0 cut before": Trouble("cut link", 0, 2.5),
    "link of 1 cut before": Trouble("cut link", 1, 2.5),
    "platform of 0 killed before": Trouble("kill platform", 0, 2.5),
    "platform of 1 killed before": Trouble("kill platform", 1, 2.5),
    "link of 0 away for 4 s": Trouble("cut link", 0, 2.0, lasts_s=4.0),
    "link of 1 away for 5 s": Trouble("cut link", 1, 2.5, lasts_s=5.0),
}
CEILING_M, FENCE_M = 30.0, 40.0
FAULTS = (
    "none", "fence", "refuses", "one AUTO", "both AUTO", "both AUTO, may interrupt", "streams", "both stream",
    "acks lost", "pilot takes over", "autopilot killed",
)  # fmt: skip
LOW_FAULTS = (
    "ceiling 30 m", "fences 40 m", "stations through the platforms", "both RTL", "both RTL, may interrupt", *TROUBLES,
)  # fmt: skip
NEITHER = frozenset({"both AUTO", "both stream", "both RTL"})
"""Where neither can avoid the other: both operators are to be told that, no more can be asked for."""


class Case(NamedTuple):
    """What is flown: `geometry` of `WAYS`, at a speed, by two or three; `fault` of `FAULTS` or `LOW_FAULTS`.

    Attributes:
        up_m: how high, above the ground.
        other_m_s: the speed of those that fly at another one.
        half_m: from a start to where the ways meet.
        wind_m_s: from the south-east, the same at every height.
    """

    geometry: str
    speed_m_s: float
    vehicles: int = 2
    fault: str = "none"
    seed: int = 1
    up_m: float = UP_M
    other_m_s: float | None = None
    half_m: float = HALF_M
    wind_m_s: float = 0.0

    @property
    def name(self) -> str:
        what = "" if self.fault == "none" else f", {self.fault}"
        what += f", wind {self.wind_m_s:.0f} m/s" if self.wind_m_s else ""
        up = "" if self.up_m == UP_M else f", {self.up_m:.0f} m up"
        other = "" if self.other_m_s is None else f" and {self.other_m_s:.0f}"
        return f"{self.vehicles} {self.geometry}, {self.speed_m_s:.0f}{other} m/s{up}{what}, seed {self.seed}"

    @property
    def is_harmless(self) -> bool:
        return self.geometry in HARMLESS


class Leg(NamedTuple):
    start: Place
    end: Place
    speed_m_s: float
    begins: Begins = "goto"
    via: Place | None = None

    @property
    def home(self) -> Place:
        """Where it takes off: a vehicle that returns goes to its end."""
        return (self.end if self.begins == "RTL" else self.start)._replace(up_m=0.0)

    @property
    def stays(self) -> bool:
        """Whether it has no way to fly."""
        return self.start[:2] == self.end[:2]

    def is_there(self, place: Place, within_m: float = THERE_M) -> bool:
        """Whether that place is its end; of one that returns at any height."""
        end = self.end._replace(up_m=place.up_m) if self.begins == "RTL" else self.end
        return place.distance_m(end) < within_m


def legs(case: Case) -> list[Leg]:
    """Where each flies, drawn about the geometry: a few metres aside, a few metres early."""
    rng = random.Random(f"{case.geometry} {case.vehicles} {case.seed}")
    found: list[Leg] = []
    for way in WAYS[case.geometry][: case.vehicles]:
        speed = case.speed_m_s
        if way.is_other:
            slower = speed / 2.0 if case.geometry == "overtaking" else speed
            speed = slower if case.other_m_s is None else case.other_m_s
        start = Place(
            way.start[0] * case.half_m + way.beside_m + rng.uniform(-2.0, 2.0),
            way.start[1] * case.half_m + rng.uniform(-4.0, 4.0),
            case.up_m + way.higher_m + rng.uniform(-1.5, 1.5),
        )
        if way.late_s:
            start = start._replace(north_m=start.north_m - way.late_s * speed)
        begins = _begins(case, way, len(found))
        end = Place(way.end[0] * case.half_m + way.beside_m, way.end[1] * case.half_m, start.up_m)
        if way.start == way.end:
            exact = Place(way.beside_m, 0.0, case.up_m + way.higher_m)
            start, end = exact, exact._replace(up_m=0.0) if begins == "LAND" else exact
        via = way.via and Place(way.via[0] * case.half_m, way.via[1] * case.half_m, start.up_m)
        found.append(Leg(start, end, speed, begins, via))
    return found


def _begins(case: Case, way: Way, number: int) -> Begins:
    if case.fault.startswith("both AUTO") or (case.fault == "one AUTO" and number == YIELDS):
        return "AUTO"
    return "RTL" if case.fault.startswith("both RTL") else way.begins


def common() -> list[Case]:
    """Twenty that go well, with their seeds; then each fault at both speeds."""
    pairs = [
        Case(geometry, speed_m_s, 2, "none", seed)
        for geometry in ("head-on", "crossing", "overtaking")
        for speed_m_s in (5.0, 10.0)
        for seed in (1, 2)
    ]
    threes = [
        Case(geometry, speed_m_s, 3, "none", seed)
        for geometry, seeds in (("head-on", (1, 2)), ("crossing", (1,)), ("overtaking", (1,)))
        for speed_m_s in (5.0, 10.0)
        for seed in seeds
    ]
    faults = [Case("head-on", speed_m_s, 2, fault, 3) for fault in FAULTS[1:] for speed_m_s in (5.0, 10.0)]
    return pairs + threes + faults


def low() -> list[Case]:
    """20 m above the ground, where there is no room to descend, the gravest first."""
    three = [Case("one point", 10.0, 3, seed=seed, up_m=LOW_M) for seed in (1, 2, 3, 4)]
    lost = [
        *(Case("head-on", speed_m_s, fault=fault, up_m=LOW_M) for fault in list(TROUBLES)[:1] for speed_m_s in (5.0, 10.0)),
        *(Case("head-on", 5.0, fault=fault, up_m=LOW_M) for fault in list(TROUBLES)[1:]),
    ]  # fmt: skip
    landing = [Case("landing above", 5.0, up_m=LOW_M), Case("landing above by a task", 5.0, up_m=LOW_M)]
    ways = [
        Case("head-on", speed_m_s, 2, fault, up_m=LOW_M)
        for fault in LOW_FAULTS[:3]
        for speed_m_s in (5.0, 10.0)
        if fault == "ceiling 30 m" or speed_m_s == 5.0
    ]
    threes = [Case("one point", 5.0, 3, up_m=LOW_M), *(Case("head-on", v, 3, up_m=LOW_M) for v in (5.0, 10.0))]
    returning = [Case("head-on", 5.0, 2, fault, up_m=LOW_M) for fault in LOW_FAULTS[3:5]]
    missions = [
        *(Case("head-on", v, 2, "both AUTO, may interrupt", up_m=LOW_M) for v in (5.0, 10.0)),
        Case("one waypoint", 5.0, 2, "both AUTO, may interrupt", up_m=LOW_M),
    ]
    harmless = [
        Case("opposite, 50 m beside", 5.0, up_m=LOW_M),
        Case("same way, 50 m beside", 7.0, up_m=LOW_M, other_m_s=5.0),
        Case("past one that hovers 45 m beside", 5.0, up_m=LOW_M),
        Case("crossing behind", 5.0, up_m=LOW_M),
    ]
    plain = [
        *(Case("head-on", v, up_m=LOW_M) for v in (5.0, 10.0)),
        Case("head-on", 3.0, up_m=LOW_M, other_m_s=12.0),
        Case("overtaking", 12.0, up_m=LOW_M, other_m_s=3.0),
        Case("crossing", 10.0, up_m=LOW_M),
        Case("head-on", 10.0, up_m=LOW_M, wind_m_s=8.0),
        Case("head-on", 5.0, fault="streams", up_m=LOW_M),
    ]
    far = [Case("head-on", 10.0, 2, "link of 0 cut before", up_m=LOW_M, half_m=190.0)]
    return [*three, *lost, *landing, *ways, *threes, *returning, *missions, *harmless, *plain, *far]


LISTS: Final = {"common": common, "low": low}
