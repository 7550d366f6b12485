"""Drivers and their vehicles: kinds, how each is driven, and where each is at an instant."""

from typing import Literal, NamedTuple, TypeAlias

from numpy.random import Generator

RoadKind: TypeAlias = Literal["car", "motorcycle", "truck"]


class Build(NamedTuple):
    """Metres; m/s^2 forwards and comfortable backwards; the range of speeds that drivers of it like, m/s."""

    length_m: float
    width_m: float
    height_m: float
    speeds_up_m_s2: float
    brakes_m_s2: float
    slowest_m_s: float
    fastest_m_s: float


BUILDS: dict[RoadKind, Build] = {
    "car": Build(4.5, 1.8, 1.5, 2.0, 2.5, 10.0, 14.0),
    "motorcycle": Build(2.2, 0.8, 1.4, 3.0, 3.0, 11.0, 15.0),
    "truck": Build(9.0, 2.5, 3.2, 1.0, 2.0, 7.0, 10.0),
}
COLOURS = ("black", "blue", "green", "grey", "red", "white", "yellow")


class Driver(NamedTuple):
    """A vehicle and where it is driven.

    Attributes:
        route: crossings in order, neighbours each; from the last one on, chance decides at every crossing.
        start_m: where it begins, from the rim of the first crossing.
        enters_us: when.
        cruise_m_s: its speed where nothing hinders; the limits of the road hold all the same.
        passes: whether it overtakes what is slower.
    """

    name: str
    route: tuple[str, ...]
    start_m: float = 5.0
    enters_us: int = 0
    cruise_m_s: float = 12.0
    kind: RoadKind = "car"
    colour: str = "grey"
    lane: int = 0
    passes: bool = True


class RoadState(NamedTuple):
    """The truth about one vehicle: its middle and heading; the link (and in which direction), or the crossing, on which it is.

    Attributes:
        passing: the name of the vehicle that it overtakes.
    """

    name: str
    kind: RoadKind
    colour: str
    x_m: float
    y_m: float
    heading_rad: float
    speed_m_s: float
    link: str | None
    direction: int
    crossing: str | None
    passing: str | None

    @property
    def bottom_m(self) -> float:
        """Above the ground."""
        return 0.0

    @property
    def length_m(self) -> float:
        return BUILDS[self.kind].length_m

    @property
    def height_m(self) -> float:
        return BUILDS[self.kind].height_m


def drawn(name: str, route: tuple[str, ...], rng: Generator, *, start_m: float = 5.0, enters_us: int = 0) -> Driver:
    """A driver by chance: eight cars to one truck and one motorcycle, at a speed usual with it."""
    kinds: tuple[RoadKind, ...] = ("car",) * 8 + ("truck", "motorcycle")
    kind = kinds[int(rng.integers(len(kinds)))]
    build = BUILDS[kind]
    cruise = float(rng.uniform(build.slowest_m_s, build.fastest_m_s))
    colour = COLOURS[int(rng.integers(len(COLOURS)))]
    return Driver(name, route, start_m, enters_us, cruise, kind, colour)
