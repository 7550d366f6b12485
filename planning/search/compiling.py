"""Ground formulas that share parts: compiled once, walked once, and bounded as if they shared nothing."""

from collections.abc import Iterator
from typing import Any, Final

from dyknow.model.errors import TextError
from reasoning.formulas import tree
from reasoning.formulas.evaluation import EvaluationCompiler, Term, Test

BEFORE: Final = "before "
"""Begins the name of a fluent of the earlier one of two states."""
LIMIT_PARTS: Final = 2_000_000
"""Most parts of one formula over the objects of a problem."""


def labels_of(one: tree.Formula) -> frozenset[str]:
    """The labels a ground formula reads, those of the earlier state without their tag."""
    return frozenset(node.label.removeprefix(BEFORE) for node in _nodes(one) if isinstance(node, tree.Feature))


def is_temporal(one: tree.Formula) -> bool:
    """Whether a ground formula is about more than one state."""
    return any(isinstance(node, tree.TEMPORAL) for node in _nodes(one))


def _nodes(one: tree.Formula) -> Iterator[Any]:
    """Every node once, however many formulas share it."""
    waiting: list[Any] = [one]
    met: set[int] = set()
    while waiting:
        node = waiting.pop()
        if id(node) not in met:
            met.add(id(node))
            yield node
            waiting.extend(tree.children(node))


class SharingCompiler(EvaluationCompiler):
    """A compiler that compiles each node once, and counts it wherever it stands: that is what evaluating it may cost."""

    def __init__(self) -> None:
        super().__init__()
        self._tests_of: dict[int, tuple[tree.Formula, Test, int]] = {}
        self._terms_of: dict[int, tuple[tree.Formula, Term, int]] = {}

    def count(self, parts: int = 1) -> None:
        self.nodes_left -= parts
        if self.nodes_left < 0:
            raise TextError(
                f"a formula expands to more than {LIMIT_PARTS} parts over the objects of the problem",
                repair="quantify over fewer objects, or nest fewer quantifiers",
            )

    def whole_test(self, formula: tree.Formula) -> Test:
        """The test of a formula that is not part of another one."""
        self.nodes_left = LIMIT_PARTS
        return self.test(formula)

    def whole_term(self, formula: tree.Formula) -> Term:
        """The value of a term that is not part of another one."""
        self.nodes_left = LIMIT_PARTS
        return self.term(formula)

    def test(self, formula: tree.Formula) -> Test:
        known = self._tests_of.get(id(formula))
        if known is None:
            before = self.nodes_left
            made = super().test(formula)
            known = self._tests_of[id(formula)] = formula, made, before - self.nodes_left
        else:
            self.count(known[2])
        return known[1]

    def term(self, formula: tree.Formula) -> Term:
        known = self._terms_of.get(id(formula))
        if known is None:
            before = self.nodes_left
            made = super().term(formula)
            known = self._terms_of[id(formula)] = formula, made, before - self.nodes_left
        else:
            self.count(known[2])
        return known[1]
