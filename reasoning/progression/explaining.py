"""Why a formula was decided: which part of it, for which members, since when, by which samples.

A formula turns false when every obligation of one clause of the remainder has failed, and true when one of each clause
was met. The deciding state's values for those obligations are followed down to comparisons of single values. Where it
lies beyond the window of an obligation, it does not bear on it: then the end of the window is the reason.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from dyknow.model.sample import Value
from dyknow.model.values import NO_VALUE
from dyknow.reasoning.formulas import tree
from dyknow.reasoning.formulas.evaluation import EvaluationCompiler, Moment
from dyknow.reasoning.formulas.skeletons import Binding, TakenApart
from dyknow.reasoning.progression.automaton import Progressor, TruthAssignment
from dyknow.reasoning.progression.clauses import FALSE, FOREVER, TRUE, UNKNOWN_NUMBER, Block, Clauses, Obligation


class Explanation(NamedTuple):
    """One part of a formula that the deciding state settled.

    Attributes:
        part: the formula about one state that was true or false there, as written, members put in; or a temporal one
            whose window was over there, without samples.
        holds: which of the two.
        obligation: the temporal part of the formula that needed it; None if the formula as a whole did.
        binding: the members for which quantifiers range over it.
        since_us: the state at which the obligation arose, None if it is older than the kept ones.
        until_us: the end of its window, None without end.
        valid_us: the deciding state.
        samples: its values, by label.
    """

    part: tree.Formula
    holds: bool
    obligation: tree.Formula | None
    binding: Binding
    since_us: int | None
    until_us: int | None
    valid_us: int
    samples: Mapping[str, Value]


class _Within(NamedTuple):
    obligation: tree.Formula | None = None
    since_us: int | None = None
    until_us: int | None = None


class Explainer:
    """Explains one decision.

    Args:
        left: the remainder before the deciding state, windows relative to the epoch; None if that was the first.
        assignment: of the deciding state.
        moment: the deciding state.
    """

    def __init__(
        self,
        taken_apart: TakenApart,
        progressor: Progressor,
        compiler: EvaluationCompiler,
        left: Clauses | None,
        assignment: TruthAssignment,
        moment: Moment,
    ) -> None:
        self._apart, self._progressor, self._compiler = taken_apart, progressor, compiler
        self._left, self._assignment, self._moment = left, assignment, moment

    def reasons(self, *, truth: bool) -> tuple[Explanation, ...]:
        """The reasons of the formula's truth, or of its falsehood."""
        if self._left is None:
            found = self._node(len(self._apart.skeleton.nodes) - 1, truth, _Within())
        else:
            found = self._clauses(self._left, truth)
        return tuple(_once(found))

    def _clauses(self, left: Clauses, truth: bool) -> Iterator[Explanation]:
        wanted, now_us = TRUE if truth else FALSE, self._moment.valid_us
        for clause in sorted(left, key=lambda one: sorted(map(repr, one))):
            settled = [one for one in clause if self._progressor.after(one, self._assignment, now_us, 0) == wanted]
            if settled and (truth or len(settled) == len(clause)):
                for one in settled[:1] if truth else settled:
                    yield from self._obligation(one, truth)
                if not truth:
                    return

    def _obligation(self, one: Obligation | Block, truth: bool) -> Iterator[Explanation]:
        if isinstance(one, Block):
            yield from self._clauses(one.clauses, truth)
        elif one[0] != UNKNOWN_NUMBER:
            number, from_us, to_us = one
            at, now_us = self._progressor.node_of(number), self._moment.valid_us
            within = self._within(at, to_us)
            yield from self._operator(at, truth, within, within, is_inside=from_us <= now_us <= to_us)

    def _within(self, at: int, to_us: int) -> _Within:
        node, origin = self._apart.skeleton.nodes[at], self._apart.origins[at]
        if to_us == FOREVER or node.hi_us is None:
            return _Within(origin.formula)
        return _Within(origin.formula, to_us - node.hi_us, to_us)

    def _operator(
        self, at: int, truth: bool, own: _Within, around: _Within, *, is_inside: bool
    ) -> Iterator[Explanation]:
        """Of a temporal operator those sides that the state settled the same way, else both. A state outside of its
        window settles only what must hold until then; otherwise the window was over, which no sample tells.
        """
        parts = self._apart.skeleton.nodes[at].parts
        sides = parts if is_inside else parts[:-1]
        settled = [part for part in sides if self._started(part) == (TRUE if truth else FALSE)]
        if is_inside or settled:
            for part in settled or parts:
                yield from self._node(part, truth, around)
        else:
            origin, now_us = self._apart.origins[at], self._moment.valid_us
            holds = truth is not origin.negated
            yield Explanation(origin.formula, holds, None, origin.binding, own.since_us, own.until_us, now_us, {})

    def _started(self, at: int) -> Clauses:
        return self._progressor.start(self._assignment, at)

    def _node(self, at: int, truth: bool, within: _Within) -> Iterator[Explanation]:
        node = self._apart.skeleton.nodes[at]
        if node.kind == "constant":
            return
        if node.kind == "atom":
            atom, negated = node.parts
            binding = self._apart.origins[at].binding
            yield from self._state(self._apart.atoms[atom], truth is not bool(negated), binding, within)
        elif node.kind in {"and", "or"}:
            settled = [part for part in node.parts if self._started(part) == (TRUE if truth else FALSE)]
            one_is_enough = (node.kind == "or") is truth
            for part in (settled[:1] if truth else settled) if one_is_enough and settled else node.parts:
                yield from self._node(part, truth, within)
        else:
            now_us = self._moment.valid_us
            ends_us = None if node.hi_us is None else now_us + node.hi_us
            inner = _Within(self._apart.origins[at].formula, now_us, ends_us)
            around = inner if within.obligation is None else within
            yield from self._operator(at, truth, inner, around, is_inside=not node.lo_us)

    def _state(self, formula: tree.Formula, truth: bool, binding: Binding, within: _Within) -> Iterator[Explanation]:
        """A formula about one state, down to the comparisons that make it true or false there."""
        match formula:
            case tree.Not(operand):
                yield from self._state(operand, not truth, binding, within)
            case tree.And(parts):
                yield from self._parts([(part, binding) for part in parts], truth, within, every=True)
            case tree.Or(parts):
                yield from self._parts([(part, binding) for part in parts], truth, within, every=False)
            case tree.Implies(left, right):
                yield from self._parts([(tree.Not(left), binding), (right, binding)], truth, within, every=False)
            case tree.Forall(variable, domain, body, growing) | tree.Exists(variable, domain, body, growing):
                members = tree.domain_members(domain, self._moment.domains if growing else self._compiler.domains)
                bodies = [(tree.instantiate(body, variable, one), (*binding, (variable, one))) for one in members]
                yield from self._parts(bodies, truth, within, every=isinstance(formula, tree.Forall))
            case _:
                labels = tree.required_labels(formula, self._compiler.domains)
                samples = {label: self._moment.values.get(label, NO_VALUE) for label in labels}
                yield Explanation(formula, truth, *within[:1], binding, *within[1:], self._moment.valid_us, samples)

    def _parts(
        self, parts: list[tuple[tree.Formula, Binding]], truth: bool, within: _Within, *, every: bool
    ) -> Iterator[Explanation]:
        settled = [(part, binding) for part, binding in parts if self._compiler.test(part)(*self._moment) == truth]
        if every is not truth:
            parts = settled[:1] if truth else settled
        for part, binding in parts:
            yield from self._state(part, truth, binding, within)


def _once(reasons: Iterator[Explanation]) -> Iterator[Explanation]:
    met: list[Explanation] = []
    for one in reasons:
        if one not in met:
            met.append(one)
            yield one
