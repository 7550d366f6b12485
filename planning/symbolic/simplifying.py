"""Domains without what only we have: definitions are written out, numbers that name a feature's value put in place.

The rest speaks of features, objects and numbers. A part that never changes and is calculated becomes a feature of its
own, with the value it has for each objects: `way(place, place2) <= RANGE` is then known, not calculated.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any, Final

from dyknow.kpl.diagnostics.collector import ErrorCollector
from dyknow.model.errors import TextError
from dyknow.planning.domains import model
from dyknow.planning.domains.model import Application, Declarations, Expression, Quantified
from dyknow.planning.domains.sorts import SortChecker
from dyknow.planning.search.grounding import Grounder
from dyknow.planning.search.tasks import PlanningTask
from dyknow.reasoning.formulas import tree

LIMIT_VALUES: Final = 200_000
"""Most values of a feature in place of a calculation."""


class Simplifier:
    """Rewrites the expressions of a domain with its problem.

    Attributes:
        calculated: the features that stand for calculated parts, with their values by objects.
    """

    def __init__(self, declared: Declarations) -> None:
        self.task = PlanningTask(declared)
        self.sorts = SortChecker(declared, ErrorCollector(""))
        self._grounder = Grounder(self.task)
        self.calculated: dict[str, tuple[model.FeatureDeclaration, dict[tuple[str, ...], Any]]] = {}
        self._known: dict[tuple[Expression, tuple[str, ...]], str] = {}

    def simplified(self, expression: Expression, bound: dict[str, str]) -> Expression:
        """The expression with definitions written out, over variables with these types, and features in place of
        calculations.

        Raises:
            TextError: `next` or `goal` stands in it, or a number that nothing binds.
        """
        return self._named(self.written_out(expression), bound)

    def written_out(self, expression: Expression) -> Expression:
        """Without derived features and variables over numbers."""
        match expression:
            case Application(name, args):
                given = tuple([self.written_out(one) for one in args])
                known = self.task.derived.get(name)
                if known is None:
                    if not args and name in self.task.constants:
                        value = self.task.constants[name]
                        return Application(value) if isinstance(value, str) else tree.Const(value)
                    return replace(expression, args=given)
                names = {one.name: arg for one, arg in zip(known.parameters, given, strict=True)}
                return self.written_out(model.substitute(known.body, names))
            case Quantified(kind, variables, body):
                objects = tuple([one for one in variables if self.task.types.of_variable(one) is not None])
                numbers = [one.name for one in variables if one not in objects]
                premise = body.left if kind == "forall" and isinstance(body, tree.Implies) else body
                inside = self.written_out(model.substitute(body, self.terms(numbers, premise)))
                return Quantified(kind, objects, inside, place=expression.place) if objects else inside
            case model.Next() | model.InGoal():
                raise TextError.at(expression.place, "this is about more than one state: only control formulas are")
        changed: dict[str, Any] = {}
        for name in expression.__dataclass_fields__:
            inner = getattr(expression, name)
            if isinstance(inner, tree.Node) and name != "place":
                changed[name] = self.written_out(inner)
            elif name == "parts":
                changed[name] = tuple([self.written_out(one) for one in inner])
        return replace(expression, **changed) if changed else expression

    def terms(self, numbers: list[str], condition: Expression) -> dict[str, Expression]:
        """The terms that variables over numbers stand for."""
        found: dict[str, Expression] = {}
        for name in numbers:
            term = model.definition(condition, name, self.task.derived)
            if term is None:
                raise TextError(f"{name} is a number that no equation binds", repair=f"xpos(box) == {name}")
            found[name] = term
        for _ in numbers:
            found = {name: model.substitute(term, found) for name, term in found.items()}
        return found

    def _named(self, expression: Expression, bound: dict[str, str]) -> Expression:
        """The expression with features in place of calculations over constants."""
        is_calculation = isinstance(expression, tree.Arithmetic | tree.Compare | tree.Negate) or (
            isinstance(expression, Application) and expression.name in model.FUNCTIONS
        )
        if is_calculation and self._is_calculated(expression, bound) and not self._fluents(expression):
            return self._feature(expression, bound)
        match expression:
            case Quantified(_, variables, body):
                inside = {one.name: str(self.task.types.of_variable(one)) for one in variables}
                return replace(expression, body=self._named(body, {**bound, **inside}))
            case tree.And(parts) | tree.Or(parts):
                return replace(expression, parts=tuple([self._named(one, bound) for one in parts]))
            case Application(_, args):
                return replace(expression, args=tuple([self._named(one, bound) for one in args]))
        changed = {
            name: self._named(inner, bound)
            for name in expression.__dataclass_fields__
            if name != "place" and isinstance(inner := getattr(expression, name), tree.Node)
        }
        return replace(expression, **changed) if changed else expression

    def _is_calculated(self, expression: Expression, bound: dict[str, str]) -> bool:
        """Whether it is about numbers, and not a number itself."""
        parts = list(tree.walk(expression))
        return any(isinstance(one, Application) and one.name in self.task.features for one in parts) and any(
            self.sorts.sort(one, bound) == model.NUMBER for one in parts if not isinstance(one, Quantified)
        )

    def _fluents(self, expression: Expression) -> bool:
        return any(one.name in self.task.fluents for one in model.calls(expression))

    def _feature(self, expression: Expression, bound: dict[str, str]) -> Expression:
        names = tuple(sorted({one.name for one in model.calls(expression) if not one.args and one.name in bound}))
        key = (expression, names)
        label = self._known.get(key)
        if label is None:
            label = self._known[key] = f"calculated-{len(self._known) + 1}"
            sorts = tuple(bound[one] for one in names)
            is_truth = isinstance(expression, tree.Compare)
            declared = model.FeatureDeclaration(label, sorts, model.BOOLEAN if is_truth else model.NUMBER)
            self.calculated[label] = declared, dict(self._values(expression, names, sorts))
        return Application(label, tuple([Application(one) for one in names]))

    def _values(
        self, expression: Expression, names: tuple[str, ...], sorts: tuple[str, ...]
    ) -> Iterator[tuple[tuple[str, ...], Any]]:
        for count, objects in enumerate(product(*(self.task.types.members[sort] for sort in sorts))):
            if count >= LIMIT_VALUES:
                raise TextError.at(expression.place, f"this has more than {LIMIT_VALUES} values over the objects")
            env = {name: self._grounder.object(one) for name, one in zip(names, objects, strict=True)}
            found = self._grounder.ground(expression, env)
            if not isinstance(found, tree.Const):
                found = tree.Const(False) if isinstance(expression, tree.Compare) else tree.Const(0)
            yield objects, found.value
