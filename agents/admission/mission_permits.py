"""Permission to command vehicles in missions: a command centre has it, another platform what a command centre permits it.

A permit is for one mission and the platforms that may lead it, and runs out after an hour. What a delegation says of where it
comes from proves nothing: only what a command centre itself has sent to this platform counts.
"""

from collections.abc import Callable
from typing import Final

from agents.actions import Role
from dyknow.model.errors import Refused

STAND_US: Final = 3_600_000_000
MOST: Final = 64
"""Permits that stand at once; a newer one takes the place of the oldest."""


class Permits:
    """The permits of one platform. Times are the node clock.

    Args:
        role_of: what a unit may ask for.
    """

    def __init__(self, unit: str, role_of: Callable[[str], Role]) -> None:
        self._unit, self._role_of = unit, role_of
        self._leaders: dict[str, tuple[frozenset[str], int]] = {}

    def permit(self, mission: str, leaders: frozenset[str], now_us: int) -> None:
        """Let these lead it."""
        self._leaders.pop(mission, None)
        self._leaders[mission] = leaders, now_us + STAND_US
        if len(self._leaders) > MOST:
            del self._leaders[next(iter(self._leaders))]

    def leaders(self, mission: str, now_us: int) -> frozenset[str]:
        """The platforms that may lead it."""
        leaders, until_us = self._leaders.get(mission, (frozenset[str](), 0))
        return leaders if now_us < until_us else frozenset()

    def end(self, mission: str) -> None:
        """The mission is over."""
        self._leaders.pop(mission, None)

    def check(self, mission: str, sender: str, now_us: int) -> None:
        """Raise Refused if `sender` may not command the vehicle in that mission: `role`."""
        if self._role_of(sender) is Role.COMMAND_CENTRE:
            return
        if sender not in self.leaders(mission, now_us):
            raise Refused(
                f"{sender} may not command the vehicle of {self._unit} in mission {mission}: "
                "a command centre has not permitted it (permit-mission)",
                "role",
            )

    def check_chain(self, chain: tuple[str, ...], sender: str) -> None:
        """Raise Refused if a delegation does not come from the last of its chain, or has been here: `chain`."""
        if chain and chain[-1] != sender:
            raise Refused(f"the chain of delegation ends with {chain[-1]}, and {sender} sends it", "chain")
        if self._unit in chain:
            raise Refused(f"it was delegated by {self._unit} already: {' > '.join(chain)}", "chain")
