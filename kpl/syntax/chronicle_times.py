"""Times in chronicles from the parse tree: sums of instants and distances, intervals, constraints (thesis 8.3.1, 8.3.3).

Every comparison of a chain comes to one difference of two instants within one interval, or is refused: disjunctions and
sums of differences are not simple temporal constraints (8.4).
"""

from collections import Counter
from collections.abc import Callable
from operator import add, and_, or_
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from dyknow.kpl.diagnostics.collector import ErrorCollector
from dyknow.kpl.syntax.numbers import parse_time_ms
from dyknow.kpl.syntax.parsing import place_of
from dyknow.model.errors import ChronicleError
from dyknow.model.labels import MAX_LABEL
from dyknow.reasoning.chronicles.definition import times
from dyknow.reasoning.formulas.tree import Place

if TYPE_CHECKING:
    from lark import Token

_ORIGIN: Final = ""
"""The instant from which times are counted, among the instants of a sum."""


class Sum(NamedTuple):
    """The number of times each instant is added, and the constant added to them."""

    instants: "Counter[str]"
    shift: times.Interval

    @property
    def is_point(self) -> bool:
        return sorted(self.instants.values()) == [1]

    @property
    def difference(self) -> tuple[str, str] | None:
        """(to, from), each perhaps the origin; None if it is none."""
        plus, minus = +self.instants, +Counter({name: -times for name, times in self.instants.items()})
        if plus.total() > 1 or minus.total() > 1 or not plus.total() + minus.total():
            return None
        return next(iter(plus), _ORIGIN), next(iter(minus), _ORIGIN)

    def minus(self, other: "Sum") -> "Sum":
        found = Counter(self.instants)
        found.subtract(other.instants)
        return Sum(Counter({name: times for name, times in found.items() if times}), self.shift - other.shift)


