"""Domains and problems to unified-planning and PDDL, as far as they are symbolic.

An action is one step: its effects of the start and of the end come at once, and of two about one feature the later one
counts. Its conditions hold at its start. Plans of several units at once are replayed in the order of their starts, which
is the same: no action starts while another one is about to change what it reads or writes.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Any, Final

from dyknow.model.errors import TextError
from dyknow.planning.domains import model
from dyknow.planning.domains.model import Application, Declarations, Expression, Quantified
from dyknow.planning.search.plans import MissionPlan
from dyknow.planning.symbolic.simplifying import Simplifier
from dyknow.planning.symbolic.unified import unified
from dyknow.reasoning.formulas import tree

Scope = Mapping[str, Any]
"""Variables as unified-planning has them."""
_NOT_NAMES: Final = str.maketrans({"'": "_"})


@dataclass(frozen=True, slots=True)
class SymbolicProblem:
    """A problem of unified-planning (`unified_planning.model.Problem`), and what of ours it does not say."""

    problem: Any
    left_out: tuple[str, ...]

    def write_pddl(self, folder: Path) -> tuple[Path, Path]:
        """Write `domain.pddl` and `problem.pddl`, features whose values are objects as predicates; give their paths."""
        up = unified()
        from unified_planning.io import PDDLWriter

        problem = self.problem
        if problem.kind.has_object_fluents():
            kinds = up.CompilationKind.USERTYPE_FLUENTS_REMOVING
            with up.Compiler(problem_kind=problem.kind, compilation_kind=kinds) as compiler:
                problem = compiler.compile(problem).problem
        folder.mkdir(parents=True, exist_ok=True)
        writer = PDDLWriter(problem)
        files = folder / "domain.pddl", folder / "problem.pddl"
        writer.write_domain(str(files[0]))
        writer.write_problem(str(files[1]))
        return files

    def refusal(self, plan: MissionPlan) -> str:
        """Why unified-planning's validator does not take a plan; "" if it does."""
        up = unified()
        from unified_planning.plans import ActionInstance, SequentialPlan

        steps = [
            ActionInstance(
                self.problem.action(one.operator.name),
                [
                    self.problem.environment.expression_manager.ObjectExp(self.problem.object(name))
                    for name in one.objects
                ],
            )
            for one in plan.actions
        ]
        with up.PlanValidator(name="sequential_plan_validator") as validator:
            found = validator.validate(self.problem, SequentialPlan(steps, self.problem.environment))
        return "" if found.status.name == "VALID" else str(found.reason or found.status.name)


def to_unified(domain: Declarations, problem: Declarations) -> SymbolicProblem:
    """The symbolic part of a problem.

    Raises:
        TextError: a condition has no form without coordinates, or a feature that is used has no value.
        WrongCall: unified-planning is not installed.
    """
    declared = domain.joined(problem)
    made = _Exporter(declared)
    return SymbolicProblem(made.problem, (*_left_out(declared), *made.left_out))


def _left_out(declared: Declarations) -> list[str]:
    operators = declared.operators
    found = {
        "durations": any(one.duration is not None or one.timeconstraint is not None for one in operators),
        "control formulas": bool(declared.controls) or any(one.controls for one in operators),
        "monitors": bool(declared.monitors) or any(one.monitors for one in operators),
        "deadlines": any(one.deadline_ms is not None for one in declared.goals),
        "weights": any(one.weight is not None for one in declared.goals),
        "what happens at a time": any(one.at_ms > 0 for one in declared.init),
    }
    return [name for name, is_there in found.items() if is_there]


