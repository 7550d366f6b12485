"""Problems of unified-planning and PDDL as our declarations.

Names that have a meaning here get an underscore. One time unit of theirs is a second. A condition at the end of an action
becomes one that prevails, which is stricter.
"""

import re
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from typing import Any, Final

from dyknow.kpl.diagnostics.languages import language
from dyknow.model.errors import TextError, WrongCall
from dyknow.planning.domains import model
from dyknow.planning.domains.model import Application, Declarations, Effect, Expression, OperatorCondition, Parameter
from dyknow.planning.domains.printing import print_declarations
from dyknow.planning.domains.texts import parse_domain, parse_problem
from dyknow.planning.symbolic.unified import unified
from dyknow.reasoning.formulas import tree

_MS: Final = 1000
_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(-[A-Za-z0-9_]+)*")
_BUILT_IN: Final = {model.BOOLEAN, *model.NUMBERS, *model.FUNCTIONS, *model.CONSTANTS, "EXEC"}


def read_pddl(domain: str, problem: str) -> tuple[Declarations, Declarations]:
    """Our domain and problem from the texts of PDDL files.

    Raises:
        WrongCall: unified-planning is not installed, or does not read them.
        TextError: something in them has no form here.
    """
    unified()
    from unified_planning.io import PDDLReader

    try:
        read = PDDLReader().parse_problem_string(domain, problem)
    except Exception as error:  # noqa: BLE001 - of whatever kind: pyparsing's, assertions, keys
        shown = " ".join(str(error).split()) or type(error).__name__
        raise WrongCall(f"the PDDL text is not read: {shown[:300]}") from None
    return from_unified(read)


def from_unified(problem: Any) -> tuple[Declarations, Declarations]:
    """Our domain and problem from a `unified_planning.model.Problem`; raises TextError for parts without a form."""
    unified()
    reader = _Importer(problem)
    domain = parse_domain(print_declarations(reader.domain()))
    return domain, parse_problem(print_declarations(reader.problem()), domain)


