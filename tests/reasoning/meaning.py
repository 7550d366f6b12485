"""What a formula means: Definition 7.5.2 word by word over recorded states, slowly; nothing of the product but the tree.

`verdict` is True, False or None. Over a trace that has `ended` it is the thesis' semantics of a whole state sequence;
over one that goes on it is Kleene evaluation of what is known, an operator being decided as soon as no later state can
lie in its interval (F1 to F3). Atoms over `no_value` are None, or what the policy says (F5).
"""

from collections.abc import Mapping
from itertools import pairwise
from math import isnan
from typing import Any, NamedTuple

from dyknow.model.values import NO_VALUE
from dyknow.reasoning.formulas.tree import (
    Abs,
    Always,
    And,
    Arithmetic,
    Compare,
    Const,
    Duration,
    Eventually,
    Exists,
    Feature,
    Forall,
    Implies,
    Negate,
    Not,
    Now,
    Occurred,
    Or,
    Since,
    Until,
    Variable,
)

COMPARISONS = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    "=": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
    ">=": lambda a, b: a >= b,
    ">": lambda a, b: a > b,
}
CALCULATIONS = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
}
ATOMS_WITHOUT_VALUE = {"undecided": None, "skip": None, "false": False, "true": True}
Bindings = tuple[tuple[str, str], ...]


class State(NamedTuple):
    """One state; a feature that is absent has no value."""

    valid_us: int
    values: Mapping[str, Any]
    domains: Mapping[str, tuple[str, ...]] = {}
    events: tuple[str, ...] = ()


def all_of(values):
    values = list(values)
    return False if False in values else None if None in values else True


def any_of(values):
    values = list(values)
    return True if True in values else None if None in values else False


def negation(value):
    return None if value is None else not value


def said(verdict):
    return {True: "true", False: "false", None: "undecided"}[verdict]


def verdict(formula, states, start=0, *, period_us=None, ended=False):
    """What states [(time, values), ...] say of the formula in state `start`."""
    return Meaning(formula, states, period_us=period_us).verdict(len(states), start=start, ended=ended)


