"""The platform's own vehicle while it is needed to look again: free, or lent by a mission of this platform, which is halted meanwhile."""

from collections.abc import Callable
from dataclasses import dataclass

from dyknow.agents.capabilities.attention.following import Following
from dyknow.agents.capabilities.missions.command_run import VehicleCommand
from dyknow.agents.capabilities.missions.leading import MissionLeading
from dyknow.agents.capabilities.missions.performing import Performing
from dyknow.model.errors import Refused


@dataclass(eq=False)
class BorrowedVehicle:
    """Taken with the first flight, given back with `end`. An object that it follows is followed again then. Node clock.

    Args:
        name: as which mission it flies where none has it.
        unit: the platform.
        on_performed: takes the number of a flight, why it failed (empty: it is done), and when.

    Attributes:
        halted: the mission that has lent it; empty: none.
    """

    performing: Performing
    leading: MissionLeading
    following: Following
    name: str
    unit: str
    on_performed: Callable[[int, str, int], None]
    halted: str = ""
    _is_taken: bool = False
    _number: int | None = None

    @property
    def waits(self) -> str:
        """Why the vehicle takes no commands now."""
        return self.performing.waits if self._is_taken else ""

    def take(self, reason: str, now_us: int) -> str:
        """Have it; why that cannot be. A mission that has it is halted where it is."""
        mission = self.performing.mission
        if self._is_taken:
            is_lost = mission != (self.halted or self.name) or (self.halted and not self.leading.is_halted(self.halted))
            return f"mission {mission or self.name} was continued, or is over" if is_lost else ""
        if mission and not self.leading.halt(mission, reason, now_us):
            return f"the vehicle takes part in mission {mission}, which another platform leads"
        try:
            if not mission:
                self.following.pause(reason, now_us)
                self.performing.join(self.name, self.unit, lambda _waits, _at_us: None, now_us)
        except Refused as refused:
            self.following.go_on(refused.reason, now_us)
            return refused.reason
        self.halted, self._is_taken = mission, True
        return ""

    def fly(self, number: int, why: str, commands: tuple[VehicleCommand, ...], now_us: int) -> None:
        """Do these; commands under way are overtaken."""
        self._number = number

        def answer(failure: str, at_us: int) -> None:
            if self._number == number:
                self.on_performed(number, failure, at_us)

        self.performing.perform(why, commands, answer, now_us)

    def end(self, result: str, now_us: int) -> None:
        """Give it back: a halted mission continues where it was, and reports what came of it."""
        self._number = None
        if not self._is_taken:
            return
        self._is_taken = False
        if not self.halted:
            overtaken = self.performing.waits
            self.performing.leave(now_us)
            self.following.go_on(overtaken, now_us)
        elif self.leading.is_halted(self.halted):
            self.performing.stop("loiter")
            self.leading.go_on(self.halted, result, now_us)
