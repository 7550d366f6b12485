"""What is seen of a partner, whether that is credible, and what its proposal has to rest on: a warning of ours or that."""

from itertools import pairwise
from typing import Final

from agents.exchange.gateway import Gateway
from agents.flight.encounters import converge, leaps
from agents.flight.places import Fix
from dyknow import NO_VALUE, Sample
from dyknow.model.errors import Refused, UnknownLabel, ValueNotAvailable

BUDGET_US = 30_000_000
SLACK = 0.25
LOOK_BACK_US, SILENT_US = 3_000_000, 20_000_000
_JUDGED: Final = {"altitude": "heli-altitude", "position": "heli-position"}


class Evidence:
    """Times (node clock) of manoeuvres that were agreed to without a warning of ours, by partner."""

    def __init__(self) -> None:
        self._agreed_us: dict[str, int] = {}

    def refusal(self, partner: str, own: Fix, other: Fix, now_us: int, *, warned: bool) -> Refused | None:
        """Why the proposal of `partner` is refused, or None."""
        if warned:
            return None
        if not converge(own, other, SLACK):
            return Refused(f"nothing here shows that {partner} comes near", "no-evidence")
        if now_us < self._agreed_us.get(partner, -BUDGET_US) + BUDGET_US:
            return Refused(f"one manoeuvre for {partner} in 30 s without a warning of ours", "too-often")
        return None

    def spend(self, partner: str, now_us: int, *, warned: bool) -> None:
        if not warned:
            self._agreed_us[partner] = now_us


def leap_of(gateway: Gateway, unit: str, until_us: int) -> str | None:
    """Whether altitude or position of that unit has changed, in 3 s, as that of no aircraft does: in words, or None.

    The sample before counts as well, however long none has come: a filter withholds its own leaps for a while.
    """
    for name, label in _JUDGED.items():
        samples = _samples(gateway, label, unit, until_us)
        fixes = [_judged(name, sample) for sample in samples if sample.value is not NO_VALUE]
        new = ((before, after) for before, after in pairwise(fixes) if after.valid_us >= until_us - LOOK_BACK_US)
        if any(leaps(before, after) for before, after in new):
            return f"the {name} of {unit} has leapt"
    return None


def _samples(gateway: Gateway, label: str, unit: str, until_us: int) -> list[Sample]:
    """What is known of the longest silence, else of the last 3 s; nothing of a history that is shorter."""
    for back_us in (SILENT_US, LOOK_BACK_US):
        try:
            return gateway.between(label, until_us - back_us, until_us, until_us, unit)
        except (ValueNotAvailable, UnknownLabel, Refused):
            continue
    return []


def _judged(name: str, sample: Sample) -> Fix:
    """A fix whose kind alone is known."""
    if name == "altitude":
        return Fix(sample.valid_us, 0.0, 0.0, *sample.value)
    latitude_deg, longitude_deg = sample.value
    return Fix(sample.valid_us, latitude_deg, longitude_deg, 0.0)


def fix_of(gateway: Gateway, unit: str) -> Fix | None:
    """Position and, where it is known, velocity of a unit; None where there is no position."""
    try:
        position = gateway.latest("heli-position", unit)
        altitude = gateway.latest("heli-altitude", unit)
    except (ValueNotAvailable, UnknownLabel):
        return None
    if NO_VALUE in (position.value, altitude.value):
        return None
    return Fix(position.valid_us, *position.value, *altitude.value, *_velocity(gateway, unit))


def _velocity(gateway: Gateway, unit: str) -> tuple[float, ...]:
    """North, east, down in m/s, or nothing where it is not known."""
    try:
        value = gateway.latest("heli-velocity", unit).value
    except (ValueNotAvailable, UnknownLabel):
        return ()
    return () if value is NO_VALUE else tuple(value)
