"""What a partner's proposal has to rest on: a warning of ours, or what is seen of the partner, and then seldom."""

from agents.flight.encounters import converge
from agents.flight.places import Fix
from dyknow.model.errors import Refused

BUDGET_US = 30_000_000
SLACK = 0.25


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
