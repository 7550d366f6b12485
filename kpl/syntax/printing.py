"""Formulas to text, with the parentheses they need and no others: parsing the text gives the formula back."""

from typing import Final

from dyknow.model.instants import print_duration
from reasoning.formulas import tree

_EXPR, _OR, _AND, _UNTIL, _UNARY, _COMPARISON, _SUM, _PRODUCT, _FACTOR, _PRIMARY = range(10)
"""Levels of the grammar, from the one that binds least."""
_LEVELS: Final[dict[type, int]] = {
    tree.Implies: _EXPR,
    tree.Or: _OR,
    tree.And: _AND,
    tree.Until: _UNTIL,
    **dict.fromkeys((tree.Not, tree.Always, tree.Eventually, tree.Forall, tree.Exists), _UNARY),
    tree.Compare: _COMPARISON,
    tree.Negate: _FACTOR,
}


def print_formula(formula: tree.Formula) -> str:
    """The formula as it is typed, on one line."""
    return _show(formula, _EXPR, last=True)


def _show(formula: tree.Formula, level: int, *, last: bool) -> str:
    """Text that stands where the grammar wants `level`; `last` if nothing follows that a quantifier would swallow."""
    mine = _level(formula)
    fits = mine >= level and (last or not isinstance(formula, tree.Forall | tree.Exists))
    return _text(formula, last=last) if fits else f"({_text(formula, last=True)})"


def _level(formula: tree.Formula) -> int:
    match formula:
        case tree.Arithmetic(operator, _, _):
            return _SUM if operator in "+-" else _PRODUCT
        case tree.Const(value) if not isinstance(value, bool | str) and value < 0:
            return _FACTOR
    return _LEVELS.get(type(formula), _PRIMARY)


def _text(formula: tree.Formula, *, last: bool) -> str:
    match formula:
        case tree.Implies(left, right):
            return f"{_left(left, _OR)} -> {_show(right, _EXPR, last=last)}"
        case tree.Or(parts):
            return _joined(parts, "or", _AND, last=last)
        case tree.And(parts):
            return _joined(parts, "and", _UNTIL, last=last)
        case tree.Until(left, right, lo_us, hi_us):
            return f"{_left(left, _UNARY)} until{_interval(lo_us, hi_us)} {_show(right, _UNTIL, last=last)}"
        case tree.Not(operand):
            return f"not {_show(operand, _UNARY, last=last)}"
        case tree.Always(operand, lo_us, hi_us):
            return f"always{_interval(lo_us, hi_us)} {_show(operand, _UNARY, last=last)}"
        case tree.Eventually(operand, lo_us, hi_us):
            return f"eventually{_interval(lo_us, hi_us)} {_show(operand, _UNARY, last=last)}"
        case tree.Forall(variable, domain, body, growing) | tree.Exists(variable, domain, body, growing):
            word = "forall" if isinstance(formula, tree.Forall) else "exists"
            grows = " growing" if growing else ""
            return f"{word} {variable} in {_domain(domain)}{grows}: {_show(body, _EXPR, last=last)}"
    return _value(formula)


def _left(formula: tree.Formula, level: int) -> str:
    """A left operand; always and eventually never stand there without parentheses."""
    if isinstance(formula, tree.Always | tree.Eventually):
        return f"({_text(formula, last=True)})"
    return _show(formula, level, last=False)


def _joined(parts: tuple[tree.Formula, ...], word: str, level: int, *, last: bool) -> str:
    texts = [_left(part, level) for part in parts[:-1]]
    texts.append(_show(parts[-1], level, last=last))
    return f" {word} ".join(texts)


def _value(formula: tree.Formula) -> str:
    match formula:
        case tree.Compare(operator, left, right):
            return f"{_show(left, _SUM, last=False)} {operator} {_show(right, _SUM, last=False)}"
        case tree.Arithmetic(operator, left, right):
            level = _level(formula)
            return f"{_show(left, level, last=False)} {operator} {_show(right, level + 1, last=False)}"
        case tree.Negate(operand):
            return f"-{_show(operand, _FACTOR, last=False)}"
        case tree.Abs(operand):
            return f"abs({_show(operand, _EXPR, last=True)})"
        case tree.Const(value, quoted):
            return _constant(value, quoted=quoted)
        case tree.Duration(us):
            return print_duration(us)
        case tree.Variable(name):
            return name
        case tree.Now():
            return "now"
        case tree.Since(feature):
            return f"since({feature.label})"
        case tree.Occurred(event):
            return f"occurred({event.label})"
        case tree.Feature():
            return formula.label
    raise TypeError(f"{type(formula).__name__} is no formula")


def _constant(value: bool | float | str, *, quoted: bool) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"' if quoted else value
    return repr(value)


def _objects(objects: tuple[tree.Object, ...]) -> str:
    return ", ".join(one if isinstance(one, str) else one.name for one in objects)


def _domain(domain: tree.Domain) -> str:
    return " - ".join(_set(one) for one in (domain.base, *domain.minus))


def _set(found: tree.DomainSet) -> str:
    return found if isinstance(found, str) else f"{{{_objects(found)}}}"


def _interval(lo_us: tree.Bound, hi_us: tree.Bound | None) -> str:
    if lo_us == 0 and hi_us is None:
        return ""
    return f"[{_bound(lo_us)}, {'oo' if hi_us is None else _bound(hi_us)}]"


def _bound(bound: tree.Bound) -> str:
    if not isinstance(bound, int):
        return _show(bound, _SUM, last=False)
    return print_duration(bound) if bound else "0"
