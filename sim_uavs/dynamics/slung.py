"""Loads below a vehicle: things, and a winch with a magnet as the flight, the autopilot and faults see it."""

from typing import Literal, NamedTuple, Protocol, TypeAlias

from dyknow.sim_uavs.dynamics.quadcopter import Body

ThingKind: TypeAlias = Literal["box", "carrier"]


class Thing(NamedTuple):
    """A thing that can be lifted, and its first place: metres east and north of the scenario's origin."""

    name: str
    kind: ThingKind
    colour: str
    x_m: float
    y_m: float


class HoistFaults(NamedTuple):
    """The faults of a hoist: the magnet does not take hold; how far from below it a released thing comes down."""

    grips_nothing: bool = False
    misplaces_m: float = 0.0


class Hoist(Protocol):
    """A winch with a magnet at the end of its line.

    Attributes:
        line_m, speed_m_s: of the line that is out; positive: it is let out.
        rate_m_s: the fastest that it moves.
        faults: its faults.
    """

    line_m: float
    speed_m_s: float
    rate_m_s: float
    faults: HoistFaults

    @property
    def load_kg(self) -> float:
        """The mass on the line; 0 while it is slack."""

    def relax(self) -> None:
        """Stop the motor."""

    def let_out(self, length_m: float) -> float:
        """Let out so much more than is out now; negative: wind in. The length that it will be."""

    def let_out_at(self, speed_m_s: float) -> None:
        """Let out at a speed; negative: wind in."""

    def grip(self) -> None:
        """Switch the magnet on."""

    def release(self, now_us: int) -> None:
        """Switch the magnet off: its thing falls."""

    def drop(self, now_us: int) -> None:
        """Lose what is held."""

    def step(self, body: Body, now_us: int) -> None:
        """20 ms, the vehicle being where `body` is then."""
