"""Formulas that are right as they stand and yet hardly meant (thesis 7.9), each with a formula that says more.

A bare `always` over what a sensor says is violated by one wrong sample; `eventually` or `exists` over an implication
holds as soon as its left side is false. That `always A -> B` reads as `(always A) -> B` is an error already (`parsing.py`).
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, Final, NamedTuple

from dyknow.anchoring.links.specification import FROM
from dyknow.kpl.syntax import specification as spec
from dyknow.kpl.syntax.printing import print_formula
from dyknow.reasoning.formulas import tree

SETTLES_US: Final = 500_000
"""The time for a value to come back, as the repair suggests it; users choose it for their sensor."""


class LintWarning(NamedTuple):
    """A message about a node, and a suggestion."""

    node: tree.Node
    message: str
    repair: str


def lint(
    formula: tree.Formula, is_noisy: Callable[[tree.Feature], bool] = lambda _feature: True
) -> Iterator[LintWarning]:
    """Lint warnings about a formula; `is_noisy` tells which features are raw values of a sensor."""
    for node in tree.walk(formula):
        if isinstance(node, tree.Always) and node.hi_us is None and not tree.is_temporal(node.operand):
            noisy = [one for one in _measured(node.operand) if is_noisy(one)]
            if noisy:
                feature = min(noisy, key=lambda one: one.place.start)
                message = f"one wrong sample of {feature.name} violates this; what counts only if it lasts"
                yield LintWarning(node, message, print_formula(replace(node, operand=_lasting(node.operand))))
        elif isinstance(node, tree.Eventually | tree.Exists):
            inside = node.operand if isinstance(node, tree.Eventually) else node.body
            if isinstance(inside, tree.Implies):
                name = "eventually" if isinstance(node, tree.Eventually) else "exists"
                meant: Any = tree.And((inside.left, inside.right))
                part = {"operand": meant} if isinstance(node, tree.Eventually) else {"body": meant}
                message = f"this {name} holds as soon as the left side of its -> is false"
                yield LintWarning(node, message, print_formula(replace(node, **part)))


def withdrawn_and_back(link: spec.Link) -> Iterator[LintWarning]:
    """An exclusive link whose `reestablish` does not ask what `establish` asks of `from`: withdrawn, it is back at once,
    and the link that excludes it never begins.
    """
    if not link.options.exclusive:
        return
    asked, again = (
        {
            node.stem
            for node in tree.walk(each)
            if isinstance(node, tree.Feature) and tree.Variable(FROM) in node.objects
        }
        for each in (link.establish, link.reestablish)
    )
    missing = sorted(asked - again)
    if missing:
        message = (
            f"reestablish asks nothing of {missing[0]}[{FROM}]: withdrawn for it, the link is back at once, and those "
            f"with `exclusive {link.options.exclusive}` never begin"
        )
        yield LintWarning(link.reestablish, message, print_formula(tree.And((link.reestablish, link.establish))))


def _measured(formula: tree.Formula) -> Iterator[tree.Feature]:
    """Features that are compared by size, so that a small error of measurement can change the result."""
    for node in tree.walk(formula):
        if isinstance(node, tree.Compare) and node.operator not in {"=", "!="}:
            yield from (one for one in tree.walk(node) if isinstance(one, tree.Feature))


def _lasting(operand: tree.Formula) -> tree.Formula:
    """The operand, to hold again within a time; for each member by itself."""
    if isinstance(operand, tree.Forall):
        return replace(operand, body=_lasting(operand.body))
    return tree.Eventually(operand, 0, SETTLES_US)
