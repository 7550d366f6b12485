"""Nodes of the search, and the one state that moves between them.

A node holds what changed on the way to it. The state is moved from node to node by undoing and redoing changes, so that
nothing is copied; its digest is kept up with them.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from hashlib import blake2b
from typing import NamedTuple

from dyknow.model.sample import Value
from dyknow.planning.search.control import Residuals
from dyknow.planning.search.operators import OperatorInstance
from dyknow.planning.search.plans import PlannedAction


class ValueChange(NamedTuple):
    label: str
    before: Value
    after: Value


class Pending(NamedTuple):
    """An effect that is to come."""

    at_ms: int
    label: str
    value: Value


class ActionUnderWay(NamedTuple):
    """An action that is not over: its unit is busy until then."""

    end_ms: int
    unit: str | None
    instance: OperatorInstance


@dataclass(slots=True, eq=False)
class SearchNode:
    """One decision, or one state more.

    Attributes:
        changes: of the newest state, against the one before; `parent` has the others.
        events: how many of the problem's later observations are in it.
        waiting: units that are left without an action until something happens.
        steps: how many actions have begun.
    """

    parent: "SearchNode | None"
    at_ms: int = 0
    cost: float = 0.0
    depth: int = 0
    action: PlannedAction | None = None
    changes: tuple[ValueChange, ...] = ()
    touched: dict[str, Value] = field(default_factory=dict)
    pending: tuple[Pending, ...] = ()
    running: tuple[ActionUnderWay, ...] = ()
    waiting: frozenset[str | None] = frozenset()
    residuals: Residuals = ()
    events: int = 0
    digest: int = 0
    steps: int = 0

    def key(self) -> tuple[object, ...]:
        """The key that tells it from other nodes, without its time and cost."""
        at_ms = self.at_ms
        return (
            self.digest,
            self.residuals,
            tuple([(one.at_ms - at_ms, one.label, one.value) for one in self.pending]),
            tuple([(one.end_ms - at_ms, one.unit) for one in self.running]),
            self.waiting,
            self.events,
        )

    def actions(self) -> tuple[PlannedAction, ...]:
        """From the root to here, in order of time."""
        found, node = [], self
        while node.parent is not None:
            if node.action is not None:
                found.append(node.action)
            node = node.parent
        return tuple(reversed(found))


class MovingState:
    """The values at one node, and the truths that are remembered of them."""

    def __init__(
        self, values: dict[str, Value], root: SearchNode, remembered: Mapping[str, list[list[int | None]]]
    ) -> None:
        self.values, self.at, self._remembered = values, root, remembered
        self._digests: dict[tuple[str, Value], int] = {}

    def digest(self, before: int, changes: Iterable[ValueChange]) -> int:
        """The digest of a state after changes."""
        for one in changes:
            before ^= self._of(one.label, one.before) ^ self._of(one.label, one.after)
        return before

    def _of(self, label: str, value: Value) -> int:
        found = self._digests.get((label, value))
        if found is None:
            written = blake2b(repr((label, value)).encode(), digest_size=16).digest()
            found = self._digests[label, value] = int.from_bytes(written, "big")
        return found

    def go_to(self, node: SearchNode) -> None:
        """Move to another node."""
        here, there, forward = self.at, node, []
        while here is not there:
            if here.depth >= there.depth:
                for change in here.changes:
                    self._set(change.label, change.before)
                assert here.parent is not None  # noqa: S101 - all nodes have one root
                here = here.parent
            else:
                forward.append(there)
                assert there.parent is not None  # noqa: S101 - all nodes have one root
                there = there.parent
        for each in reversed(forward):
            for change in each.changes:
                self._set(change.label, change.after)
        self.at = node

    def _set(self, label: str, value: Value) -> None:
        self.values[label] = value
        for cell in self._remembered.get(label, ()):
            cell[0] = None
