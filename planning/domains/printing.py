"""Domains and problems to text: reading the text gives the declarations back."""

from typing import Final

from dyknow.model.instants import print_duration
from planning.domains import model
from planning.domains.model import Application, Declarations, Expression, InGoal, Next, Quantified
from reasoning.formulas import tree

_EXPR, _OR, _AND, _UNTIL, _UNARY, _COMPARISON, _SUM, _PRODUCT, _FACTOR, _PRIMARY = range(10)
"""Levels of the grammar, from the one that binds least."""
_LEVELS: Final[dict[type, int]] = {
    tree.Implies: _EXPR,
    tree.Or: _OR,
    tree.And: _AND,
    tree.Until: _UNTIL,
    **dict.fromkeys((tree.Not, tree.Always, tree.Eventually, Next), _UNARY),
    tree.Compare: _COMPARISON,
    tree.Negate: _FACTOR,
}


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
    disturbed = "" if one.disturbed_us is None else f" :disturbed {_time(one.disturbed_us)}"
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
    condition = "" if one.condition is None else f"{_show(one.condition, _OR, last=False)} -> "
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
    least = "" if one.shortest is None else f"{_show(one.shortest, _SUM, last=False)} <= "
    most = "" if one.longest is None else f" <= {_show(one.longest, _SUM, last=False)}"
    return f"  :timeconstraint {'monitored ' if one.monitored else ''}{least}end - start{most}"


def _condition(clause: str, stamp: str, one: model.OperatorCondition) -> str:
    name = f'"{one.name}" ' if one.name else ""
    return f"  {clause} {'monitored ' if one.monitored else ''}{name}{stamp}{print_expression(one.formula)}"


def _effect(one: model.Effect) -> str:
    variables = f"forall {_variables(one.variables)}: " if one.variables else ""
    condition = "" if one.condition is None else f"[start] {_show(one.condition, _OR, last=False)} -> "
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
    return _show(expression, _EXPR, last=True)


def _show(expression: Expression, level: int, *, last: bool) -> str:
    """Text that stands where the grammar wants `level`; `last` if nothing follows that a quantifier would swallow."""
    mine = _level(expression)
    return (
        _text(expression, last=last)
        if mine >= level and (last or not _reaches_right(expression))
        else (f"({_text(expression, last=True)})")
    )


def _level(expression: Expression) -> int:
    match expression:
        case Quantified():
            return _UNARY
        case tree.Arithmetic(operator, _, _):
            return _SUM if operator in "+-" else _PRODUCT
        case tree.Const(value) if not isinstance(value, bool | str) and value < 0:
            return _FACTOR
    return _LEVELS.get(type(expression), _PRIMARY)


def _reaches_right(expression: Expression) -> bool:
    """Whether it ends with a quantifier, which swallows what follows."""
    match expression:
        case Quantified():
            return True
        case tree.Not(operand) | tree.Always(operand) | tree.Eventually(operand) | Next(operand):
            return _reaches_right(operand)
    return False


def _text(expression: Expression, *, last: bool) -> str:
    match expression:
        case tree.Implies(left, right):
            return f"{_show(left, _OR, last=False)} -> {_show(right, _EXPR, last=last)}"
        case tree.Or(parts):
            return _joined(parts, "|", _AND, last=last)
        case tree.And(parts):
            return _joined(parts, "&", _UNTIL, last=last)
        case tree.Until(left, right, lo_us, hi_us):
            return f"{_show(left, _UNARY, last=False)} until{_interval(lo_us, hi_us)} {_show(right, _UNTIL, last=last)}"
        case tree.Not(operand):
            return f"!{_show(operand, _UNARY, last=last)}"
        case tree.Always(operand, lo_us, hi_us):
            return f"always{_interval(lo_us, hi_us)} {_show(operand, _UNARY, last=last)}"
        case tree.Eventually(operand, lo_us, hi_us):
            return f"eventually{_interval(lo_us, hi_us)} {_show(operand, _UNARY, last=last)}"
        case Next(operand):
            return f"next {_show(operand, _UNARY, last=last)}"
        case Quantified(kind, variables, body):
            return f"{kind} {_variables(variables)}: {_show(body, _EXPR, last=last)}"
    return _value(expression)


def _variables(variables: tuple[model.Parameter, ...]) -> str:
    return ", ".join(f"{one.name} in {one.sort}" if one.sort else one.name for one in variables)


def _joined(parts: tuple[Expression, ...], word: str, level: int, *, last: bool) -> str:
    texts = [_show(part, level, last=False) for part in parts[:-1]]
    return f" {word} ".join([*texts, _show(parts[-1], level, last=last)])


def _value(expression: Expression) -> str:
    match expression:
        case tree.Compare(operator, left, right):
            sign = "==" if operator == "=" else operator
            return f"{_show(left, _SUM, last=False)} {sign} {_show(right, _SUM, last=False)}"
        case tree.Arithmetic(operator, left, right):
            level = _level(expression)
            return f"{_show(left, level, last=False)} {operator} {_show(right, level + 1, last=False)}"
        case tree.Negate(operand):
            return f"-{_show(operand, _PRIMARY, last=False)}"
        case tree.Const(value):
            return ("true" if value else "false") if isinstance(value, bool) else repr(value)
        case tree.Duration(us):
            return print_duration(us)
        case InGoal(operand):
            return f"goal({print_expression(operand)})"
        case Application(name, args):
            return f"{name}({', '.join(map(print_expression, args))})" if args else name
    raise TypeError(f"{type(expression).__name__} is no expression of a domain")


def _interval(lo_us: tree.Bound, hi_us: tree.Bound | None) -> str:
    if lo_us == 0 and hi_us is None:
        return ""
    return f"[{_time(lo_us)}, {'oo' if hi_us is None else _time(hi_us)}]"


def _time(us: tree.Bound) -> str:
    assert isinstance(us, int)  # noqa: S101 - reading makes microseconds of bounds
    return print_duration(us) if us else "0"
