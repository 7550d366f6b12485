"""Domains and problems to text: reading the text gives the declarations back."""

from typing import ClassVar, Final

from dyknow.kpl.syntax.printing import OR, SUM, UNARY, ExpressionPrinter
from dyknow.planning.domains import model
from dyknow.planning.domains.model import Application, Declarations, Expression, InGoal, Next, Quantified
from dyknow.reasoning.formulas import tree


def print_declarations(found: Declarations) -> str:
    """All statements, by kind, each as it is typed."""
    lines = [_type(one) for one in found.types]
    if found.units:
        lines.append(f"#units {', '.join(found.units)}")
    lines += [f"#constant {one.name} = {print_expression(one.value)}" for one in found.constants]
    lines += [_feature(one) for one in found.features]
    lines += [f"#sensed {one.name}: {one.sensor}" for one in found.sensed]
    lines += [f"#define {one.name}{_params(one.parameters)} := {print_expression(one.body)}" for one in found.derived]
    lines += [_operator(one) for one in found.operators]
    lines += [f"#control {_label(one.name)} {print_expression(one.formula)}" for one in found.controls]
    lines += [f"#monitor {_label(one.name)} {_monitor(one)}" for one in found.monitors]
    lines += [_recovery(one) for one in found.recoveries]
    lines += [f"#objects {one.sort} = {{{', '.join(one.names)}}}" for one in found.objects]
    lines += [
        f"#init {_stamp('', one.at_ms) if one.at_ms else ''}{_change(one.target, one.value)}" for one in found.init
    ]
    lines += [_goal(one) for one in found.goals]
    return "".join(f"{line}\n" for line in lines)


def _type(one: model.TypeDeclaration) -> str:
    parent = f" : {one.parent}" if one.parent else ""
    return f"#domain {one.name}{parent}" + (f" = {{{', '.join(one.values)}}}" if one.values else "")


def _feature(one: model.FeatureDeclaration) -> str:
    sorts = f"({', '.join(one.sorts)})" if one.sorts else ""
    default = "" if one.default is None else f" = {print_expression(one.default)}"
    within = "" if one.within is None else f" :within {one.within!r}"
    disturbed = "" if one.disturbed_us is None else f" :disturbed {_PRINTER.bound(one.disturbed_us)}"
    return f"#feature {one.name}{sorts} : {one.sort}{default}{within}{disturbed}"


def _recovery(one: model.RecoveryOperator) -> str:
    lines = [f"#recovery {one.name}{_params(one.parameters)}", f"  :act {one.act}"]
    lines += [] if one.when is None else [f"  :when {print_expression(one.when)}"]
    lines += [f"  :assume {', '.join(map(_assumption, each))}" for each in one.assumptions]
    lines += [f"  :locate {', '.join(map(print_expression, one.located))}"] if one.located else []
    lines += [f"  :without {', '.join(map(print_expression, one.without))}"] if one.without else []
    return "\n".join([*lines, f"  :times {one.times} {one.then}"])


def _assumption(one: model.Effect) -> str:
    variables = f"forall {_variables(one.variables)}: " if one.variables else ""
    condition = "" if one.condition is None else f"{_PRINTER.show(one.condition, OR, last=False)} -> "
    return f"{variables}{condition}{_change(one.target, one.value)}"


def _goal(one: model.GoalStatement) -> str:
    name = f"{one.name}: " if one.name else ""
    deadline = "" if one.deadline_ms is None else f" :deadline {one.deadline_ms}"
    weight = "" if one.weight is None else f" :weight {one.weight!r}"
    return f"#goal {name}{print_expression(one.formula)}{deadline}{weight}"


def _label(name: str) -> str:
    return f"{name}:" if name.replace("-", "").replace("_", "").isalnum() and name[0].isalpha() else f':name "{name}"'


def _params(parameters: tuple[model.Parameter, ...], *, always: bool = False) -> str:
    inside = ", ".join(f"{one.name} : {one.sort}" if one.sort else one.name for one in parameters)
    return f"({inside})" if inside or always else ""


