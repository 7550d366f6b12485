"""How far a formula is from being violated: its quantitative meaning (robustness) as a stream of numbers.

A comparison is as far as its sides are apart, `xy_dist >= 15` at 18 m by 3; a truth value is infinitely far; `not` turns
the sign, `and` and `always` take the least, `or` and `eventually` the greatest. A positive margin says that the formula
holds at a state, a negative one that it does not, and how much the values would have to change for that to change.

The margin of a state is known once every window that begins there is over; `always phi` without end has the margins of
phi. Every other window must be bounded. Where a value is missing there is no margin.
"""

from collections import deque
from collections.abc import Callable, Collection, Mapping
from math import inf
from types import MappingProxyType
from typing import Final, NamedTuple, TypeGuard

from dyknow.model.errors import TextError
from dyknow.model.sample import Value
from dyknow.reasoning.formulas import tree
from dyknow.reasoning.formulas.evaluation import UNDECIDED, EvaluationCompiler, Moment
from dyknow.reasoning.progression.changes import Changes

Distance = Callable[[Moment], float | None]
_FAR: Final = (-inf, inf, None)
"""Of a truth value, by its digit."""
_SIGN: Final = {"<": -1.0, "<=": -1.0, ">": 1.0, ">=": 1.0}


def _is_quantity(value: Value) -> TypeGuard[float]:
    """Whether it is a number; texts, truth values, records and missing values have no distance."""
    return isinstance(value, int | float) and not isinstance(value, bool)


class Margin(NamedTuple):
    """`value` is None where a value is missing."""

    valid_us: int
    value: float | None


class Margins:
    """The margins of a formula, state by state.

    Args:
        formula: checked; `always phi` without end, or any formula with bounded windows.
        domains: the domains of its quantifiers, growing ones too.
        period_us: the sample period of the states if it is known.

    Raises:
        TextError: if a window has no end.
        UnknownLabel: if a quantifier ranges over a domain that `domains` lacks.
    """

    def __init__(
        self, formula: tree.Formula, domains: tree.Domains | None = None, period_us: int | None = None
    ) -> None:
        check_windows(formula)
        formula = _repeated(formula)
        self._changes = Changes(formula)
        self._times = _Times(period_us)
        self._root = _Maker(EvaluationCompiler(domains), self._times).make(formula)

    def progress(self, valid_us: int, values: Mapping[str, Value], events: Collection[str] = ()) -> list[Margin]:
        """Take one state; the margins that are known now, of states in order, each once."""
        changed_us = self._changes.after(valid_us, values)
        self._times.add(valid_us)
        return self._root.on_moment(Moment(valid_us, values, MappingProxyType({}), events, changed_us))


def check_windows(formula: tree.Formula) -> None:
    """Raise TextError if a formula has no margins: a window in it has no end."""
    for node in tree.walk(_repeated(formula)):
        if isinstance(node, tree.Always | tree.Eventually | tree.Until) and not isinstance(node.hi_us, int):
            raise TextError.at(
                node.place,
                "a margin needs windows that end; only the outermost always may have none",
                repair="an interval, as in eventually[0, 5s]",
            )
        if isinstance(node, tree.Compare) and tree.is_temporal(node):
            raise TextError.at(node.place, "a temporal operator stands inside a comparison")


def _repeated(formula: tree.Formula) -> tree.Formula:
    """The operand of an `always` without end, for which margins are computed; else the formula itself."""
    is_always = isinstance(formula, tree.Always) and formula.lo_us == 0 and formula.hi_us is None
    return formula.operand if isinstance(formula, tree.Always) and is_always else formula


class _Times:
    """The newest state, and whether another one can still lie in a window."""

    def __init__(self, period_us: int | None) -> None:
        self._step_us, self.last_us = period_us or 1, 0

    def add(self, valid_us: int) -> None:
        self.last_us = valid_us

    def is_over(self, to_us: int) -> bool:
        return self.last_us + self._step_us > to_us


class _Node:
    """Part of a formula: a stream of margins, in the order of states."""

    def on_moment(self, moment: Moment) -> list[Margin]:
        raise NotImplementedError


class _State(_Node):
    """A formula about one state."""

    def __init__(self, distance: Distance) -> None:
        self._distance = distance

    def on_moment(self, moment: Moment) -> list[Margin]:
        return [Margin(moment.valid_us, self._distance(moment))]


class _Together(_Node):
    """The least or the greatest of several, state by state; each is known when the last of them is."""

    def __init__(self, parts: list[_Node], join: Callable[[list[float]], float]) -> None:
        self._parts, self._join = parts, join
        self._waiting: list[deque[Margin]] = [deque() for _ in parts]

    def on_moment(self, moment: Moment) -> list[Margin]:
        for part, waiting in zip(self._parts, self._waiting, strict=True):
            waiting.extend(part.on_moment(moment))
        found = []
        while all(self._waiting):
            row = [waiting.popleft() for waiting in self._waiting]
            found.append(Margin(row[0].valid_us, _joined(self._join, [one.value for one in row])))
        return found


