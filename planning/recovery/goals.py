"""The goals of a mission: which are given up, which the plan does not reach, which hold."""

from dataclasses import dataclass, field

from dyknow.planning.domains.model import Declarations, GoalStatement
from dyknow.planning.execution.beliefs import Beliefs
from dyknow.planning.recovery.situation import unreached_goals


def name_of(goal: GoalStatement) -> str:
    """As messages and answers name it."""
    return goal.name or "goal"


@dataclass(slots=True)
class MissionGoals:
    """Goals by name.

    Attributes:
        dropped: given up for good, in order.
        unreached: the goals that the plan leaves aside.
    """

    statements: tuple[GoalStatement, ...]
    dropped: list[str] = field(default_factory=list)
    unreached: tuple[str, ...] = ()

    @property
    def kept(self) -> tuple[str, ...]:
        return tuple(name_of(one) for one in self.statements if name_of(one) not in self.dropped)

    @property
    def droppable(self) -> tuple[str, ...]:
        """Those with a weight that are not dropped, the lightest first."""
        weighed = [one for one in self.statements if one.weight is not None and name_of(one) not in self.dropped]
        return tuple(name_of(one) for one in sorted(weighed, key=lambda one: one.weight or 0.0))

    def missed(self, declared: Declarations, beliefs: Beliefs) -> tuple[str, ...]:
        """The goals of the plan that do not hold."""
        left = {*self.dropped, *self.unreached}
        return tuple(one for one in self._not_holding(declared, beliefs) if one not in left)

    def open(self, declared: Declarations, beliefs: Beliefs) -> tuple[str, ...]:
        """The goals that are dropped or do not hold, each once."""
        return tuple(dict.fromkeys((*self.dropped, *self._not_holding(declared, beliefs))))

    def _not_holding(self, declared: Declarations, beliefs: Beliefs) -> tuple[str, ...]:
        return tuple(name_of(one) for one in unreached_goals(declared, self.statements, beliefs))