class _Exporter:
    def __init__(self, declared: Declarations) -> None:
        self._up = unified()
        self.left_out: dict[str, None] = {}
        self._simple = Simplifier(declared)
        self._types = self._simple.task.types
        self._features = dict(self._simple.task.features)
        self._fluents: dict[str, Any] = {}
        self.problem = self._up.Problem("ours")
        self._sorts: dict[str, Any] = {}
        for one in declared.types:
            self._sort(one.name)
        self._objects = {
            name: self.problem.add_object(name, self._sort(sort)) for name, sort in self._types.sort_of.items()
        }
        costs = {self._action(one): one for one in declared.operators}
        for goal in declared.goals:
            free = {
                one.name: str(one.sort or self._types.of_variable(one)) for one in self._simple.sorts.free(goal.formula)
            }
            formula = Quantified("forall", tuple(map(model.Parameter, free)), goal.formula) if free else goal.formula
            self.problem.add_goal(self._condition(self._simple.simplified(formula, {}), {}))
        self._initially()
        if any(one.cost is not None for one in declared.operators):
            given = {action.name: self._cost(action, one) for action, one in costs.items()}
            self.problem.add_quality_metric(
                self._up.MinimizeActionCosts({self.problem.action(name): cost for name, cost in given.items()})
            )
            self._initially()

    def _sort(self, name: str) -> Any:
        if name not in self._sorts:
            parent = self._types.parents.get(name)
            taken = name in self._features or name in self._types.sort_of or name == "object"
            above = None if parent is None else self._sort(parent)
            self._sorts[name] = self._up.UserType(f"{name}-type" if taken else name, above)
        return self._sorts[name]

    def _fluent(self, name: str) -> Any:
        """A feature, declared when it is first used."""
        if name not in self._fluents:
            if name in self._simple.calculated:
                self._features[name] = self._simple.calculated[name][0]
            one = self._features[name]
            kind = (
                self._up.BoolType()
                if one.sort == model.BOOLEAN
                else self._up.RealType()
                if one.sort in model.NUMBERS
                else self._sort(one.sort)
            )
            given = {f"a{at}": self._sort(sort) for at, sort in enumerate(one.sorts)}
            self._fluents[name] = self._up.Fluent(name, kind, **given)
            self.problem.add_fluent(self._fluents[name])
        return self._fluents[name]

    def _initially(self) -> None:
        """Every value of every feature that is used."""
        task = self._simple.task
        for name, fluent in self._fluents.items():
            feature = self._features[name]
            known = self._simple.calculated.get(name)
            for objects in product(*(self._types.members[sort] for sort in feature.sorts)):
                label = tree.label_text(name, objects)
                value = task.value_of(feature, label) if known is None else known[1][objects]
                if value is None and feature.sort in model.NUMBERS:
                    self.left_out[f"that {name} has not always a value"] = None
                    value = 0
                if value is None:
                    raise TextError(
                        f"{label} has no initial value, which others than us need", repair=f"#init {name}(...) := ..."
                    )
                given = [self._objects[one] for one in objects]
                self.problem.set_initial_value(fluent(*given), self._constant(value))

    def _constant(self, value: Any) -> Any:
        if isinstance(value, bool):
            return self._up.Bool(value)
        if isinstance(value, str):
            return self._up.ObjectExp(self._objects[value])
        return self._up.Int(value) if isinstance(value, int) else self._up.Real(Fraction(f"{value:.6f}"))

    def _action(self, one: model.Operator) -> Any:
        simple = self._simple
        sorts = [(each.name, self._types.of_variable(each)) for each in one.parameters]
        bound = {name: sort for name, sort in sorts if sort is not None}
        whole = tree.And(tuple(each.formula for each in one.preconditions))
        terms = simple.terms([name for name, sort in sorts if sort is None], whole)
        action = self._up.InstantaneousAction(
            one.name, **{name.translate(_NOT_NAMES): self._sort(sort) for name, sort in bound.items()}
        )
        scope = {name: action.parameter(name.translate(_NOT_NAMES)) for name in bound}

        def put(expression: Expression, inside: Mapping[str, str] = bound) -> Expression:
            return simple.simplified(model.substitute(expression, terms), dict(inside))

        for condition in (*one.preconditions, *one.prevail):
            found = self._condition(put(condition.formula), scope)
            if not found.is_true():
                action.add_precondition(found)
        self._effects(one, action, bound, scope, put)
        self.problem.add_action(action)
        return action

    def _effects(
        self,
        one: model.Operator,
        action: Any,
        bound: Mapping[str, str],
        scope: Scope,
        put: Callable[..., Expression],
    ) -> None:
        up = self._up
        made: list[tuple[model.Effect, list[Any], Any, Any, Any]] = []
        ordered = sorted(enumerate(one.effects), key=lambda each: (each[1].anchor == "end", each[1].offset_ms, each[0]))
        for number, effect in ordered:
            sorts = {each.name: str(self._types.of_variable(each)) for each in effect.variables}
            variables = {
                name: up.Variable(f"{name.translate(_NOT_NAMES)}-{number}", self._sort(sort))
                for name, sort in sorts.items()
            }
            whole = {**scope, **variables}
            inside = {**bound, **sorts}
            target = self._value(put(effect.target, inside), whole)
            condition = up.TRUE() if effect.condition is None else self._condition(put(effect.condition, inside), whole)
            is_truth = self._features[effect.target.name].sort == model.BOOLEAN
            value = (self._condition if is_truth else self._value)(put(effect.value, inside), whole)
            made.append((effect, list(variables.values()), target, value, condition))
        for at, (effect, own, target, value, condition) in enumerate(made):
            holds = condition
            for later, names, other, _, when in made[at + 1 :]:
                if other.fluent() != target.fluent() or (later.anchor, later.offset_ms) == (
                    effect.anchor,
                    effect.offset_ms,
                ):
                    continue
                same = [up.Equals(a, b) for a, b in zip(other.args, target.args, strict=True) if a != b]
                writes = up.And([when, *same])
                holds = up.And(holds, up.Not(up.Exists(writes, *names) if names else writes))
            holds = holds.simplify()
            if not holds.is_false():
                action.add_effect(target, value, holds, forall=own)

    def _cost(self, action: Any, one: model.Operator) -> Any:
        if one.cost is None:
            return self._up.Int(1)
        sorts = [(each.name, self._types.of_variable(each)) for each in one.parameters]
        bound = {name: sort for name, sort in sorts if sort is not None}
        terms = self._simple.terms(
            [name for name, sort in sorts if sort is None], tree.And(tuple(each.formula for each in one.preconditions))
        )
        found = self._simple.simplified(model.substitute(one.cost, terms), bound)
        if any(isinstance(each, Application) and each.name == "hypot" for each in tree.walk(found)):
            self.left_out[f"the cost of {one.name}"] = None
            return self._up.Int(1)
        return self._value(found, {name: action.parameter(name.translate(_NOT_NAMES)) for name in bound})

    def _condition(self, node: Expression, scope: Scope) -> Any:
        """A truth value."""
        up = self._up
        match node:
            case tree.Not(operand):
                return up.Not(self._condition(operand, scope))
            case tree.And(parts):
                return up.And([self._condition(one, scope) for one in parts])
            case tree.Or(parts):
                return up.Or([self._condition(one, scope) for one in parts])
            case tree.Implies(left, right):
                return up.Implies(self._condition(left, scope), self._condition(right, scope))
            case Quantified(kind, variables, body):
                own = {
                    one.name: up.Variable(one.name.translate(_NOT_NAMES), self._sort(str(self._types.of_variable(one))))
                    for one in variables
                }
                inside = self._condition(body, {**scope, **own})
                return (up.Forall if kind == "forall" else up.Exists)(inside, *own.values())
            case tree.Compare():
                return self._compare(node, scope)
        return self._value(node, scope)

    def _compare(self, node: tree.Compare, scope: Scope) -> Any:
        up, sign = self._up, node.operator
        sides: list[Any] = [node.left, node.right]
        lengths = [isinstance(one, Application) and one.name == "hypot" for one in sides]
        if lengths == [False, True]:
            sides.reverse()
            sign = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}.get(sign, sign)
        left, right = (self._value(one, scope) for one in sides) if not any(lengths) else self._squares(sides, scope)
        if left.type.is_bool_type():
            found = up.Iff(left, right)
            return found if sign == "=" else up.Not(found)
        compared = {
            "=": lambda: up.Equals(left, right), "!=": lambda: up.Not(up.Equals(left, right)),
            "<": lambda: up.LT(left, right), "<=": lambda: up.LE(left, right),
            ">": lambda: up.GT(left, right), ">=": lambda: up.GE(left, right),
        }[sign]()  # fmt: skip
        if any(lengths):
            limit = self._value(sides[1], scope)
            positive = up.GE(limit, 0)
            return up.And(positive, compared) if sign in {"=", "<", "<="} else up.Or(up.Not(positive), compared)
        return compared

    def _squares(self, sides: list[Any], scope: Scope) -> tuple[Any, Any]:
        """Both sides of a comparison with a length, squared."""
        up = self._up
        x, y = (self._value(one, scope) for one in sides[0].args)
        limit = self._value(sides[1], scope)
        return up.Plus(up.Times(x, x), up.Times(y, y)), up.Times(limit, limit)

    def _value(self, node: Expression, scope: Scope) -> Any:
        """A term, or a feature that is a truth value."""
        up = self._up
        match node:
            case tree.Const(value):
                return self._constant(value)
            case tree.Duration(us):
                return self._constant(us / 1000)
            case tree.Negate(operand):
                return up.Minus(0, self._value(operand, scope))
            case tree.Arithmetic(sign, left, right):
                make = {"+": up.Plus, "-": up.Minus, "*": up.Times, "/": up.Div}[sign]
                return make(self._value(left, scope), self._value(right, scope))
            case Application(name, ()) if name in scope:
                one = scope[name]
                return up.VariableExp(one) if isinstance(one, up.Variable) else up.ParameterExp(one)
            case Application(name, ()) if name in self._objects:
                return up.ObjectExp(self._objects[name])
            case Application(name, args) if name in self._features or name in self._simple.calculated:
                return self._fluent(name)(*[self._value(one, scope) for one in args])
        if isinstance(node, Application):
            raise TextError.at(node.place, f"{node.name} of what changes has no form without coordinates")
        return self._condition(node, scope)
