"""The successors of a node: an action of the first idle unit, that unit waiting, or the next change.

Time goes forward with the actions: a unit that is idle starts an action now or waits; when no unit is idle, the next
effect comes about. An action does not start while another one is about to change what its preconditions read, or to write
what it writes.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import inf, isfinite
from typing import Any, Final

from dyknow.model.sample import Value
from dyknow.model.values import NO_VALUE
from dyknow.planning.search.control import ControlFormulas
from dyknow.planning.search.nodes import ActionUnderWay, MovingState, Pending, SearchNode, ValueChange
from dyknow.planning.search.operators import OperatorInstance, Schema
from dyknow.planning.search.plans import PlannedAction

_NONE: Final[dict[str, Any]] = {}
LIMIT_MS: Final = 366 * 24 * 3600 * 1000
"""No plan goes beyond a year."""


class Successors:
    """Makes the nodes after a node.

    Attributes:
        conflicts: how often actions did not start because of other ones, or ended a branch, by cause.
    """

    def __init__(
        self,
        schemas: list[Schema],
        units: tuple[str | None, ...],
        control: ControlFormulas,
        state: MovingState,
        events: tuple[tuple[int, str, Value], ...],
    ) -> None:
        self._schemas, self._units, self._control = schemas, units, control
        self._state, self._events = state, events
        self.conflicts: dict[str, int] = {}

    def of(
        self, node: SearchNode, *, prefer_waiting: bool = False, urgent: Mapping[str, int] = _NONE
    ) -> Iterator[SearchNode]:
        """Nodes after this one, those to be tried first first; the state is moved to each before it is given.

        Of one operator what is about `urgent` objects goes first, by their deadlines, then what is cheap.
        """
        unit = next(one for one in self._units if self._is_idle(node, one))
        can_wait = bool(node.pending or node.running or node.events < len(self._events)) or any(
            self._is_idle(node, one) for one in self._units if one != unit
        )
        if can_wait and prefer_waiting:
            yield from self._settled(self._waiting(node, unit))
        for schema in self._schemas:
            self._state.go_to(node)
            found = list(schema.instances(unit, self._state.values))
            started = [child for each in found if (child := self._started(node, unit, each)) is not None]
            started.sort(key=lambda child: (_due_ms(child, urgent), child.cost))
            for child in started:
                yield from self._settled(child)
        if can_wait and not prefer_waiting:
            yield from self._settled(self._waiting(node, unit))

    def settled(self, node: SearchNode) -> Iterator[SearchNode]:
        """The node itself, or the one after it in which a unit is idle, if there is one."""
        return self._settled(node)

    def _is_idle(self, node: SearchNode, unit: str | None) -> bool:
        return unit not in node.waiting and all(one.unit != unit for one in node.running)

    def _waiting(self, node: SearchNode, unit: str | None) -> SearchNode:
        return replace(node, parent=node, depth=node.depth + 1, changes=(), action=None, waiting=node.waiting | {unit})

    def _settled(self, node: SearchNode) -> Iterator[SearchNode]:
        current: SearchNode | None = node
        while current is not None and (
            _acts_at_once(current) or not any(self._is_idle(current, one) for one in self._units)
        ):
            current = self._advanced(current)
        if current is not None:
            self._state.go_to(current)
            yield current

    def _started(self, node: SearchNode, unit: str | None, instance: OperatorInstance) -> SearchNode | None:
        """The node after an action has started; the state is at `node`."""
        values = self._state.values
        length_ms = instance.duration_ms(values)
        if length_ms is None:
            self._count(f"{instance.operator.name} has no duration that its time constraint allows")
            return None
        end_ms = node.at_ms + length_ms
        new = []
        for one in instance.effects:
            if one.when is not None and one.when(0, values, _NONE, (), _NONE) != 1:
                continue
            at_ms = end_ms + one.offset_ms if one.from_end else node.at_ms + max(1, one.offset_ms)
            new.append(
                Pending(min(max(at_ms, node.at_ms + 1), end_ms), one.label, one.value(0, values, _NONE, (), _NONE))
            )
        if node.pending and not self._is_free(node, instance, new):
            return None
        cost = instance.cost_in(values)
        if not isfinite(cost):
            self._count(f"{instance.operator.name} has no cost that is a number and not negative")
            return None
        shown = tuple((name, read(0, values, _NONE, (), _NONE)) for name, read in instance.values)
        action = PlannedAction(
            node.at_ms, end_ms, instance.unit, instance.shown, instance.operator, instance.objects, shown, cost
        )
        return SearchNode(
            node,
            node.at_ms,
            node.cost + cost,
            node.depth + 1,
            action,
            (),
            node.touched,
            tuple(sorted((*node.pending, *new), key=_time)),
            (*node.running, ActionUnderWay(end_ms, unit, instance)),
            node.waiting,
            node.residuals,
            node.events,
            node.digest,
            node.steps + 1,
        )

    def _is_free(self, node: SearchNode, instance: OperatorInstance, new: list[Pending]) -> bool:
        """Whether no action under way changes what this one reads or writes."""
        writes = {one.label for one in new}
        for one in node.pending:
            if one.label in instance.reads or one.label in writes:
                self._count(f"{instance.operator.name} waits for another action to change {one.label}")
                return False
        return True

    def _advanced(self, node: SearchNode) -> SearchNode | None:
        """The node with the next effects, ends of actions and observations; None if there are none, or it is refused."""
        state = self._state
        state.go_to(node)
        times = [one.at_ms for one in node.pending[:1]] + [one.end_ms for one in node.running]
        if node.events < len(self._events):
            times.append(self._events[node.events][0])
        if not times:
            return None
        at_ms = min(times)
        if at_ms > LIMIT_MS:
            self._count("the plan would take longer than a year")
            return None
        new: dict[str, Value] = {}
        events = node.events
        while events < len(self._events) and self._events[events][0] <= at_ms:
            if label := self._events[events][1]:
                new[label] = self._events[events][2]
            events += 1
        count = 0
        for one in node.pending:
            if one.at_ms > at_ms:
                break
            count += 1
            if new.setdefault(one.label, one.value) != one.value:
                self._count(f"{one.label} would get two values at once")
                return None
        values = state.values
        changes = tuple(
            [
                ValueChange(label, values.get(label, NO_VALUE), value)
                for label, value in new.items()
                if values.get(label, NO_VALUE) != value
            ]
        )
        child = SearchNode(
            node,
            at_ms,
            node.cost,
            node.depth + 1,
            None,
            changes,
            {one.label: one.before for one in changes},
            node.pending[count:],
            tuple([one for one in node.running if one.end_ms > at_ms]),
            frozenset(),
            node.residuals,
            events,
            state.digest(node.digest, changes),
            node.steps,
        )
        state.go_to(child)
        residuals = self._control.after(values, child.touched, node.touched, node.residuals, at_ms - node.at_ms)
        if residuals is None:
            return None
        child.residuals = residuals
        for running in child.running:
            for test in running.instance.prevail:
                if test(0, values, _NONE, (), _NONE) != 1:
                    self._count(f"a prevail condition of {running.instance.operator.name} would end")
                    return None
        return child

    def _count(self, cause: str) -> None:
        self.conflicts[cause] = self.conflicts.get(cause, 0) + 1


def _acts_at_once(node: SearchNode) -> bool:
    """Whether an effect of a start is due: it is seen by every action that starts after."""
    return bool(node.pending) and node.pending[0].at_ms <= node.at_ms + 1


def _due_ms(node: SearchNode, urgent: Mapping[str, int]) -> float:
    objects = node.action.objects if urgent and node.action is not None else ()
    return min((urgent[one] for one in objects if one in urgent), default=inf)


def _time(one: Pending) -> int:
    return one.at_ms
