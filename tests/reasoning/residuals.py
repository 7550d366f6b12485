"""The remainder of a formula after a state: truth values, and obligations that further states decide.

A residual is True, False, None (undecided for ever, by an atom over `no_value`) or a `Pending`, which `step`s through
the next state. Windows carry absolute times, so that equal obligations of different states are equal and collapse;
chains keep until flat however long it lasts. Everything is immutable.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from dyknow.reasoning.formulas.evaluation import Moment, Truth


class Pending(Protocol):
    """An obligation that the states so far leave open."""

    def step(self, moment: Moment) -> "Residual":
        """The remainder after one more state."""


Residual: TypeAlias = Truth | Pending


class Operator(Protocol):
    """A compiled formula: `start` evaluates it at one state."""

    def start(self, moment: Moment) -> Residual:
        """The formula progressed through the state (Def. 7.5.3)."""


def is_pending(residual: Residual) -> bool:
    return residual is not None and residual is not True and residual is not False


def obligations(residual: Residual) -> int:
    """How many windows a residual keeps; needs no recursion."""
    found, waiting = 0, [residual]
    while waiting:
        one = waiting.pop()
        if isinstance(one, Window | UntilWindow):
            found += 1
        elif isinstance(one, ResidualChain):
            waiting += [one.tail, *(side for link in one.links for side in link)]
        elif isinstance(one, Negated):
            waiting.append(one.inside)
        else:
            waiting += getattr(one, "parts", ())
    return found


def negate(residual: Residual) -> Residual:
    if residual is None or residual is True or residual is False:
        return None if residual is None else not residual
    return residual.inside if isinstance(residual, Negated) else Negated(residual)


def conjoin(residuals: Iterable[Residual]) -> Residual:
    """True drops out, False wins, the rest is kept once each."""
    kept: dict[object, Residual] = {}
    for one in residuals:
        if one is False:
            return False
        if one is not True:
            _keep(kept, one.parts if isinstance(one, All) else (one,), universal=True)
    if len(kept) > 1:
        return All(tuple(kept.values()))
    return next(iter(kept.values()), True)


def disjoin(residuals: Iterable[Residual]) -> Residual:
    """False drops out, True wins, the rest is kept once each."""
    kept: dict[object, Residual] = {}
    for one in residuals:
        if one is True:
            return True
        if one is not False:
            _keep(kept, one.parts if isinstance(one, Any_) else (one,), universal=False)
    if len(kept) > 1:
        return Any_(tuple(kept.values()))
    return next(iter(kept.values()), False)


def _keep(kept: dict[object, Residual], parts: tuple[Residual, ...], *, universal: bool) -> None:
    """Add parts once each; of open windows of one operator only the one that says most (7.5.2, simplification)."""
    for one in parts:
        if not isinstance(one, Window) or one.from_us is not None:
            kept.setdefault(one, one)
            continue
        key = (id(one.operator), "open")
        other = kept.get(key)
        if not isinstance(other, Window) or one.says_more(other, long=one.operator.universal is universal):
            kept[key] = one


@dataclass(frozen=True, slots=True)
class Negated:
    inside: Pending

    def step(self, moment: Moment) -> Residual:
        return negate(self.inside.step(moment))


@dataclass(frozen=True, slots=True)
class All:
    parts: tuple[Residual, ...]

    def step(self, moment: Moment) -> Residual:
        return conjoin(_each_step(self.parts, moment))


@dataclass(frozen=True, slots=True)
class Any_:  # noqa: N801 - `Any` is taken, and the pair should read as one
    parts: tuple[Residual, ...]

    def step(self, moment: Moment) -> Residual:
        return disjoin(_each_step(self.parts, moment))


def _each_step(parts: tuple[Residual, ...], moment: Moment) -> list[Residual]:
    return [one if one is None or one is True or one is False else one.step(moment) for one in parts]


class Windowed(Operator, Protocol):
    """The compiled `always` (universal) or `eventually` that a window belongs to."""

    @property
    def universal(self) -> bool: ...

    @property
    def operand(self) -> Operator: ...

    def closes(self, to_us: int | None, valid_us: int) -> bool:
        """Whether no later state can lie before `to_us` (F3)."""


@dataclass(frozen=True, slots=True)
class Window:
    """`always` or `eventually` over the states from `from_us` (None: from now on) to `to_us` (None: no end)."""

    operator: Windowed
    from_us: int | None
    to_us: int | None

    def says_more(self, other: "Window", *, long: bool) -> bool:
        """Whether this window implies the other one: the longer always in a conjunction, the shorter eventually."""
        mine = float("inf") if self.to_us is None else self.to_us
        theirs = float("inf") if other.to_us is None else other.to_us
        return mine > theirs if long else mine < theirs

    def step(self, moment: Moment) -> Residual:
        operator, valid_us = self.operator, moment.valid_us
        if self.to_us is not None and valid_us > self.to_us:
            return operator.universal
        closes = operator.closes(self.to_us, valid_us)
        if self.from_us is not None and valid_us < self.from_us:
            return operator.universal if closes else self
        found = operator.operand.start(moment)
        if closes or found is (not operator.universal):
            return found
        rest = self if self.from_us is None else Window(operator, None, self.to_us)
        return conjoin((found, rest)) if operator.universal else disjoin((found, rest))


class UntilOperator(Operator, Protocol):
    @property
    def left(self) -> Operator: ...

    @property
    def right(self) -> Operator: ...

    def closes(self, to_us: int | None, valid_us: int) -> bool:
        """Whether no later state can lie before `to_us` (F3)."""


@dataclass(frozen=True, slots=True)
class UntilWindow:
    """`left until right`, right in a state from `from_us` to `to_us`, left in every state before it."""

    operator: UntilOperator
    from_us: int | None
    to_us: int | None

    def step(self, moment: Moment) -> Residual:
        operator, valid_us = self.operator, moment.valid_us
        if self.to_us is not None and valid_us > self.to_us:
            return False
        closes = operator.closes(self.to_us, valid_us)
        if self.from_us is not None and valid_us < self.from_us:
            return False if closes else chain(((False, operator.left.start(moment)),), self)
        right = operator.right.start(moment)
        if closes or right is True:
            return right
        rest = self if self.from_us is None else UntilWindow(operator, None, self.to_us)
        return chain(((right, operator.left.start(moment)),), rest)


Link: TypeAlias = tuple[Residual, Residual]
"""(right, left) of one state: right, or left and what follows."""


@dataclass(frozen=True, slots=True)
class ResidualChain:
    """right1 or (left1 and (right2 or (left2 and ... tail))), kept flat."""

    links: tuple[Link, ...]
    tail: Residual

    def step(self, moment: Moment) -> Residual:
        links = tuple((right, left) for right, left in (_each_step(link, moment) for link in self.links))
        tail = self.tail
        return chain(links, tail if tail is None or tail is True or tail is False else tail.step(moment))


def chain(links: Iterable[Link], tail: Residual) -> Residual:
    """A chain, simplified from its end: what is decided folds, equal neighbours are one."""
    flat = list(links)
    if isinstance(tail, ResidualChain):
        flat += tail.links
        tail = tail.tail
    kept: list[Link] = []
    for right, left in reversed(flat):
        if right is True or left is False:
            tail, kept = right, []
        elif not kept and not is_pending(tail):
            tail = disjoin((right, conjoin((left, tail))))
        elif not (right is False and left is True) and not (kept and kept[-1] == (right, left)):
            kept.append((right, left))
    return ResidualChain(tuple(reversed(kept)), tail) if kept else tail