class Meaning:
    """Formulas over `states`; under the policy `skip`, over those in which `formula` lacks nothing."""

    def __init__(self, formula, states, *, period_us=None, no_value="undecided"):
        self.formula, self.period_us = formula, period_us
        self.unknown = ATOMS_WITHOUT_VALUE[no_value]
        self.states = [State(*state) for state in states]
        if no_value == "skip":
            self.states = self._complete()
        self.fixed = self.states[0].domains if self.states else {}
        self._found = {}

    def verdict(self, known, *, start=0, ended=False):
        """What the first `known` states say of the formula in state `start`; with `ended`, no other will come."""
        return self._at(self.formula, start, known, (), ended) if known and self.states else None

    def known_after(self, given, states):
        """How many states count among the first `given` of `states`, for `skip`."""
        last_us = states[given - 1][0]
        return sum(1 for state in self.states if state.valid_us <= last_us)

    def _at(self, node, at, known, env, ended):
        key = (id(node), at, known, env, ended)
        if key not in self._found:
            self._found[key] = self._evaluated(node, at, known, env, ended)
        return self._found[key]

    def _evaluated(self, node, at, known, env, ended):
        def here(part):
            return self._at(part, at, known, env, ended)

        match node:
            case Not(operand):
                return negation(here(operand))
            case And(parts):
                return all_of(here(part) for part in parts)
            case Or(parts):
                return any_of(here(part) for part in parts)
            case Implies(left, right):
                return any_of([negation(here(left)), here(right)])
            case Eventually(operand, lo, hi):
                return self._until(None, operand, (lo, hi), at, known, env, ended)
            case Always(operand, lo, hi):
                return self._always(operand, (lo, hi), at, known, env, ended)
            case Until(left, right, lo, hi):
                return self._until(left, right, (lo, hi), at, known, env, ended)
            case Forall() | Exists():
                return self._quantified(node, at, known, env, ended)
        return self._atom(node, at, env)

    def _selected(self, interval, at, known, ended):
        """The known states of the interval from state `at`, and whether one to come may lie in it."""
        start = self.states[at].valid_us
        lo, hi = interval
        end = float("inf") if hi is None else start + hi
        chosen = [k for k in range(at, known) if start + lo <= self.states[k].valid_us <= end]
        soonest = self.states[known - 1].valid_us + (self.period_us or 1)
        return chosen, not ended and soonest <= end

    def _until(self, left, right, interval, at, known, env, ended):
        """exists t in the interval: right at t, and left at every t' from now to before t."""
        chosen, more = self._selected(interval, at, known, ended)
        lefts = [True if left is None else self._at(left, k, known, env, ended) for k in range(at, known)]
        ways = [all_of([self._at(right, k, known, env, ended), *lefts[: k - at]]) for k in chosen]
        return any_of([*ways, all_of([None, *lefts])] if more else ways)

    def _always(self, operand, interval, at, known, env, ended):
        """for all t in the interval: the operand at t."""
        chosen, more = self._selected(interval, at, known, ended)
        return all_of([*(self._at(operand, k, known, env, ended) for k in chosen), *([None] if more else [])])

    def _quantified(self, node, at, known, env, ended):
        join = all_of if isinstance(node, Forall) else any_of
        if not node.growing:
            members = self._members(node.domain, self.fixed, env)
            return join(self._at(node.body, at, known, _bound(env, node.variable, one), ended) for one in members)
        if not temporal(node.body):
            members = self._members(node.domain, self.states[at].domains, env)
            return join(self._at(node.body, at, known, _bound(env, node.variable, one), ended) for one in members)
        since = {}
        for newest in range(at, known):
            now = self._members(node.domain, self.states[newest].domains, env)
            since = {one: since.get(one, newest) for one in now}
            over = ended and newest + 1 == known
            whole = join(
                self._at(node.body, since[one], newest + 1, _bound(env, node.variable, one), over) for one in now
            )
            if now and whole is not None:
                return whole
        return None

    def _members(self, domain, domains, env):
        def named(members):
            if isinstance(members, str):
                return domains[members]
            return [dict(env)[one.name] if isinstance(one, Variable) else one for one in members]

        left_out = {one for each in domain.minus for one in named(each)}
        return [one for one in dict.fromkeys(named(domain.base)) if one not in left_out]

    def _atom(self, node, at, env):
        match node:
            case Const(value):
                return value
            case Occurred(event):
                return _label(event, env) in self.states[at].events
            case Feature():
                value = self._term(node, at, env)
                return value if isinstance(value, bool) else self.unknown
            case Compare(operator, left, right):
                a, b = self._term(left, at, env), self._term(right, at, env)
                if a is None or b is None:
                    return self.unknown
                try:
                    return COMPARISONS[operator](a, b)
                except TypeError:
                    return self.unknown
        raise AssertionError(node)

    def _term(self, node, at, env):
        """The value of a term in a state, None if it has none."""
        match node:
            case Const(value):
                return value
            case Duration(us):
                return us
            case Variable(name):
                return dict(env)[name]
            case Now():
                return self.states[at].valid_us
            case Feature():
                return _value(self.states[at], _label(node, env))
            case Since(feature):
                return self._since(_label(feature, env), at)
            case Negate(operand):
                return _calculated(lambda a: -a, self._term(operand, at, env))
            case Abs(operand):
                return _calculated(abs, self._term(operand, at, env))
            case Arithmetic(operator, left, right):
                return _calculated(CALCULATIONS[operator], self._term(left, at, env), self._term(right, at, env))
        raise AssertionError(node)

    def _since(self, label, at):
        """From the last state in which the feature had another value than before; its first value is a change."""
        if _value(self.states[at], label) is None:
            return None
        had = [(state.valid_us, _value(state, label)) for state in self.states[: at + 1]]
        had = [(at_us, value) for at_us, value in had if value is not None]
        changes = [now_us for (_, before), (now_us, now) in pairwise(had) if before != now]
        return self.states[at].valid_us - ([had[0][0], *changes][-1])

    def _complete(self):
        """The states in which the formula lacks nothing; fixed quantifiers begin with the first of these."""
        kept = []
        for state in self.states:
            fixed = kept[0].domains if kept else state.domains
            if all(_value(state, label) is not None for label in self._reads(self.formula, fixed, state.domains, ())):
                kept.append(state)
        return kept

    def _reads(self, node, fixed, now, env):
        """The labels of all features in the formula, quantifiers over their members."""
        if isinstance(node, Feature):
            yield _label(node, env)
        elif isinstance(node, Forall | Exists):
            for one in self._members(node.domain, now if node.growing else fixed, env):
                yield from self._reads(node.body, fixed, now, _bound(env, node.variable, one))
        elif not isinstance(node, Occurred):
            for part in parts_of(node):
                yield from self._reads(part, fixed, now, env)


def parts_of(node):
    """The formulas directly inside a formula."""
    match node:
        case And(parts) | Or(parts):
            return parts
        case Not(one) | Negate(one) | Abs(one) | Since(one) | Always(one) | Eventually(one):
            return (one,)
        case Implies(left, right) | Until(left, right):
            return (left, right)
        case Compare(_, left, right) | Arithmetic(_, left, right):
            return (left, right)
        case Forall(_, _, body) | Exists(_, _, body):
            return (body,)
    return ()


def temporal(node):
    return isinstance(node, Until | Always | Eventually) or any(temporal(part) for part in parts_of(node))


def _bound(env, variable, member):
    return (*((name, one) for name, one in env if name != variable), (variable, member))


def _label(feature, env):
    stem = f"{feature.name}.{feature.attribute}" if feature.attribute else feature.name
    objects = [dict(env)[one.name] if isinstance(one, Variable) else one for one in feature.objects]
    return f"{stem}[{', '.join(objects)}]" if objects else stem


def _value(state, label):
    """None for no value, which a number that is none (NaN) is as well."""
    value = state.values.get(label)
    return None if value is NO_VALUE or _is_nan(value) else value


def _is_nan(value):
    return isinstance(value, float) and isnan(value)


def _calculated(calculate, *operands):
    if None in operands:
        return None
    try:
        result = calculate(*operands)
    except (TypeError, ArithmeticError):
        return None
    return None if _is_nan(result) else result