class _Importer:
    def __init__(self, problem: Any) -> None:
        self._problem = problem
        self._names: dict[tuple[str, str], str] = {}
        self._taken: dict[str, str] = {}
        self._met: set[str] = set()
        self._of_domain: set[str] = set()

    def _name(self, kind: str, name: str) -> str:
        """A name of ours: types, operators and the rest do not share theirs with one another, as they do not here."""
        found = self._names.get((kind, name))
        if found is None:
            found = re.sub(r"-+", "-", re.sub(r"[^A-Za-z0-9_-]", "_", name)).strip("-")
            if not _NAME.fullmatch(found):
                found = f"x{found}"
            reserved = {*language("domains").reserved, *_BUILT_IN}
            space = "type" if kind == "type" else "operator" if kind == "operator" else "name"
            while found in reserved or self._taken.get(f"{space} {found}", name) != name or self._is_other(kind, found):
                found += "_"
            self._taken[f"{space} {found}"] = name
            self._taken.setdefault(f"kind {found}", kind)
            self._names[kind, name] = found
        return found

    def _is_other(self, kind: str, name: str) -> bool:
        """Whether an object is called so that is to be the name of a feature, or the other way round."""
        return kind in {"feature", "object"} and self._taken.get(f"kind {name}", kind) not in {kind, "type", "operator"}

    def domain(self) -> Declarations:
        """The operators, with their types, features and objects; objects that they name are of the domain."""
        problem = self._problem
        operators = tuple(self._operator(one) for one in problem.actions)
        self._of_domain = set(self._met)
        return Declarations(
            types=tuple(
                model.TypeDeclaration(self._sort(one), None if one.father is None else self._sort(one.father))
                for one in problem.user_types
            ),
            features=tuple(self._feature(one) for one in problem.fluents),
            operators=operators,
            objects=self._objects(in_domain=True),
        )

    def _objects(self, *, in_domain: bool) -> tuple[model.Objects, ...]:
        found: dict[str, list[str]] = {}
        for one in self._problem.all_objects:
            if (one.name in self._of_domain) is in_domain:
                found.setdefault(self._sort(one.type), []).append(self._name("object", one.name))
        return tuple(model.Objects(sort, tuple(names)) for sort, names in found.items())

    def problem(self) -> Declarations:
        problem = self._problem
        init = []
        for fluent, value in problem.explicit_initial_values.items():
            target, given = self._expression(fluent), self._expression(value)
            if not value.is_false():
                init.append(model.Observation(target, given))
        goals = tuple(model.GoalStatement("", self._expression(one)) for one in problem.goals)
        return Declarations(
            objects=self._objects(in_domain=False),
            init=(*init, *self._timed()),
            goals=goals,
        )

    def _timed(self) -> Iterator[model.Observation]:
        for timing, effects in getattr(self._problem, "timed_effects", {}).items():
            for one in effects:
                yield model.Observation(
                    self._expression(one.fluent), self._expression(one.value), round(timing.delay * _MS)
                )

    def _sort(self, one: Any) -> str:
        return (
            model.BOOLEAN
            if one.is_bool_type()
            else model.NUMBER
            if not one.is_user_type()
            else self._name("type", one.name)
        )

    def _feature(self, one: Any) -> model.FeatureDeclaration:
        default = self._problem.fluents_defaults.get(one)
        value = None if default is None or default.is_false() else self._expression(default)
        sorts = tuple(self._sort(each.type) for each in one.signature)
        return model.FeatureDeclaration(self._name("feature", one.name), sorts, self._sort(one.type), value)

    def _parameters(self, given: Any) -> tuple[Parameter, ...]:
        return tuple(Parameter(self._name("variable", one.name), self._sort(one.type)) for one in given)

    def _operator(self, one: Any) -> model.Operator:
        up = unified()
        costs = [each for each in self._problem.quality_metrics if each.is_minimize_action_costs()]
        cost = costs[0].get_action_cost(one) if costs else None
        parts: dict[str, Any] = {}
        if isinstance(one, up.DurativeAction):
            parts = self._durative(one)
        else:
            parts["preconditions"] = tuple(OperatorCondition(self._expression(each)) for each in one.preconditions)
            parts["effects"] = tuple(self._effect("end", each) for each in one.effects)
        return model.Operator(
            self._name("operator", one.name),
            self._parameters(one.parameters),
            cost=None if cost is None else self._expression(cost),
            **parts,
        )

    def _durative(self, one: Any) -> dict[str, Any]:
        shortest, longest = (self._seconds(each) for each in (one.duration.lower, one.duration.upper))
        found: dict[str, Any] = (
            {"duration": shortest}
            if shortest == longest
            else {"timeconstraint": model.TimeConstraint(shortest, longest)}
        )
        at_start, throughout = list[OperatorCondition](), list[OperatorCondition]()
        for interval, conditions in one.conditions.items():
            is_start = interval.lower == interval.upper and interval.lower.is_from_start()
            (at_start if is_start else throughout).extend(
                OperatorCondition(self._expression(each)) for each in conditions
            )
        effects = [
            self._effect("start" if timing.is_from_start() else "end", each, round(timing.delay * _MS))
            for timing, each_time in one.effects.items()
            for each in each_time
        ]
        return {**found, "preconditions": tuple(at_start), "prevail": tuple(throughout), "effects": tuple(effects)}

    def _seconds(self, node: Any) -> Expression:
        found = self._expression(node)
        if isinstance(found, tree.Const):
            return tree.Const(found.value * _MS)
        return tree.Arithmetic("*", found, tree.Const(_MS))

    def _effect(self, anchor: Any, one: Any, later_ms: int = 0) -> Effect:
        target, value = self._expression(one.fluent), self._expression(one.value)
        if one.is_increase() or one.is_decrease():
            value = tree.Arithmetic("+" if one.is_increase() else "-", target, value)
        condition = None if one.condition.is_true() else self._expression(one.condition)
        variables = self._parameters(one.forall)
        return Effect(anchor, later_ms, target, value, variables, condition)

    def _expression(self, node: Any) -> Expression:
        inside = tuple([self._expression(one) for one in node.args])
        match node.node_type.name:
            case "AND":
                return tree.And(inside)
            case "OR":
                return tree.Or(inside)
            case "NOT":
                is_equation = isinstance(inside[0], tree.Compare) and inside[0].operator == "="
                return replace(inside[0], operator="!=") if is_equation else tree.Not(inside[0])
            case "IMPLIES":
                return tree.Implies(*inside)
            case "IFF" | "EQUALS":
                return tree.Compare("=", *inside)
            case "LE" | "LT":
                return tree.Compare("<=" if node.is_le() else "<", *inside)
            case "PLUS" | "MINUS" | "TIMES" | "DIV":
                found = inside[0]
                for one in inside[1:]:
                    found = tree.Arithmetic(
                        {"PLUS": "+", "MINUS": "-", "TIMES": "*", "DIV": "/"}[node.node_type.name], found, one
                    )
                return found
            case "FORALL" | "EXISTS":
                kind: Any = "forall" if node.is_forall() else "exists"
                return model.Quantified(kind, self._parameters(node.variables()), inside[0])
            case "FLUENT_EXP":
                return Application(self._name("feature", node.fluent().name), inside)
            case "PARAM_EXP" | "VARIABLE_EXP" | "OBJECT_EXP":
                return self._named(node)
            case "BOOL_CONSTANT" | "INT_CONSTANT" | "REAL_CONSTANT":
                value = node.constant_value()
                return tree.Const(float(value) if isinstance(value, Fraction) else value)
        raise TextError(f"{node.node_type.name.lower()} of unified-planning has no form here: {node}")

    def _named(self, node: Any) -> Application:
        if node.is_object_exp():
            self._met.add(node.object().name)
            return Application(self._name("object", node.object().name))
        one = node.parameter() if node.is_parameter_exp() else node.variable()
        return Application(self._name("variable", one.name))