class TimeReader(ErrorCollector):
    """Reads times; every instant that is named is kept in `instants` with its place."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.instants: list[tuple[str, Place]] = []

    def point(self, node: Any) -> times.TimePoint:
        found = self._sum(node.children[0])
        if not found.is_point:
            self.error(
                "this is no instant: an instant is named, and may be shifted",
                place_of(node, self.text),
                "event(on_road[?car]:(?, true), t1 + 500ms)",
            )
            return times.TimePoint("start")
        return times.TimePoint(next(iter(found.instants)), found.shift)

    def timing(self, node: Any) -> tuple[times.TimeConstraint, ...]:
        """One statement; a chain whose links are not all instants is one constraint for each link."""
        place = place_of(node, self.text)
        match node.data:
            case "timing_use":
                name, *points = node.children
                return (
                    times.ConstraintUse(self.instant(name, keep=False), tuple([self.point(each) for each in points])),
                )
            case "within":
                left, spans = node.children
                found, interval = self._sum(left), self._spans(spans)
                return self._distance(Sum(found.instants, found.shift - interval), "=", place, found.difference)
        sums = [self._sum(part) for part in node.children[::2]]
        operators = tuple(map(str, node.children[1::2]))
        if all(each.is_point for each in sums):
            points = tuple([times.TimePoint(next(iter(each.instants)), each.shift) for each in sums])
            return (times.TimeOrder(points, operators),)
        made: list[times.TimeConstraint] = []
        for left, operator, right in zip(sums, operators, sums[1:], strict=False):
            for one in self._distance(left.minus(right), operator, place, left.difference or right.difference):
                self._add(made, one, place)
        return tuple(made)

    def _add(self, made: list[times.TimeConstraint], one: times.Distance, place: Place) -> None:
        """`10 <= t5 - t1 <= 30` is one constraint."""
        last = made[-1] if made else None
        if isinstance(last, times.Distance) and (last.to, last.from_) == (one.to, one.from_):
            both = self._tried(place, and_, last.interval, one.interval)
            made[-1] = times.Distance(one.to, one.from_, both)
        else:
            made.append(one)

    def _distance(
        self, found: Sum, operator: str, place: Place, written: tuple[str, str] | None
    ) -> tuple[times.Distance, ...]:
        """The distances of two instants that `found operator 0` states, in the direction in which they are written."""
        difference = found.difference
        if difference is None:
            several = found.instants.total() or any(found.instants.values())
            self.error(
                "a time constraint compares two instants, or the distance of two with a time"
                if several
                else "no instant is constrained here",
                place,
                "t3 - t2 in [0, 60000]",
            )
            return ()
        to, from_ = difference
        low, high = found.shift.low_ms, found.shift.high_ms
        bounds = {
            "=": (high, low),
            "<": (None, low if low is None else low + 1),
            "<=": (None, low),
            ">": (high if high is None else high - 1, None),
            ">=": (high, None),
        }[operator]
        at_least, at_most = (None if bound is None else -bound for bound in bounds)
        interval = self._tried(place, times.Interval, at_least, at_most)
        if not to or (written == (from_, to) and from_):
            to, from_, interval = from_, to, -interval
        return (times.Distance(to, from_ or None, interval),)

    def _sum(self, node: Any) -> Sum:
        instants, shift, sign = Counter[str](), times.ZERO, 1
        for part in node.children:
            kind = getattr(part, "type", "")
            if kind in {"PLUS", "MINUS"}:
                self.goes_on(part, is_first=part is node.children[0])
                sign = 1 if kind == "PLUS" else -1
                continue
            if kind == "NUMBER":
                by_ms = sign * self.time_ms(part)
                shift = self._tried(place_of(node, self.text), shift.shifted, by_ms)
            elif part.data == "interval":
                span = self._interval_of(part)
                span = span if sign > 0 else -span
                shift = self._tried(place_of(node, self.text), add, shift, span)
            else:
                shift = self._named(part, sign, instants, shift)
            sign = 1
        return Sum(Counter({name: times for name, times in instants.items() if times}), shift)

    def _named(self, node: Any, sign: int, instants: "Counter[str]", shift: times.Interval) -> times.Interval:
        """`t3-t2` and `t3-1` are read as one name; it is taken apart here."""
        place = place_of(node, self.text)
        first, *others = self.short(node).split("-")
        self.instants.append((first, place))
        instants[first] += sign
        for other in others:
            if other[0].isdecimal():
                by_ms = self._time_ms(other, place)
                shift = self._tried(place, shift.shifted, -by_ms)
            else:
                self.instants.append((other, place))
                instants[other] -= 1
        return shift

    def short(self, node: Any) -> str:
        """A name, which is not too long."""
        name = str(node.children[0])
        if len(name) > MAX_LABEL:
            self.error(
                f"a name has at most {MAX_LABEL} characters, this one has {len(name)}", place_of(node, self.text)
            )
        return name[:MAX_LABEL].rstrip("-")

    def instant(self, node: Any, *, keep: bool = True) -> str:
        """The name of an instant where it is declared, or of a constraint on instants."""
        name = self.short(node)
        if "-" in name:
            self.error(
                "names of instants and of constraints hold no `-`", place_of(node, self.text), name.replace("-", "_")
            )
        if keep:
            self.instants.append((name, place_of(node, self.text)))
        return name

    def goes_on(self, sign: "Token", *, is_first: bool = False) -> None:
        """A sign that begins a line belongs to the statement before it; the next one may have been meant."""
        before = self.text[self.text.rfind("\n", 0, sign.start_pos) + 1 : sign.start_pos]
        if not is_first and not before.strip():
            self.error(
                f"this line continues what is before it, since it begins with `{sign}`",
                place_of(sign, self.text),
                f"end the line before with `{sign}`, or with `;` if this is another statement",
            )

    # Intervals

    def _spans(self, node: Any) -> times.Interval:
        """Unions of intersections of intervals that are shifted."""
        place = place_of(node, self.text)
        match node.data:
            case "interval":
                return self._interval_of(node)
            case "opposite":
                return -self._spans(node.children[0])
            case "shifted":
                return self._shifted(node)
        found, *others = [self._spans(part) for part in node.children if not hasattr(part, "type")]
        for other in others:
            found = self._tried(place, and_ if node.data == "both" else or_, found, other)
        return found

    def _shifted(self, node: Any) -> times.Interval:
        place = place_of(node, self.text)
        first, *parts = node.children
        found = self._spans(first)
        for sign, part in zip(parts[::2], parts[1::2], strict=True):
            self.goes_on(sign)
            by_ms = self.time_ms(part) if hasattr(part, "type") else None
            by = self._spans(part) if by_ms is None else self._tried(place, times.Interval, by_ms, by_ms)
            found = self._tried(place, add, found, by if sign == "+" else -by)
        return found

    def _interval_of(self, node: Any) -> times.Interval:
        place = place_of(node, self.text)
        left, right = self.text[place.start], self.text[place.end - 1]
        low, high = (self._bound_of(part) for part in node.children)
        if low == "oo" or high == "-oo":
            self.error("an interval goes from the earlier to the later", place, "[0, oo[   or   ]-oo, 5]")
            return times.ZERO
        if (low == "-oo" and left == "[") or (high == "oo" and right == "]"):
            self.error("an interval is open where it does not end", place, "[0, oo[   or   ]-oo, 5]")
        low_ms = None if isinstance(low, str) else low + (left == "]")
        high_ms = None if isinstance(high, str) else high - (right == "[")
        return self._tried(place, times.Interval, low_ms, high_ms)

    def _bound_of(self, node: Any) -> int | str:
        *sign, value = node.children
        is_negative = bool(sign) and sign[0] == "-"
        if value.type == "OO":
            return "-oo" if is_negative else "oo"
        return -self.time_ms(value) if is_negative else self.time_ms(value)

    def _tried(self, place: Place, make: Callable[..., times.Interval], *given: Any) -> times.Interval:
        """The result of `make`; its refusal becomes an error."""
        try:
            return make(*given)
        except ChronicleError as error:
            self.error(str(error), place)
            return times.ZERO

    def time_ms(self, token: "Token") -> int:
        return self._time_ms(str(token), place_of(token, self.text))

    def _time_ms(self, text: str, place: Place) -> int:
        """A time in milliseconds, in which chronicles tick (C1)."""
        repair = "whole milliseconds, or oo where there is no bound"
        return self.attempt(lambda: parse_time_ms(text), place, 0, repair)
