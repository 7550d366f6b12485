"""Control formulas along a search, against their meaning over the finished state sequence of a plan (thesis 7.4.2)."""

from itertools import count
from math import inf
from typing import Any

from hypothesis import example, given
from hypothesis import strategies as st

from dyknow.planning import NoPlan, find_plan, parse_domain, parse_problem
from dyknow.planning.domains.model import Application, Next
from dyknow.planning.domains.printing import print_expression
from dyknow.reasoning.formulas import tree
from tests.planning.flights import MAP, TRUCKS
from tests.planning.replay import Replay

PLACES = st.sampled_from("abcd").map(Application)
UAV = Application("u1")
ATOMS = st.one_of(
    PLACES.map(lambda place: tree.Compare("=", Application("at", (UAV,)), place)),
    PLACES.map(lambda place: Application("seen", (place,))),
    st.just(Application("airborne", (UAV,))),
)
TIMES = st.integers(0, 12).map(lambda s: s * 1_000_000)
WINDOWS = st.one_of(st.just((0, None)), st.tuples(TIMES, TIMES).map(lambda two: (min(two), max(two))))


def _larger(inner: Any) -> Any:
    return st.one_of(
        inner.map(tree.Not),
        st.tuples(inner, inner).map(tree.And),
        st.tuples(inner, inner).map(tree.Or),
        st.builds(tree.Implies, inner, inner),
        st.builds(lambda one, window: tree.Always(one, *window), inner, WINDOWS),
        st.builds(lambda one, window: tree.Eventually(one, *window), inner, WINDOWS),
        st.builds(lambda one, other, window: tree.Until(one, other, *window), inner, inner, WINDOWS),
    )


FORMULAS = st.recursive(ATOMS, _larger, max_leaves=5)
IN_A_ROW = st.builds(lambda one, other: tree.Always(tree.Implies(one, Next(other))), ATOMS, FORMULAS)
CONTROLS = st.one_of(FORMULAS, FORMULAS.map(tree.Always), IN_A_ROW)


class Meaning:
    """The meaning of formulas over states that begin at times; the last one persists for ever."""

    def __init__(self, replay: Replay) -> None:
        self._replay = replay
        self._times = [at_ms * 1000 for at_ms, _ in replay.states]
        self._last = len(self._times) - 1

    def holds(self, node: Any, at: int) -> bool:
        """At a state; one after the last is the last one, later."""
        match node:
            case tree.Not(operand):
                return not self.holds(operand, at)
            case tree.And(parts):
                return all(self.holds(one, at) for one in parts)
            case tree.Or(parts):
                return any(self.holds(one, at) for one in parts)
            case tree.Implies(left, right):
                return not self.holds(left, at) or self.holds(right, at)
            case Next(operand):
                return self.holds(operand, min(at, self._last) + 1)
            case tree.Always(operand, lo_us, hi_us):
                return not self.until(tree.Const(True), tree.Not(operand), lo_us, hi_us, at)
            case tree.Eventually(operand, lo_us, hi_us):
                return self.until(tree.Const(True), operand, lo_us, hi_us, at)
            case tree.Until(left, right, lo_us, hi_us):
                return self.until(left, right, lo_us, hi_us, at)
        return bool(self._replay.value(node, {}, self._replay.states[min(at, self._last)][1]))

    def until(self, left: Any, right: Any, lo_us: Any, hi_us: Any, at: int) -> bool:
        if at > self._last:
            return self.holds(right, at) and (not lo_us or self.holds(left, at))
        ends_us = inf if hi_us is None else self._times[at] + hi_us
        for there in range(at, self._last + 1):
            if self._times[at] + lo_us <= self._times[there] <= ends_us and self.holds(right, there):
                return True
            if not self.holds(left, there):
                return False
        later = self._last + 1
        is_open = self._times[at] + lo_us <= self._times[self._last] + 1
        return ends_us > self._times[self._last] and self.holds(right, later) and (is_open or self.holds(left, later))


def test_the_meaning_is_that_of_7_5_1() -> None:
    replay = Replay(parse_domain(TRUCKS).joined(parse_problem(MAP + "#goal seen(d)", parse_domain(TRUCKS))))
    replay.states = [(0, {("seen", ("a",)): True}), (3000, {}), (5000, {("seen", ("b",)): True})]
    a, b = (Application("seen", (Application(one),)) for one in "ab")
    meaning = Meaning(replay)
    assert meaning.holds(tree.Eventually(b, 0, 5_000_000), 0)
    assert not meaning.holds(tree.Eventually(b, 0, 4_000_000), 0)
    assert meaning.holds(tree.Eventually(tree.Always(b)), 0)
    assert not meaning.holds(tree.Until(a, b), 0)
    assert meaning.holds(Next(tree.Not(a)), 0)


@example(
    tree.Always(
        tree.Implies(
            tree.Compare("=", Application("at", (UAV,)), Application("a")),
            Next(tree.Compare("=", Application("at", (UAV,)), Application("b"))),
        )
    ),
    False,
)
@given(CONTROLS, st.booleans())
def test_a_plan_is_found_exactly_if_its_states_satisfy_the_formula(control: Any, more: bool) -> None:
    """What is found satisfies the formula; if a plan without it does, one is found with it."""
    domain = parse_domain(TRUCKS)
    goal = "\n#goal seen(d) & seen(b)" if more else "\n#goal seen(c)"
    free = parse_problem(MAP + goal, domain)
    asked = parse_problem(f"{MAP}#control c: {print_expression(control)}{goal}", domain)
    counted = count()
    result = find_plan(domain, asked, stop=lambda: "enough" if next(counted) > 40 else "")
    if not isinstance(result, NoPlan):
        replay = Replay(domain.joined(asked))
        assert replay.check([one.as_json() for one in result.plan.actions]) == []
        assert Meaning(replay).holds(control, 0)
    elif result.is_certain:
        unsteered = find_plan(domain, free)
        assert not isinstance(unsteered, NoPlan)
        replay = Replay(domain.joined(free))
        replay.check([one.as_json() for one in unsteered.plan.actions])
        assert not Meaning(replay).holds(control, 0)
