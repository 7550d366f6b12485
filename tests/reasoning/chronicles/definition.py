"""What chronicles mean, transcribed from thesis 8.3 and from the statement in reasoning/chronicles/definition/model.py: slow, and
nothing of the engine is used. Every assignment of symbols to variables and of times to instants is tried.
"""

from collections.abc import Iterator, Mapping
from itertools import product
from typing import Any, NamedTuple

from dyknow.reasoning.chronicles import MINUS_INFINITY
from dyknow.reasoning.chronicles.definition.model import (
    ChronicleVariable,
    Event,
    Inclusion,
    Instants,
    MemberOf,
    NoEvent,
    Occurs,
    Variables,
)
from dyknow.reasoning.chronicles.definition.times import ConstraintUse, Distance, TimeOrder, TimePoint
from tests.reasoning.chronicles.truth import truth, variables_of


class Happening(NamedTuple):
    """An event: a message, or with `change` (old, new) a change; old None is unknown."""

    at_ms: int
    name: str
    arguments: tuple[str | None, ...]
    change: tuple[str | None, str] | None = None

    @property
    def values(self):
        return self.arguments + (self.change or ())


class Need(NamedTuple):
    """occurs(least, most, name[arguments]:change, (begin, end)); points are (instant, shift)."""

    least: int
    most: int | None
    name: str
    parameters: tuple[Any, ...]
    is_change: bool
    begin: tuple[str, int]
    end: tuple[str, int]


class Found(NamedTuple):
    chronicle: str
    bindings: tuple[tuple[str, str], ...]
    instants: tuple[tuple[str, int], ...]
    recognised_ms: int


def in_order(happenings):
    """8.7.3: what comes out of order is ignored; so is a change that is none."""
    kept, clock = [], None
    for one in happenings:
        if one.change is not None and one.change[0] == one.change[1]:
            continue
        if clock is None or one.at_ms >= clock:
            kept.append(one)
            clock = one.at_ms
    return kept


