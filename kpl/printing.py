"""Formulas to text, with the parentheses they need and no others: parsing the text gives the formula back."""

from typing import Final

from dyknow.instants import print_duration
from reasoning.formulas import (
    Abs,
    Always,
    And,
    Arithmetic,
    Bound,
    Compare,
    Const,
    Domain,
    DomainSet,
    Duration,
    Eventually,
    Exists,
    Feature,
    Forall,
    Formula,
    Implies,
    Negate,
    Not,
    Now,
    Object,
    Occurred,
    Or,
    Since,
    Until,
    Variable,
)

_EXPR: Final = 0
_OR: Final = 1
_AND: Final = 2
_UNTIL: Final = 3
_UNARY: Final = 4
_COMPARISON: Final = 5
_SUM: Final = 6
_PRODUCT: Final = 7
_FACTOR: Final = 8
_PRIMARY: Final = 9


def print_formula(formula: Formula) -> str:
    """The formula as it is typed, on one line."""
    return _show(formula, _EXPR, last=True)


def _show(formula: Formula, level: int, *, last: bool) -> str:
    """Text that stands where the grammar wants `level`; `last` if nothing follows that a quantifier would swallow."""
    mine = _level(formula)
    fits = mine >= level and (last or not isinstance(formula, Forall | Exists))
    return _text(formula, last=last) if fits else f"({_text(formula, last=True)})"


def _level(formula: Formula) -> int:
    match formula:
        case Implies():
            return _EXPR
        case Or():
            return _OR
        case And():
            return _AND
        case Until():
            return _UNTIL
        case Not() | Always() | Eventually() | Forall() | Exists():
            return _UNARY
        case Compare():
            return _COMPARISON
        case Arithmetic(operator, _, _):
            return _SUM if operator in "+-" else _PRODUCT
        case Negate():
            return _FACTOR
        case Const(value) if not isinstance(value, bool | str) and value < 0:
            return _FACTOR
    return _PRIMARY


def _text(formula: Formula, *, last: bool) -> str:
    match formula:
        case Implies(left, right):
            return f"{_left(left, _OR)} -> {_show(right, _EXPR, last=last)}"
        case Or(parts):
            return _joined(parts, "or", _AND, last=last)
        case And(parts):
            return _joined(parts, "and", _UNTIL, last=last)
        case Until(left, right, lo_us, hi_us):
            return f"{_left(left, _UNARY)} until{_interval(lo_us, hi_us)} {_show(right, _UNTIL, last=last)}"
        case Not(operand):
            return f"not {_show(operand, _UNARY, last=last)}"
        case Always(operand, lo_us, hi_us):
            return f"always{_interval(lo_us, hi_us)} {_show(operand, _UNARY, last=last)}"
        case Eventually(operand, lo_us, hi_us):
            return f"eventually{_interval(lo_us, hi_us)} {_show(operand, _UNARY, last=last)}"
        case Forall(variable, domain, body, growing) | Exists(variable, domain, body, growing):
            word = "forall" if isinstance(formula, Forall) else "exists"
            grows = " growing" if growing else ""
            return f"{word} {variable} in {_domain(domain)}{grows}: {_show(body, _EXPR, last=last)}"
    return _value(formula)


def _left(formula: Formula, level: int) -> str:
    """A left operand; always and eventually never stand there without parentheses."""
    if isinstance(formula, Always | Eventually):
        return f"({_text(formula, last=True)})"
    return _show(formula, level, last=False)


def _joined(parts: tuple[Formula, ...], word: str, level: int, *, last: bool) -> str:
    texts = [_left(part, level) for part in parts[:-1]]
    texts.append(_show(parts[-1], level, last=last))
    return f" {word} ".join(texts)


def _value(formula: Formula) -> str:
    match formula:
        case Compare(operator, left, right):
            return f"{_show(left, _SUM, last=False)} {operator} {_show(right, _SUM, last=False)}"
        case Arithmetic(operator, left, right):
            level = _level(formula)
            return f"{_show(left, level, last=False)} {operator} {_show(right, level + 1, last=False)}"
        case Negate(operand):
            return f"-{_show(operand, _FACTOR, last=False)}"
        case Abs(operand):
            return f"abs({_show(operand, _EXPR, last=True)})"
        case Const(value, quoted):
            return _constant(value, quoted=quoted)
        case Duration(us):
            return print_duration(us)
        case Variable(name):
            return name
        case Now():
            return "now"
        case Since(feature):
            return f"since({_feature(feature)})"
        case Occurred(event):
            return f"occurred({_feature(event)})"
        case Feature():
            return _feature(formula)
    raise TypeError(f"{type(formula).__name__} is no formula")


def _constant(value: bool | float | str, *, quoted: bool) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"' if quoted else value
    return repr(value)


def _feature(feature: Feature) -> str:
    stem = f"{feature.name}.{feature.attribute}" if feature.attribute else feature.name
    return f"{stem}[{_objects(feature.objects)}]" if feature.objects else stem


def _objects(objects: tuple[Object, ...]) -> str:
    return ", ".join(one if isinstance(one, str) else one.name for one in objects)


def _domain(domain: Domain) -> str:
    return " - ".join(_set(one) for one in (domain.base, *domain.minus))


def _set(found: DomainSet) -> str:
    return found if isinstance(found, str) else f"{{{_objects(found)}}}"


def _interval(lo_us: Bound, hi_us: Bound | None) -> str:
    if lo_us == 0 and hi_us is None:
        return ""
    return f"[{_bound(lo_us)}, {'oo' if hi_us is None else _bound(hi_us)}]"


def _bound(bound: Bound) -> str:
    if isinstance(bound, Feature):
        return bound.name
    return print_duration(bound) if bound else "0"