def _monitor(one: model.MonitorFormula) -> str:
    return print_expression(one.formula) + (f" :recovery {one.recovery}" if one.recovery else "")


def _operator(one: model.Operator) -> str:
    lines = [f"#operator {one.name}{_params(one.parameters, always=True)}", "  :at start, end"]
    if one.cost is not None:
        lines.append(f"  :cost {print_expression(one.cost)}")
    if one.duration is not None:
        lines.append(f"  :duration {print_expression(one.duration)}")
    if one.timeconstraint is not None:
        lines.append(_timing(one.timeconstraint))
    lines += [_condition(":precond", "[start] ", each) for each in one.preconditions]
    lines += [_condition(":prevail", "[start, end] ", each) for each in one.prevail]
    lines += [f"  :effects {'monitored ' if each.monitored else ''}{_effect(each)}" for each in one.effects]
    lines += [_condition(":control", "[start] ", each) for each in one.controls]
    lines += [f"  :recovery {one.recovery}"] if one.recovery else []
    lines += [f"  :monitor {_monitor(each)}" for each in one.monitors]
    lines += [f"  :commands {', '.join(map(print_expression, one.commands))}" for _ in one.commands[:1]]
    lines += [f"  :locate {', '.join(map(print_expression, one.located))}" for _ in one.located[:1]]
    return "\n".join(lines)


def _timing(one: model.TimeConstraint) -> str:
    least = "" if one.shortest is None else f"{_PRINTER.show(one.shortest, SUM, last=False)} <= "
    most = "" if one.longest is None else f" <= {_PRINTER.show(one.longest, SUM, last=False)}"
    return f"  :timeconstraint {'monitored ' if one.monitored else ''}{least}end - start{most}"


def _condition(clause: str, stamp: str, one: model.OperatorCondition) -> str:
    name = f'"{one.name}" ' if one.name else ""
    return f"  {clause} {'monitored ' if one.monitored else ''}{name}{stamp}{print_expression(one.formula)}"


def _effect(one: model.Effect) -> str:
    variables = f"forall {_variables(one.variables)}: " if one.variables else ""
    condition = "" if one.condition is None else f"[start] {_PRINTER.show(one.condition, OR, last=False)} -> "
    return f"{variables}{condition}{_stamp(one.anchor, one.offset_ms)}{_change(one.target, one.value)}"


def _stamp(name: str, later_ms: int) -> str:
    if not name:
        return f"[{later_ms}] "
    later = f" {'+' if later_ms > 0 else '-'} {abs(later_ms)}" if later_ms else ""
    return f"[{name}{later}] "


def _change(target: Application, value: Expression) -> str:
    return f"{print_expression(target)} := {print_expression(value)}"


def print_expression(expression: Expression) -> str:
    """An expression on one line, with the parentheses it needs."""
    return _PRINTER.show(expression)


def _variables(variables: tuple[model.Parameter, ...]) -> str:
    return ", ".join(f"{one.name} in {one.sort}" if one.sort else one.name for one in variables)


class _DomainPrinter(ExpressionPrinter):
    words: ClassVar = {tree.Or: "|", tree.And: "&", tree.Not: "!"}
    equal: ClassVar = "=="
    levels: ClassVar = {**ExpressionPrinter.levels, Next: UNARY, Quantified: UNARY}
    quantifiers: ClassVar = (Quantified,)

    def own(self, node: Expression, *, last: bool) -> str:
        match node:
            case Next(operand):
                return f"next {self.show(operand, UNARY, last=last)}"
            case Quantified(kind, variables, body):
                return f"{kind} {_variables(variables)}: {self.show(body, last=last)}"
            case InGoal(operand):
                return f"goal({self.show(operand)})"
            case Application(name, args):
                return f"{name}({', '.join(map(self.show, args))})" if args else name
        raise TypeError(f"{type(node).__name__} is no expression of a domain")


_PRINTER: Final = _DomainPrinter()
