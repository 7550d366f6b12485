"""Arbitration between the commanders of a vehicle, and the orders that its state forbids to all.

One of its commanders has it: its pilot's own hands (a mode that takes no positions, and whatever has happened
since until a user asks for something), then giving way to another vehicle, then a mission, then a single order, then the
route that the platform was started with. A user's own order has the mission wait. A vehicle that stands disarmed is in no hands.

Each rule about the vehicle's state is a sentence, or None where it forbids nothing. Where the vehicle may be sent is in
`dyknow.agents.places`.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Final, NamedTuple

from dyknow.model.errors import Refused
from dyknow.navigation import vehicle

HEARD_WITHIN_US = 3_000_000
_FOR_MISSIONS = vehicle.InterruptOrder | vehicle.ResumeMissionOrder | vehicle.MissionItemOrder
"""Orders that may be sent to a vehicle in AUTO: to leave its mission, and to continue it."""
NO_CONTROL: Final = "this platform was not given control of its vehicle (join with --control)"
_MODE = "the vehicle is in mode {}"
ENDINGS: Final = vehicle.LandOrder | vehicle.ReturnHomeOrder
ANY_MODE: Final = vehicle.HoldOrder | ENDINGS
"""Orders that a user may give in every mode: to stop, to land and to return need no positions."""
GROUND: Final = vehicle.SetGuided | vehicle.Arm | vehicle.TakeOffOrder
"""Orders with which a mission takes off."""


MISSIONS = 64
"""Missions that may join, as far as they are remembered."""


class Commander(IntEnum):
    """A commander of a vehicle; of two the greater one has it."""

    NONE = 0
    ROUTE = 1
    ORDER = 2
    MISSION = 3
    AVOIDANCE = 4
    HANDS = 5


WORDS = {
    Commander.ROUTE: "plan", Commander.ORDER: "order", Commander.MISSION: "mission", Commander.AVOIDANCE: "diverted",
}  # fmt: skip


@dataclass(slots=True)
class MissionClaim:
    """The mission that commands a vehicle, or would.

    Attributes:
        name: of the mission; empty: there is none.
        waits: why it commands nothing now; empty: it does.
        refusal: why the autopilot did not do what was last ordered on the ground.
        looks: whether it needs the camera, which then looks straight down.
    """

    name: str = ""
    waits: str = ""
    refusal: str = ""
    looks: bool = False

    def wait(self, reason: str) -> None:
        """Command nothing until a user has it continue; the first reason counts."""
        self.waits = self.waits or (reason if self.name else "")


class AwaitedMissions:
    """Missions that may join, each with why it commands nothing then; empty: it commands at once.

    A user's own order holds them all, whether they were ended since or not, until the user resumes, or permits one again.
    """

    def __init__(self) -> None:
        self._why: dict[str, str] = {}

    def expect(self, name: str, waits: str = "") -> None:
        """Remember that a mission may join; beyond `MISSIONS` one that does not wait is forgotten first."""
        self._why[name] = waits
        if len(self._why) > MISSIONS:
            del self._why[next((each for each, why in self._why.items() if not why), next(iter(self._why)))]

    def wait(self, reason: str) -> None:
        """All command nothing until `resume`; the first reason counts."""
        self._why = {name: why or reason for name, why in self._why.items()}

    def resume(self) -> bool:
        """All command from now on; whether one waited."""
        waited = any(self._why.values())
        self._why = dict.fromkeys(self._why, "")
        return waited

    def joins(self, name: str) -> MissionClaim:
        """The claim of one that joins."""
        return MissionClaim(name, self._why.pop(name, ""))

    def leaves(self, claim: MissionClaim, *, is_over: bool) -> None:
        """Note that a mission leaves; a mission that waits still does when it joins again, even if its leader ended it."""
        if claim.name and (claim.waits or not is_over):
            self.expect(claim.name, claim.waits)


class CommandClaims(NamedTuple):
    """Claims to command a vehicle, in the order of `Commander`, each a reason or name; empty: none."""

    route: str = ""
    order: str = ""
    mission: str = ""
    avoidance: str = ""
    hands: str = ""

    @property
    def commander(self) -> Commander:
        """The one that does."""
        return Commander(max((at for at, claim in enumerate(self, 1) if claim), default=0))

    def check(self, by: Commander) -> None:
        """Raise Refused if another one goes before `by`, naming it: `hands`, `giving-way`, `mission`."""
        first = self.commander
        if first <= by:
            return
        if first is Commander.HANDS:
            raise Refused(f"{self.hands}: nothing is sent until a user asks for it", "hands")
        if first is Commander.AVOIDANCE:
            raise Refused(f"{self.avoidance}; ask again when it flies on", "giving-way")
        raise Refused(f"mission {self.mission} commands the vehicle: end it with dyknow mission abort", "mission")


def _unheard(status: vehicle.StatusReport | None, silent_us: int) -> str | None:
    if status is None:
        return "the vehicle has not reported its state"
    return f"no heartbeat for {silent_us / 1e6:.1f} s" if silent_us > HEARD_WITHIN_US else None


def grounded(order: vehicle.Order, status: vehicle.StatusReport | None, silent_us: int, *, control: bool) -> str | None:
    """Why an order for taking off may not be sent: only a vehicle that stands disarmed is put into a guided mode."""
    if not control:
        return NO_CONTROL
    unheard = _unheard(status, silent_us)
    if unheard is not None or status is None:
        return unheard
    if status.airborne:
        return "the vehicle is airborne"
    if isinstance(order, vehicle.SetGuided):
        return "the vehicle is armed, and its pilot chose its mode" if status.armed else None
    if not status.guided:
        return _MODE.format(status.mode) + ", which takes no positions"
    return "the vehicle is not armed" if isinstance(order, vehicle.TakeOffOrder) and not status.armed else None


def unready(status: vehicle.StatusReport | None, silent_us: int, *, control: bool) -> str | None:
    """Why no order at all may be sent; `silent_us`: since when nothing has been heard."""
    if not control:
        return NO_CONTROL
    unheard = _unheard(status, silent_us)
    if unheard is not None or status is None:
        return unheard
    if not status.armed:
        return "the vehicle is not armed"
    return None if status.airborne else "the vehicle is not airborne"


def unguided(
    order: vehicle.Order, status: vehicle.StatusReport | None, *, missions: bool, in_person: bool = False
) -> str | None:
    """Why the vehicle's mode forbids `order`.

    Args:
        order: the order that would be sent.
        status: the vehicle's.
        missions: whether a mission may be interrupted to give way.
        in_person: whether a user asks for it.
    """
    if status is None or status.guided or (in_person and isinstance(order, ANY_MODE)):
        return None
    if missions and status.mode in vehicle.INTERRUPTIBLE_MODES:
        only = ": only giving way interrupts a mission"
        return None if isinstance(order, _FOR_MISSIONS) else _MODE.format(status.mode) + only
    if status.mode not in vehicle.MISSION_MODES:
        return _MODE.format(status.mode) + ", which takes no positions; a guided mode is needed"
    remedy = "a guided mode is needed; --control auto lets it be interrupted to give way"
    return f"{_MODE.format(status.mode)}, which takes no positions; {remedy}"


def in_words(order: vehicle.Order) -> str:
    """The order, as users write it."""
    match order:
        case vehicle.GoToOrder() | vehicle.InterruptOrder():
            return f"goto {order.latitude_deg:.6f} {order.longitude_deg:.6f} at {order.altitude_m:.1f} m"
        case _:
            return type(order).__name__.removesuffix("Order").lower()
