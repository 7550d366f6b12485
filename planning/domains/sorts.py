"""Sorts of expressions: the meaning of every name in them, and whether values of one sort meet.

A sort is `boolean`, `fp` for numbers, or the name of a type; None is unknown, after an error, and fits everywhere.
"""

import re
from collections.abc import Mapping
from typing import Final

from dyknow.kpl.diagnostics.collector import ErrorCollector, nearest
from dyknow.planning.domains import model
from dyknow.planning.domains.model import (
    BOOLEAN,
    NUMBER,
    Application,
    Declarations,
    Expression,
    InGoal,
    Next,
    Quantified,
)
from dyknow.planning.domains.types import Types
from dyknow.reasoning.formulas import tree

EXECUTING: Final = "executing-"
"""Begins the name of an operator's execution flag (7.6.2); in its own monitors the flag is `EXEC` as well."""
_NUMBER_NAME: Final = re.compile(r"[xyz][0-9]*'*")
_TEMPORAL: Final = (*tree.TEMPORAL, Next)
Bound = Mapping[str, str | None]
"""Variables with their sorts."""


class SortChecker:
    """Looks at expressions; errors go to the collector.

    Attributes:
        executing: operators with their numbers of parameters: their flags may be asked for in monitors.
    """

    def __init__(self, declared: Declarations, errors: ErrorCollector) -> None:
        self.declared, self._errors = declared, errors
        self.types = Types(declared)
        self.features = {one.name: one for one in declared.features}
        self.derived = {one.name: one for one in declared.derived}
        self.constants: set[str] = set(model.CONSTANTS) | {one.name for one in declared.constants}
        self.executing = {f"{EXECUTING}{one.name}": len(one.parameters) for one in declared.operators}
        self._is_monitor = False
        self._derived_sorts: dict[str, str | None] = {}

    def error(self, message: str, node: tree.Node, repair: str = "") -> None:
        self._errors.error(message, node.place, repair)

    def bound(self, parameters: tuple[model.Parameter, ...], node: tree.Node) -> dict[str, str | None]:
        """Variables with their sorts; a name that begins with no type is a number."""
        found: dict[str, str | None] = {}
        for one in parameters:
            if one.name in found:
                self.error(f"{one.name} stands twice", node, f"{one.name}2")
            sort = self.types.of_variable(one)
            if one.sort is not None and sort is not None and sort not in self.types.parents:
                self.error(f"there is no type {sort}", node, nearest(sort, [*self.types.parents, NUMBER]))
            found[one.name] = sort or NUMBER
        return found

    def formula(self, node: Expression, bound: Bound, *, temporal: bool = False, monitor: bool = False) -> None:
        """A formula with all its variables bound; temporal operators only if they may stand there."""
        self._is_monitor = monitor
        self._look_at_temporal(node, temporal, monitor)
        self._truth(node, bound)
        self._is_monitor = False

    def _look_at_temporal(self, node: Expression, temporal: bool, monitor: bool) -> None:
        has_next = any(isinstance(one, Next) for one in tree.walk(node))
        waiting = [(node, False)]
        while waiting:
            one, is_inside = waiting.pop()
            if isinstance(one, _TEMPORAL) and not temporal:
                self.error("a temporal operator cannot stand here", one, "put it into a #control or #monitor")
                return
            if isinstance(one, Next) and (monitor or is_inside):
                self.error("next cannot stand here", one, "eventually [0, 1s] A" if monitor else "next A, once")
                return
            if has_next and isinstance(one, tree.TEMPORAL) and not is_inside and (one.lo_us or one.hi_us is not None):
                self.error(
                    "next stands next to an interval", one, "put the operator inside: next eventually [0, 30s] A"
                )
                return
            waiting += [(child, is_inside or isinstance(one, Next)) for child in tree.children(one)]
        depth, place = tree.deepest_temporal(node)
        if depth > tree.LIMIT_TEMPORAL:
            self._errors.error(tree.too_deep(depth), place, "say it with fewer of them")

    def free(self, node: Expression) -> tuple[model.Parameter, ...]:
        return free_variables(node, self.declared)

    def number(self, node: Expression, bound: Bound) -> None:
        """A term over numbers."""
        sort = self.sort(node, bound)
        if sort not in {NUMBER, None}:
            self.error(f"a number is wanted, this is {_named(sort)}", node)

    def _truth(self, node: Expression, bound: Bound) -> None:
        sort = self.sort(node, bound)
        if sort not in {BOOLEAN, None}:
            self.error(f"a truth value is wanted, this is {_named(sort)}", node, "compare it: ... == ...")

    def sort(self, node: Expression, bound: Bound) -> str | None:
        """The sort of an expression; errors inside are collected."""
        match node:
            case tree.Const(value):
                return BOOLEAN if isinstance(value, bool) else NUMBER
            case tree.Duration():
                return NUMBER
            case tree.Negate(operand):
                self.number(operand, bound)
                return NUMBER
            case tree.Arithmetic(_, left, right):
                self.number(left, bound)
                self.number(right, bound)
                return NUMBER
            case tree.Compare():
                self._compare(node, bound)
            case tree.And(parts) | tree.Or(parts):
                for part in parts:
                    self._truth(part, bound)
            case tree.Implies(left, right) | tree.Until(left, right):
                self._truth(left, bound)
                self._truth(right, bound)
            case tree.Not(operand) | tree.Always(operand) | tree.Eventually(operand) | Next(operand) | InGoal(operand):
                self._truth(operand, bound)
            case Quantified():
                self._quantified(node, bound)
            case Application():
                return self._call(node, bound)
        return BOOLEAN

    def _quantified(self, node: Quantified, bound: Bound) -> None:
        inside = self.bound(node.variables, node)
        for name, sort in inside.items():
            if sort == NUMBER:
                self.equated(name, _premise(node), node)
        self._truth(node.body, {**bound, **inside})

    def equated(self, name: str, formula: Expression, node: tree.Node) -> None:
        """A variable over numbers must be equated with something: numbers are not enumerated."""
        if model.definition(formula, name, self.derived) is None:
            self.error(
                f"nothing binds {name}: it is no type's variable, and no condition equates it with a value",
                node,
                f"xpos(box) == {name}, or a name that begins with a type: {', '.join(list(self.types.parents)[:4])}",
            )

    def _compare(self, node: tree.Compare, bound: Bound) -> None:
        left, right = self.sort(node.left, bound), self.sort(node.right, bound)
        if left is None or right is None:
            return
        if node.operator not in {"=", "!="} and (left != NUMBER or right != NUMBER):
            self.error(f"{_named(right if left == NUMBER else left)} has no order", node, "compare with == or !=")
        elif not self._meet(left, right):
            self.error(f"{_named(left)} meets {_named(right)}", node)

    def _meet(self, one: str, other: str) -> bool:
        return one == other or one in self.types.above(other) or other in self.types.above(one)

    def _call(self, node: Application, bound: Bound) -> str | None:
        name = node.name
        if not node.args and name in bound:
            return bound[name]
        if not node.args and name in self.constants:
            return self._sort_of_constant(name)
        if name in self.features:
            feature = self.features[name]
            self._arguments(node, feature.sorts, bound)
            return NUMBER if feature.sort in model.NUMBERS else feature.sort
        if name in self.derived:
            one = self.derived[name]
            self._arguments(node, tuple(self.types.of_variable(each) or NUMBER for each in one.parameters), bound)
            return self._sort_of_derived(one)
        if name in model.FUNCTIONS and node.args:
            self._arguments(node, (NUMBER,) * model.FUNCTIONS[name], bound)
            return NUMBER
        if name.startswith(EXECUTING) or (name == "EXEC" and not node.args):
            return self._flag(node, bound)
        if not node.args and name in self.types.sort_of:
            return self.types.sort_of[name]
        self._unknown(node, bound)
        return None

    def _flag(self, node: Application, bound: Bound) -> str | None:
        if not self._is_monitor:
            self.error(f"{node.name} is known while a plan is executed, not in a plan", node, "put it into a :monitor")
        elif node.name != "EXEC" and node.name not in self.executing:
            self.error(
                f"there is no operator {node.name.removeprefix(EXECUTING)}", node, nearest(node.name, self.executing)
            )
        elif len(node.args) > self.executing.get(node.name, 0):
            self.error(f"{node.name} takes {self.executing.get(node.name, 0)} arguments at most", node)
        for arg in node.args:
            self.sort(arg, bound)
        return BOOLEAN

    def _unknown(self, node: Application, bound: Bound) -> None:
        known = [
            *self.features,
            *self.derived,
            *self.constants,
            *bound,
            *model.FUNCTIONS,
            *list(self.types.sort_of)[:200],
        ]
        repair = nearest(node.name, known)
        if node.args:
            self.error(f"there is no feature {node.name}", node, repair or f"#feature {node.name}(...) : boolean")
        elif model.type_in(node.name, self.types.parents):
            self.error(
                f"{node.name} is free: neither a parameter nor a quantifier binds it", node, f"forall {node.name}: ..."
            )
        else:
            self.error(f"{node.name} is no variable, constant, object or feature", node, repair)

    def _sort_of_constant(self, name: str) -> str:
        for one in self.declared.constants:
            if one.name == name and isinstance(one.value, Application) and one.value.name in self.types.sort_of:
                return self.types.sort_of[one.value.name]
        return NUMBER

    def _sort_of_derived(self, one: model.Derived) -> str | None:
        """The sort of its body; errors in the body are reported at its definition."""
        if one.name not in self._derived_sorts:
            self._derived_sorts[one.name] = None
            quiet = SortChecker(self.declared, ErrorCollector(""))
            quiet._derived_sorts = self._derived_sorts
            self._derived_sorts[one.name] = quiet.sort(one.body, quiet.bound(one.parameters, one))
        return self._derived_sorts[one.name]

    def _arguments(self, node: Application, sorts: tuple[str, ...], bound: Bound) -> None:
        if len(sorts) != len(node.args):
            inside = ", ".join(sorts)
            said = f"{node.name} takes {len(sorts)} argument{'' if len(sorts) == 1 else 's'}, here are {len(node.args)}"
            self.error(said, node, f"{node.name}({inside})" if inside else node.name)
        for arg, wanted in zip(node.args, sorts, strict=False):
            sort = self.sort(arg, bound)
            if wanted not in self.types.parents and wanted not in model.NUMBERS:
                continue  # that there is no such type is said where it is declared
            if sort is not None and not self._meet(sort, NUMBER if wanted in model.NUMBERS else wanted):
                self.error(f"{node.name} is of a {wanted}, this is {_named(sort)}", arg)