class Meaning:
    """One chronicle with its parts written out (purely syntactic: 8.3.3, 8.3.5)."""

    def __init__(self, name, file, max_age_ms=None):
        self.file, self.name, self.max_age_ms = file, name, max_age_ms
        self.needs: list[Need] = []
        self.conditions: list[tuple[Any, Mapping[str, Any], str]] = []
        self.times: list[tuple[str, str, int]] = []  # to - from <= bound
        self.instants: set[str] = set()
        self._parts = self._own = 0
        self._clock = False
        self.parameters = file.chronicles[name].parameters
        self._body(file.chronicles[name], "", {}, {})

    # Writing out

    def _body(self, chronicle, prefix, variables, given):
        before = set(self.instants)
        named = set(chronicle.instants)
        self.instants |= {self._instant(one, prefix, given)[0] for one in chronicle.instants}
        for statement in chronicle.statements:
            named |= self._statement(statement, prefix, variables, given)
        inside = {(one, 0) for one in self.instants - before - {"0"} if one.startswith(prefix)}
        inside |= {self._instant(one, prefix, given) for one in named}
        ends = [one for one in ("start", "end") if one in named or one in given]
        for one in ends:
            mine = self._instant(one, prefix, given)
            self.instants.add(mine[0])
            for other in inside:
                self._compare(mine, "<=" if one == "start" else ">=", other)

    def _instant(self, name, prefix, given):
        return given.get(name, (prefix + name, 0))

    def _point(self, point: TimePoint, prefix, given):
        name, shift = self._instant(point.instant, prefix, given)
        self.instants.add(name)
        low, high = point.shift.low_ms, point.shift.high_ms
        if low is not None and low == high:
            return name, shift + low
        self._own += 1
        own = f"{prefix}{point.instant}~{self._own}"
        self.instants.add(own)
        self._distance((own, 0), (name, shift), point.shift)
        return own, 0

    def _distance(self, to, from_, interval):
        """To - from in the interval."""
        shift = to[1] - from_[1]
        if interval.high_ms is not None:
            self.times.append((to[0], from_[0], interval.high_ms - shift))
        if interval.low_ms is not None:
            self.times.append((from_[0], to[0], shift - interval.low_ms))

    def _compare(self, left, operator, right):
        shift = right[1] - left[1]
        if operator in {"<", "<=", "="}:
            self.times.append((left[0], right[0], shift - (operator == "<")))
        if operator in {">", ">=", "="}:
            self.times.append((right[0], left[0], -shift - (operator == ">")))

    def _statement(self, statement, prefix, variables, given):
        """Write it out; the instants that it names."""
        match statement:
            case Event(type_, at):
                begin = self._point(at, prefix, given)
                self._need(1, None, type_, begin, (begin[0], begin[1] + 1), prefix, variables)
                return {at.instant}
            case NoEvent(type_, begin, end):
                points = self._point(begin, prefix, given), self._point(end, prefix, given)
                self._need(0, 0, type_, *points, prefix, variables)
                return {begin.instant, end.instant}
            case Occurs(least, most, type_, begin, end):
                points = self._point(begin, prefix, given), self._point(end, prefix, given)
                self._need(least, most, type_, *points, prefix, variables)
                return {begin.instant, end.instant}
            case Instants(names):
                self.instants |= {self._instant(one, prefix, given)[0] for one in names}
                return set(names)
            case Variables(some, domain):
                if domain is not None:
                    self.conditions += [(MemberOf(one, domain), variables, prefix) for one in some]
                return set()
            case TimeOrder() | Distance() | ConstraintUse():
                return self._timing(statement, prefix, given)
            case Inclusion():
                return self._part(statement, prefix, variables, given)
        self.conditions.append((statement, variables, prefix))
        return set()

    def _timing(self, statement, prefix, given):
        match statement:
            case TimeOrder(points, operators):
                found = [self._point(one, prefix, given) for one in points]
                for left, operator, right in zip(found, operators, found[1:], strict=False):
                    self._compare(left, operator, right)
                return {one.instant for one in points}
            case Distance(to, None, interval):
                self.instants.add("0")
                self._distance(self._point(TimePoint(to), prefix, given), ("0", 0), interval)
                return {to}
            case Distance(to, from_, interval):
                points = self._point(TimePoint(to), prefix, given), self._point(TimePoint(from_), prefix, given)
                self._distance(*points, interval)
                return {to, from_}
        declared = self.file.complex_constraints[statement.name]
        points = [self._point(one, prefix, given) for one in statement.points]
        for one in declared.constraints:
            self._timing(one, f"{prefix}{statement.name}.", dict(zip(declared.parameters, points, strict=True)))
        return {one.instant for one in statement.points}

    def _part(self, part, prefix, variables, given):
        inner = self.file.chronicles[part.name]
        self._parts += 1
        name = f"{prefix}{part.name}_{self._parts}."
        theirs = {
            str(mine): self._parameter(one, prefix, variables)
            for mine, one in zip(inner.parameters, part.arguments, strict=True)
            if one != ChronicleVariable()
        }
        points = {}
        for at, (label, point) in enumerate(part.points):
            points[inner.instants[at] if label is None else label] = self._point(point, prefix, given)
        self._body(inner, name, theirs, points)
        return {point.instant for _, point in part.points}

    @staticmethod
    def _parameter(one, prefix, variables):
        """A symbol, or the name of a variable in the whole; a mere ? or * stays."""
        if isinstance(one, str) or not one.name:
            return one
        return variables.get(str(one), ChronicleVariable(prefix + one.name, star=one.star))

    def _need(self, least, most, type_, begin, end, prefix, variables):
        parameters = tuple(self._parameter(one, prefix, variables) for one in type_.parameters)
        self.needs.append(Need(least, most, type_.name, parameters, type_.change is not None, begin, end))

    # What is bound, and what events are of a type

    @property
    def bound(self):
        some = [str(one) for need in self.needs if need.least for one in need.parameters if _is_question(one)]
        return tuple(dict.fromkeys(some))

    def named(self, condition, variables, prefix):
        """The variables of a condition, in the names of the whole."""
        found = [self._parameter(one, prefix, variables) for one in variables_of(condition, self.file)]
        return {str(one) for one in found if isinstance(one, ChronicleVariable)}

    def holds(self, condition, variables, prefix, symbols):
        def value(one):
            found = self._parameter(one, prefix, variables)
            return found if isinstance(found, str) else symbols[str(found)]

        return truth(condition, value, self.file)

    def is_of(self, happening, need, symbols):
        """Whether an event is of the type of a predicate, under these symbols of the bound variables."""
        if (happening.name, len(happening.values)) != (need.name, len(need.parameters)):
            return False
        if (happening.change is not None) != need.is_change:
            return False
        wild = {}
        for given, value in zip(need.parameters, happening.values, strict=True):
            if isinstance(given, str):
                if value != given:
                    return False
            elif given.name:
                known = symbols.get(str(given), wild.get(str(given)) if not given.star else None)
                if value is None or (known is not None and known != value):
                    return False
                if str(given) not in symbols:
                    wild[str(given)] = value
        return self._is_declared(happening) and all(
            self.holds(condition, variables, prefix, {**symbols, **wild})
            for condition, variables, prefix in self.conditions
            if (names := self.named(condition, variables, prefix) - symbols.keys()) and names <= wild.keys()
        )

    def _is_declared(self, happening):
        declared = self.file.attributes.get(happening.name) or self.file.messages.get(happening.name)
        if declared is None:
            return True
        arguments = {str(one): value for one, value in zip(declared.parameters, happening.arguments, strict=True)}
        values = [None] if happening.change is None else [one for one in happening.change if one is not None]
        for value in values:
            known = {**arguments, "?value": value}
            if not all(
                truth(one, lambda each, known=known: each if isinstance(each, str) else known[str(each)], self.file)
                for one in declared.constraints
            ):
                return False
        return True

    # Instances

    @property
    def is_possible(self):
        """Whether its times agree with each other; where an event is asked for an interval holds something."""
        own = [(need.begin[0], need.end[0], need.end[1] - need.begin[1] - 1) for need in self.needs if need.least]
        return self._consistent({}, own)

    @property
    def fixed(self):
        """Instants on which a predicate asks for an event in [t + c, t + c + 1[."""
        some = [n.begin[0] for n in self.needs if n.least and n.begin[0] == n.end[0] and n.end[1] == n.begin[1] + 1]
        return tuple(dict.fromkeys(one for one in some if one != "0"))

    def instances(self, happenings, until_ms):
        """All instances recognised until a clock, in the order of recognition."""
        happenings = sorted(set(happenings), key=lambda one: one.at_ms)
        values = sorted({value for one in happenings for value in one.values if value is not None})
        found = []
        for some in product(values, repeat=len(self.bound)):
            symbols = dict(zip(self.bound, some, strict=True))
            if not all(
                self.holds(*condition, symbols)
                for condition in self.conditions
                if self.named(*condition) <= symbols.keys()
            ):
                continue
            matching = [[one.at_ms for one in happenings if self.is_of(one, need, symbols)] for need in self.needs]
            if all(len(times) >= need.least for times, need in zip(matching, self.needs, strict=True)):
                found += self._of_symbols(symbols, matching, until_ms)
        return sorted(found, key=lambda one: one.recognised_ms)

    def _of_symbols(self, symbols, matching, until_ms):
        after, least = None, {}
        while True:
            best = {}
            for times in self._assignments(matching):
                settled = self._settled(times, matching, after)
                if settled is not None and settled <= until_ms:
                    key = tuple(sorted((name, times[name]) for name in self.fixed))
                    best[key] = min(settled, best.get(key, settled))
            if self.fixed:
                least = best
                break
            if not best:
                return [Found(self.name, tuple(sorted(symbols.items())), (), clock) for clock in least]
            after = best[()]
            least[after] = after
        return [Found(self.name, tuple(sorted(symbols.items())), key, clock) for key, clock in least.items()]

    def _settled(self, times, matching, after):
        """The least clock at which these times are settled; None if there is none."""
        clock = None
        for need, found in zip(self.needs, matching, strict=True):
            begin, end = (times[name] + shift for name, shift in (need.begin, need.end))
            if after is not None and begin <= after:
                return None
            inside = [at for at in found if begin <= at < end]
            if len(inside) < need.least:
                return None
            due = [inside[need.least - 1]] if need.least else []
            if need.most is not None and end > begin:
                if len(inside) > need.most:
                    return None
                due.append(end)
            clock = max([*due, *([] if clock is None else [clock])], default=None)
        return clock

    def _assignments(self, matching) -> Iterator[dict[str, int]]:
        """Times of the instants in predicates that agree with the constraints, and leave the other instants some."""
        used = [name for need in self.needs for name in (need.begin[0], need.end[0])]
        used = [name for name in dict.fromkeys([*self.fixed, *used]) if name != "0"]
        reach = sum(min(abs(bound), 50) for _, _, bound in self.times) + sum(
            abs(shift) for need in self.needs for _, shift in (need.begin, need.end)
        )
        everything = {at for times in matching for at in times}
        window = sorted({at + shift for at in everything for shift in range(-reach - 2, reach + 3)})
        some = {
            name: sorted(
                {
                    at - need.begin[1]
                    for need, times in zip(self.needs, matching, strict=True)
                    if need.least and need.begin[0] == name == need.end[0] and need.end[1] == need.begin[1] + 1
                    for at in times
                }
            )
            if name in self.fixed
            else window
            for name in used
        }
        others = self.instants - set(used) - {"0"}
        for times in self._tried({"0": 0}, used, some):
            if self._is_young(times, used) and (not others or self._consistent(times)):
                yield times

    def _is_young(self, times, used):
        """Instants that stand in predicates differ by at most the age, but for those fixed by what has always been."""
        known = [times[name] for name in used if name not in self.fixed or times[name] > MINUS_INFINITY // 2]
        return self.max_age_ms is None or not known or max(known) - min(known) <= self.max_age_ms

    def _tried(self, times, left, some) -> Iterator[dict[str, int]]:
        if not left:
            yield times
            return
        for at in some[left[0]]:
            now = {**times, left[0]: at}
            if all(now[to] - now[from_] <= bound for to, from_, bound in self.times if to in now and from_ in now):
                yield from self._tried(now, left[1:], some)

    def _consistent(self, times, more=()):
        """Whether the other instants can be somewhere: no circle of constraints is negative (Bellman and Ford)."""
        edges = [*self.times, *more, *((name, "0", at) for name, at in times.items())]
        edges += [("0", name, -at) for name, at in times.items()]
        far = dict.fromkeys([*self.instants, "0"], 0)
        for _ in range(len(far) + 1):
            changed = False
            for to, from_, bound in edges:
                if far[from_] + bound < far[to]:
                    far[to], changed = far[from_] + bound, True
            if not changed:
                return True
        return False


def recognised(file, happenings, until_ms, max_age_ms=None):
    """Instances of all chronicles of a file, each of which is an event of others at the clock where it is told."""
    known, found, todo = in_order(happenings), {}, dict(file.chronicles)
    while todo:
        ready = [name for name in todo if not {n.name for n in Meaning(name, file).needs} & todo.keys() - {name}]
        for name in ready:
            del todo[name]
            meaning = Meaning(name, file, max_age_ms)
            found[name] = meaning.instances(known, until_ms)
            for one in found[name]:
                symbols = dict(one.bindings)
                said = tuple(each if isinstance(each, str) else symbols.get(str(each)) for each in meaning.parameters)
                known.append(Happening(one.recognised_ms, name, said))
    return [one for some in found.values() for one in some]


def _is_question(one):
    return isinstance(one, ChronicleVariable) and bool(one.name) and not one.star
