"""The units of a mission: which of them plans can count on, which hold, which are flown by their pilots."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from dyknow.planning.execution.events import HoldUnit, HoldWay, MissionNote


@dataclass(slots=True)
class MissionUnits:
    """Units by name.

    Attributes:
        everyone: those of the problem.
        pilots: flown by hand: they are sent nothing.
        lost: gone; `left_out`: a recovery operator does without them.
    """

    everyone: tuple[str, ...]
    pilots: set[str] = field(default_factory=set)
    lost: set[str] = field(default_factory=set)
    left_out: set[str] = field(default_factory=set)
    _held: dict[str, HoldWay] = field(default_factory=dict)

    @property
    def missing(self) -> tuple[str, ...]:
        """The units that take no part in new plans."""
        return tuple(sorted(self.lost | self.left_out))

    @property
    def acting(self) -> tuple[str, ...] | None:
        """The units that take part in new plans; None if all of them do."""
        missing = self.missing
        return tuple(one for one in self.everyone if one not in missing) if missing else None

    @property
    def flown_by_hand(self) -> str:
        return ", ".join(sorted(self.pilots))

    def leave_out(self, units: Iterable[str]) -> list[MissionNote]:
        """Do without units from now on, but not without the last one."""
        found = []
        for unit in units:
            if set(self.everyone) - self.lost - self.left_out - {unit}:
                self.left_out.add(unit)
                found.append(MissionNote("left out", f"{unit} takes no part in new plans"))
            else:
                found.append(MissionNote("left out", f"{unit} stays: no other unit can act"))
        return found

    def hold(self, units: Iterable[str], how: HoldWay, why: str) -> list[HoldUnit]:
        """Have units hold that do not yet, those of pilots left alone."""
        told = [one for one in sorted(units) if self._held.get(one) != how and not {one} & (self.pilots | self.lost)]
        self._held |= dict.fromkeys(told, how)
        return [HoldUnit(one, how, why) for one in told]

    def release(self) -> None:
        """A plan has begun: no unit holds."""
        self._held.clear()
