"""What avoidance asks for: proposals to the partner, a diversion, the way back, an alarm."""

from typing import NamedTuple, TypeAlias

from agents.flight.encounters import ManoeuvreRole


class Propose(NamedTuple):
    """Ask `partner` to agree that `climber` climbs while the other holds; `level`: what this side does for another."""

    partner: str
    climber: str
    climb_m: float
    level: ManoeuvreRole | None = None


class LeaveToPartner(NamedTuple):
    """Ask `partner` to take the whole manoeuvre, since we cannot, and why."""

    partner: str
    reason: str


class Divert(NamedTuple):
    """Stop, at this altitude (metres above mean sea level) or the present one; at that place, or here."""

    altitude_m: float | None
    place: tuple[float, float] | None = None


class ResumeRoute(NamedTuple):
    """Fly on; not below `raised_to_m` nor above `lowered_to_m` while these are given."""

    raised_to_m: float | None = None
    lowered_to_m: float | None = None


class NeitherCan(NamedTuple):
    """Neither of the two avoids the other, and why (ours, theirs)."""

    partner: str
    reasons: tuple[str, str]


class Over(NamedTuple):
    """The encounter with `partner` is over."""

    partner: str


Step: TypeAlias = Propose | LeaveToPartner | Divert | ResumeRoute | NeitherCan | Over
