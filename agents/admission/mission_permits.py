"""Permission to command vehicles in missions: a command centre has it, another platform what a command centre permits it.

A permit is for one mission and names its leader and those that may succeed it, in their order, and runs out after an hour. A
successor is obeyed only when all before it are gone here. What a delegation says of where it comes from proves nothing: only
what a command centre itself has sent to this platform, and which platforms are here, counts.
"""

from collections.abc import Callable
from typing import Final

from agents.actions import Role
from dyknow.model.errors import Refused
from federation.members.directory import DirectoryFacilitator

STAND_US: Final = 3_600_000_000
MOST: Final = 64
"""Permits that stand at once; a newer one takes the place of the oldest."""


class Permits:
    """The permits of one platform. Times are the node clock.

    Args:
        role_of: what a unit may ask for.
        may_lead: whether a unit is here and could lead: one that has no vehicle passes a mission on.
    """

    def __init__(self, unit: str, role_of: Callable[[str], Role], may_lead: Callable[[str], bool]) -> None:
        self._unit, self._role_of, self._may_lead = unit, role_of, may_lead
        self._leaders: dict[str, tuple[tuple[str, ...], int]] = {}

    def permit(self, mission: str, leaders: tuple[str, ...], now_us: int) -> None:
        """Let the first of these lead it, and each next one when all before it are gone."""
        self._leaders.pop(mission, None)
        self._leaders[mission] = leaders, now_us + STAND_US
        if len(self._leaders) > MOST:
            del self._leaders[next(iter(self._leaders))]

    def leaders(self, mission: str, now_us: int) -> tuple[str, ...]:
        """The platforms that may lead it, in their order."""
        leaders, until_us = self._leaders.get(mission, ((), 0))
        return leaders if now_us < until_us else ()

    def end(self, mission: str) -> None:
        """The mission is over."""
        self._leaders.pop(mission, None)

    def check(self, mission: str, sender: str, now_us: int) -> None:
        """Raise Refused if `sender` may not command the vehicle in that mission: `role`; `succession`: one before it is here."""
        if self._role_of(sender) is Role.COMMAND_CENTRE:
            return
        leaders = self.leaders(mission, now_us)
        if sender not in leaders:
            raise Refused(
                f"{sender} may not command the vehicle of {self._unit} in mission {mission}: "
                "a command centre has not permitted it (permit-mission)",
                "role",
            )

        for before in leaders[: leaders.index(sender)]:
            if self._may_lead(before):
                text = f"{sender} may lead mission {mission} only when {before} is gone, which is here"
                raise Refused(text, "succession", leader=before)

    def check_chain(self, chain: tuple[str, ...], sender: str) -> None:
        """Raise Refused if a delegation does not come from the last of its chain, or has been here: `chain`."""
        if chain and chain[-1] != sender:
            raise Refused(f"the chain of delegation ends with {chain[-1]}, and {sender} sends it", "chain")
        if self._unit in chain:
            raise Refused(f"it was delegated by {self._unit} already: {' > '.join(chain)}", "chain")


def leads_here(directory: DirectoryFacilitator) -> Callable[[str], bool]:
    """Whether a unit is here and has a vehicle, and so may lead missions."""

    def may_lead(unit: str) -> bool:
        if unit == directory.unit:
            return True
        entry = directory.entry(unit)
        flies = entry is not None and any(service.service == "flight" for service in entry.services)
        return flies and directory.is_present(unit)

    return may_lead