def _premise(node: Quantified) -> Expression:
    """Where equations of a quantifier's variables stand."""
    is_implication = node.kind == "forall" and isinstance(node.body, tree.Implies)
    return node.body.left if is_implication else node.body


def _named(sort: str | None) -> str:
    return {BOOLEAN: "a truth value", NUMBER: "a number"}.get(str(sort), f"a {sort}")


def free_variables(formula: Expression, declared: Declarations) -> tuple[model.Parameter, ...]:
    """Names that nothing binds and that are variables by their form: they begin with a type, or are x, y, z."""
    types = {one.name for one in declared.types}
    known = {one.name for one in declared.constants} | set(model.CONSTANTS)
    known |= {one.name for one in declared.features} | {one.name for one in declared.derived}
    known |= {name for one in declared.objects for name in one.names}
    known |= {value for one in declared.types for value in one.values}
    free: dict[str, None] = {}
    waiting: list[tuple[Expression, frozenset[str]]] = [(formula, frozenset())]
    while waiting:
        node, bound = waiting.pop()
        if isinstance(node, Application) and not node.args and node.name not in bound and node.name not in known:
            if model.type_in(node.name, types) or _NUMBER_NAME.fullmatch(node.name):
                free[node.name] = None
        elif isinstance(node, Quantified):
            waiting.append((node.body, bound | {one.name for one in node.variables}))
        else:
            waiting += [(child, bound) for child in tree.children(node)]
    return tuple(model.Parameter(name) for name in sorted(free))
