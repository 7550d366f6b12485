"""Hints on monitors: conditions that a noisy sensor violates although all is well (thesis 7.9)."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from dyknow.planning.domains import model
from dyknow.planning.domains.model import Application, Declarations, Expression
from dyknow.planning.domains.printing import print_expression
from dyknow.reasoning.formulas import tree


@dataclass(frozen=True, slots=True)
class MonitorHint:
    """A possible cause of false alarms, its place in the domain's text, or the problem's for a goal, and a repair."""

    place: tree.Place
    message: str
    repair: str
    is_goal: bool = False


def monitor_hints(declared: Declarations) -> tuple[MonitorHint, ...]:
    """Hints on the monitors of a domain, on the conditions that it flags `monitored`, and on goals."""
    numbers = {one.name: one for one in declared.features if one.sort in model.NUMBERS}
    derived = {one.name: one for one in declared.derived}
    found = list(_on_formulas(declared, numbers, derived))
    for operator in declared.operators:
        for condition in (*operator.preconditions, *operator.prevail):
            if condition.monitored:
                found += _on_equations(condition.formula, f"a condition of {operator.name}", numbers, derived)
        for effect in operator.effects:
            feature = numbers.get(effect.target.name)
            if effect.monitored and feature is not None and feature.within is None:
                found.append(_equation(effect.target, f"an effect of {operator.name}", feature))
        for prevail in operator.prevail:
            if prevail.monitored and (name := _number_in(prevail.formula, numbers, derived)):
                found.append(
                    MonitorHint(
                        prevail.place,
                        f"one sample of {name} outside ends {operator.name}: it is measured, and its prevail condition"
                        " is monitored in every state",
                        f":monitor (EXEC & eventually [0, 1s] {_shown(prevail.formula)}) until !EXEC",
                    )
                )
    return tuple(dict.fromkeys((*found, *_on_goals(declared, derived))))


def _on_goals(declared: Declarations, derived: Mapping[str, model.Derived]) -> Iterator[MonitorHint]:
    """Goals that want a number which is sensed, or seen, to be exactly another one."""
    shown = {one.name for one in declared.sensed}
    shown |= {term.name for one in declared.operators for term in one.located}
    shown |= {term.name for one in declared.recoveries for term in one.located}
    numbers = {one.name for one in declared.features if one.sort in model.NUMBERS and one.name in shown}
    for goal in declared.goals:
        waiting, met = [goal.formula], set[str]()
        while waiting:
            for node in tree.walk(waiting.pop()):
                match node:
                    case tree.Compare("=", Application(name) as left, right) if name in numbers:
                        yield MonitorHint(
                            goal.place,
                            f"the goal {goal.name or 'without a name'} is that {name} has one value exactly: it is"
                            " measured, and the mission would not find it reached",
                            f"abs({print_expression(left)} - {print_expression(right)}) <= 2",
                            is_goal=True,
                        )
                    case Application(name) if name in derived and name not in met:
                        met.add(name)
                        waiting.append(derived[name].body)


def _on_formulas(
    declared: Declarations, numbers: Mapping[str, model.FeatureDeclaration], derived: Mapping[str, model.Derived]
) -> Iterator[MonitorHint]:
    monitors = [*declared.monitors, *(each for one in declared.operators for each in one.monitors)]
    for monitor in monitors:
        for node in _always_by_itself(monitor.formula):
            inner = _body(node.operand)
            if any(isinstance(one, tree.TEMPORAL) for one in tree.walk(inner)):
                continue
            name = _number_in(inner, numbers, derived)
            if name:
                shown = _shown(inner.right if isinstance(inner, tree.Implies) else inner)
                yield MonitorHint(
                    monitor.place,
                    f"one sample of {name} outside violates {monitor.name or 'this monitor'}: it is measured, and"
                    " always is about every state",
                    f"eventually [0, 1s] {shown}, or !{shown} -> eventually [0, 1s] always [0, 1s] {shown}",
                )


def _always_by_itself(formula: Expression) -> Iterator[tree.Always]:
    """Every `always` that stands in no `eventually` or `until`: those leave time to recover."""
    waiting = [formula]
    while waiting:
        node = waiting.pop()
        if isinstance(node, tree.Always):
            yield node
        if not isinstance(node, tree.Eventually | tree.Until):
            waiting += tree.children(node)


def _body(formula: Expression) -> Expression:
    return _body(formula.body) if isinstance(formula, model.Quantified) else formula


def _shown(formula: Expression) -> str:
    return f"({print_expression(formula)})"


def _number_in(
    formula: Any, numbers: Mapping[str, model.FeatureDeclaration], derived: Mapping[str, model.Derived]
) -> str:
    """The name of a measured feature in it."""
    waiting, met = [formula], set[str]()
    while waiting:
        for node in tree.walk(waiting.pop()):
            if isinstance(node, Application) and node.name in numbers:
                return node.name
            if isinstance(node, Application) and node.name in derived and node.name not in met:
                met.add(node.name)
                waiting.append(derived[node.name].body)
    return ""


def _on_equations(
    formula: Expression,
    what: str,
    numbers: Mapping[str, model.FeatureDeclaration],
    derived: Mapping[str, model.Derived],
) -> Iterator[MonitorHint]:
    """Equations of measured numbers without a tolerance, also inside derived features."""
    waiting, met = [(formula, formula.place)], set[str]()
    while waiting:
        expression, place = waiting.pop()
        for node in tree.walk(expression):
            match node:
                case tree.Compare("=" | "!=", left, right):
                    for one in (left, right):
                        feature = numbers.get(one.name) if isinstance(one, Application) else None
                        if feature is not None and feature.within is None:
                            yield _equation(tree.Node(place=place), what, feature)
                case Application(name) if name in derived and name not in met:
                    met.add(name)
                    waiting.append((derived[name].body, place))


def _equation(node: tree.Node, what: str, feature: model.FeatureDeclaration) -> MonitorHint:
    return MonitorHint(
        node.place,
        f"{what} compares {feature.name} for equality, and no measured value is equal",
        f"#feature {feature.name}({', '.join(feature.sorts)}) : {feature.sort} :within 0.5",
    )
