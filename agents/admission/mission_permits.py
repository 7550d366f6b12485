"""Permission to command vehicles in missions: a command centre has it, another platform what a command centre permits it.

A permit is for one mission and names its leader and those that may succeed it, in their order, and runs out after an hour. A
successor is obeyed only when all before it are gone here: `dyknow.agents.tasks.authority`. A leader carries the permit, which is the
command centre's act, to the vehicles that it names. A delegation's own statement of its origin proves nothing.
"""

from collections.abc import Callable
from typing import Final

from dyknow.agents.actions import Role
from dyknow.agents.tasks.authority import PERMIT_US, Authority, TaskEvidence
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.contents import PermitMission
from dyknow.model.errors import Refused

MOST: Final = 64
"""Permits that stand at once; a newer one takes the place of the oldest."""


class Permits:
    """The permits of one platform. Times are the node clock.

    Args:
        role_of: unit -> its role.
        authority: knows the order of succession, and which platforms are here.
    """

    def __init__(self, unit: str, role_of: Callable[[str], Role], authority: Authority) -> None:
        self._unit, self._role_of, self._authority = unit, role_of, authority
        self._permits: dict[str, tuple[TaskEvidence, int]] = {}
        authority.on_over.append(lambda mission, _now_us: self.end(mission))
        authority.held.append(lambda: [permit for permit, _ in self._permits.values()])

    def permit(self, permit: TaskEvidence, now_us: int) -> None:
        """Let the first that it names lead it, and each next one when all before it are gone."""
        self._permits.pop(permit.task, None)
        self._permits[permit.task] = permit, now_us + PERMIT_US
        if len(self._permits) > MOST:
            del self._permits[next(iter(self._permits))]

    def of(self, mission: str, now_us: int) -> TaskEvidence | None:
        """The permit that stands for a mission."""
        permit, until_us = self._permits.get(mission, (None, 0))
        return permit if now_us < until_us else None

    def show(self, act: Act, mission: str, now_us: int) -> None:
        """Take the permit that an act of another platform carries, where none is known yet.

        Raises:
            Refused: `unproven`: it is not of a command centre, or not for this vehicle; `cancelled`: the mission is over.
        """
        if not act.evidence or self.of(mission, now_us) is not None:
            return
        permit = self._authority.proven(act, mission, (PermitMission,), now_us)
        if not isinstance(permit.content, PermitMission) or self._unit not in permit.content.vehicles:
            raise Refused(f"the permit for mission {mission} does not name the vehicle of {self._unit}", "unproven")
        self.permit(permit, now_us + min(0, permit.made_us - now_us))

    def end(self, mission: str) -> None:
        """The vehicle takes part in it no more."""
        self._permits.pop(mission, None)

    def check(self, mission: str, sender: str, boot: int, now_us: int) -> None:
        """Raise Refused if `sender` may not command the vehicle in that mission: `role`; `succession`: one before it is here."""
        if self._role_of(sender) is Role.COMMAND_CENTRE:
            return
        permit = self.of(mission, now_us)
        if permit is None:
            raise Refused(
                f"{sender} may not command the vehicle of {self._unit} in mission {mission}: "
                "a command centre has not permitted it (permit-mission)",
                "role",
            )
        self._authority.check_leads(permit, sender, boot, now_us)

    def check_succeeds(self, mission: str, delegator: str, now_us: int) -> None:
        """Raise Refused if this platform may not lead a mission whose leader is gone, or `delegator` could not have it flown: `role`."""
        permit = self.of(mission, now_us)
        if permit is None:
            if self._role_of(self._unit) is Role.COMMAND_CENTRE:  # there is no roster
                return
            raise Refused(f"a command centre has not permitted it (permit-mission {mission})", "role")
        leaders = permit.content.leaders if isinstance(permit.content, PermitMission) else ()
        if self._unit not in leaders or delegator not in {permit.delegator, *leaders}:
            raise Refused(f"the permit of {permit.delegator} does not name {self._unit}, or {delegator}", "role")

    def turn(self, mission: str, now_us: int) -> int:
        """How many that may lead it before this platform are here."""
        permit = self.of(mission, now_us)
        return 0 if permit is None else self._authority.turn(permit)

    def check_chain(self, chain: tuple[str, ...], sender: str) -> None:
        """Raise Refused if a delegation does not come from the last of its chain, or has been here: `chain`."""
        if chain and chain[-1] != sender:
            raise Refused(f"the chain of delegation ends with {chain[-1]}, and {sender} sends it", "chain")
        if self._unit in chain:
            raise Refused(f"it was delegated by {self._unit} already: {' > '.join(chain)}", "chain")
