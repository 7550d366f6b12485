"""Ground formulas that share parts: compiled once, walked once, and bounded as if they shared nothing.

The value of a part is remembered until a fluent in it changes: most of a state is unchanged.
"""

from collections.abc import Callable, Iterator
from typing import Any, Final

from dyknow.model.errors import TextError
from dyknow.reasoning.formulas import tree
from dyknow.reasoning.formulas.evaluation import EvaluationCompiler, Term, Test

BEFORE: Final = "before "
"""Begins the name of a fluent of the earlier one of two states."""
LIMIT_PARTS: Final = 2_000_000
"""Most parts of one formula over the objects of a problem."""
REMEMBERED_FROM: Final = 8
"""Parts that a formula has at least for its truth to be remembered."""
_NO_LABELS: Final = frozenset[str]()


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
    """A compiler that compiles each node once, and counts it wherever it stands: that is what evaluating it may cost.

    Args:
        remembers: whether truths are kept until a label changes; tests that are given one state after another must not.

    Attributes:
        remembered: truths by the labels they depend on; a change of a label's value empties them. They are of one
            state, the one given to all tests.
    """

    def __init__(self, poll: Callable[[], None] = lambda: None, *, remembers: bool = True) -> None:
        super().__init__()
        self._poll, self._remembers = poll, remembers
        self.remembered: dict[str, list[list[int | None]]] = {}
        self._labels_of: dict[int, tuple[tree.Formula, frozenset[str]]] = {}
        self._tests_of: dict[int, tuple[tree.Formula, Test, int]] = {}
        self._terms_of: dict[int, tuple[tree.Formula, Term, int]] = {}

    def count(self, parts: int = 1) -> None:
        self.nodes_left -= parts
        if self.nodes_left < 0:
            raise TextError(
                f"a formula expands to more than {LIMIT_PARTS} parts over the objects of the problem",
                repair="quantify over fewer objects, or nest fewer quantifiers",
            )

    def labels(self, formula: tree.Formula) -> frozenset[str]:
        """The labels a ground formula reads, those of the earlier state without their tag."""
        return frozenset([label.removeprefix(BEFORE) for label in self._labels(formula)])

    def _labels(self, formula: Any) -> frozenset[str]:
        if isinstance(formula, tree.Feature):
            return frozenset((formula.label,))
        if isinstance(formula, tree.Const):
            return _NO_LABELS
        known = self._labels_of.get(id(formula))
        if known is None:
            known = self._labels_of[id(formula)] = formula, _NO_LABELS.union(*map(self._labels, tree.children(formula)))
        return known[1]

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
            self._poll()
            before = self.nodes_left
            made = super().test(formula)
            parts = before - self.nodes_left
            known = self._tests_of[id(formula)] = formula, self._remembering(formula, made, parts), parts
        else:
            self.count(known[2])
        return known[1]

    def _remembering(self, formula: tree.Formula, test: Test, parts: int) -> Test:
        labels = self._labels(formula) if self._remembers and parts >= REMEMBERED_FROM else _NO_LABELS
        if not labels or any(label.startswith(BEFORE) for label in labels):
            return test
        cell: list[int | None] = [None]
        for label in labels:
            self.remembered.setdefault(label, []).append(cell)

        def remembering(at_us: int, values: Any, domains: Any, events: Any, changed_us: Any) -> int:
            digit = cell[0]
            if digit is None:
                digit = cell[0] = test(at_us, values, domains, events, changed_us)
            return digit

        return remembering

    def term(self, formula: tree.Formula) -> Term:
        known = self._terms_of.get(id(formula))
        if known is None:
            before = self.nodes_left
            made = super().term(formula)
            known = self._terms_of[id(formula)] = formula, made, before - self.nodes_left
        else:
            self.count(known[2])
        return known[1]