class _Turned(_Node):
    """`not`."""

    def __init__(self, inside: _Node) -> None:
        self._inside = inside

    def on_moment(self, moment: Moment) -> list[Margin]:
        return [
            Margin(valid_us, None if value is None else -value) for valid_us, value in self._inside.on_moment(moment)
        ]


class _Windowed(_Node):
    """`right` within a window, and `left` in every state before it; sides are margins that have come so far."""

    def __init__(self, sides: tuple[_Node, _Node], lo_us: int, hi_us: int, times: _Times) -> None:
        self._sides, self._lo_us, self._hi_us, self._times = sides, lo_us, hi_us, times
        self._left: deque[Margin] = deque()
        self._right: deque[Margin] = deque()
        self._starts: deque[int] = deque()

    def on_moment(self, moment: Moment) -> list[Margin]:
        left, right = self._sides
        self._left.extend(left.on_moment(moment))
        self._right.extend(right.on_moment(moment))
        self._starts.append(moment.valid_us)
        found = []
        while self._starts and self._is_known(self._starts[0]):
            start_us = self._starts.popleft()
            found.append(Margin(start_us, self._best(start_us)))
            for side in (self._left, self._right):
                while side and side[0].valid_us <= start_us:
                    side.popleft()
        return found

    def _is_known(self, start_us: int) -> bool:
        """Whether the window is over and both sides are known in every state in it."""
        ends_us = start_us + self._hi_us
        if not self._times.is_over(ends_us):
            return False
        last_us = max((at for at in self._states() if at <= ends_us), default=start_us)
        return all(side and side[-1].valid_us >= last_us for side in (self._left, self._right))

    def _states(self) -> deque[int]:
        return self._starts

    def _best(self, start_us: int) -> float | None:
        best, least = -inf, inf
        for left, right in zip(self._left, self._right, strict=False):
            after_us = right.valid_us - start_us
            if after_us > self._hi_us:
                break
            if after_us >= self._lo_us:
                if right.value is None:
                    return None
                best = max(best, min(right.value, least))
            if left.value is None:
                return None
            least = min(least, left.value)
        return best


def _joined(join: Callable[[list[float]], float], values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return join(known) if len(known) == len(values) else None


class _Maker:
    def __init__(self, compiler: EvaluationCompiler, times: _Times) -> None:
        self._compiler, self._times = compiler, times

    def make(self, formula: tree.Formula) -> _Node:
        self._compiler.count()
        match formula:
            case tree.Not(operand):
                return _Turned(self.make(operand))
            case tree.And(parts):
                return self._all(list(parts))
            case tree.Or(parts):
                return self._any(list(parts))
            case tree.Implies(left, right):
                return self._any([tree.Not(left), right])
            case tree.Forall(variable, domain, body) | tree.Exists(variable, domain, body):
                members = tree.domain_members(domain, self._compiler.domains)
                bodies = [tree.instantiate(body, variable, one) for one in members]
                return self._all(bodies) if isinstance(formula, tree.Forall) else self._any(bodies)
            case tree.Always(operand):
                return _Turned(self._window(formula, tree.Not(operand)))
            case tree.Eventually(operand):
                return self._window(formula, operand)
            case tree.Until():
                return self._window(formula, formula.right, formula.left)
        return _State(self._distance(formula))

    def _all(self, parts: list[tree.Formula]) -> _Node:
        return _Together([self.make(part) for part in parts], min) if parts else _State(lambda _moment: inf)

    def _any(self, parts: list[tree.Formula]) -> _Node:
        return _Together([self.make(part) for part in parts], max) if parts else _State(lambda _moment: -inf)

    def _window(
        self, node: tree.Always | tree.Eventually | tree.Until, right: tree.Formula, left: tree.Formula | None = None
    ) -> _Node:
        first = _State(lambda _moment: inf) if left is None else self.make(left)
        second = self.make(right)
        assert isinstance(node.lo_us, int)  # noqa: S101  (windows have been checked)
        assert isinstance(node.hi_us, int)  # noqa: S101
        return _Windowed((first, second), node.lo_us, node.hi_us, self._times)

    def _distance(self, formula: tree.Formula) -> Distance:
        if not isinstance(formula, tree.Compare):
            test = self._compiler.test(formula)
            return lambda moment: _FAR[test(*moment)]
        first, second = self._compiler.term(formula.left), self._compiler.term(formula.right)
        operator, holds = formula.operator, self._compiler.test(formula)

        def distance(moment: Moment) -> float | None:
            truth = holds(*moment)
            if truth == UNDECIDED:
                return None
            a, b = first(*moment), second(*moment)
            if not (_is_quantity(a) and _is_quantity(b)):
                return _FAR[truth]
            try:
                if operator in _SIGN:
                    return _SIGN[operator] * float(a - b)
                return float(abs(a - b)) * (1.0 if operator == "!=" else -1.0)
            except OverflowError:
                return _FAR[truth]

        return distance
