"""The description of a wanted object, a formula, as allowed values of its properties."""

from collections.abc import Iterator
from math import inf
from typing import Final

from dyknow.anchoring.matching.descriptions import Allowed, AllowedInterval, AllowedValues, ObjectDescription
from dyknow.model.errors import Refused
from dyknow.reasoning.formulas import tree
from dyknow.reasoning.formulas.tree import Formula

EXAMPLE: Final = 'colour[suspect] = "red" and mark[suspect]'
_TURNED: Final = {"<": ">", "<=": ">=", ">": "<", ">=": "<=", "=": "="}


def described(formula: Formula, symbol: str) -> ObjectDescription:
    """The description of an object, from a formula over its properties.

    Raises:
        Refused: it is not a conjunction of comparisons of a property with a value.
    """
    properties: dict[str, Allowed] = {}
    for part in _parts(formula):
        name, allowed = _property(part, symbol)
        properties[name] = _both(name, properties[name], allowed) if name in properties else allowed
    return ObjectDescription(properties)


def _parts(formula: Formula) -> Iterator[Formula]:
    waiting = [formula]
    while waiting:
        one = waiting.pop(0)
        if isinstance(one, tree.And):
            waiting[:0] = one.parts
        else:
            yield one


def _property(part: Formula, symbol: str) -> tuple[str, Allowed]:
    match part:
        case tree.Feature():
            return _name(part, symbol), AllowedValues(((True, 1.0),))
        case tree.Not(tree.Feature() as feature):
            return _name(feature, symbol), AllowedValues(((False, 1.0),))
        case tree.Compare(sign, tree.Feature() as feature, tree.Const(value)) if sign in _TURNED:
            return _name(feature, symbol), _allowed(sign, value)
        case tree.Compare(sign, tree.Const(value), tree.Feature() as feature) if sign in _TURNED:
            return _name(feature, symbol), _allowed(_TURNED[sign], value)
        case tree.Or(parts):
            found = [_property(each, symbol) for each in parts]
            if len({name for name, _ in found}) == 1 and all(isinstance(each, AllowedValues) for _, each in found):
                degrees = [pair for _, each in found if isinstance(each, AllowedValues) for pair in each.degrees]
                return found[0][0], AllowedValues(tuple(dict.fromkeys(degrees)))
    raise Refused(f"description: expected properties compared with values, joined by and; write {EXAMPLE}", "text")


def _name(feature: tree.Feature, symbol: str) -> str:
    if feature.objects != (tree.Variable(symbol),) or feature.attribute is not None:
        raise Refused(f"description: expected properties of {symbol} alone; write {feature.name}[{symbol}]", "text")
    return feature.name


def _allowed(sign: str, value: bool | float | str) -> Allowed:
    if sign == "=":
        return AllowedValues(((value if isinstance(value, bool | str) else float(value), 1.0),))
    if isinstance(value, bool | str):
        raise Refused(f"description: {sign}: expected a number, got {value!r}", "text")
    return AllowedInterval(float(value), inf) if sign in {">", ">="} else AllowedInterval(-inf, float(value))


def _both(name: str, one: Allowed, other: Allowed) -> Allowed:
    """A number between two."""
    if isinstance(one, AllowedInterval) and isinstance(other, AllowedInterval):
        low, high = max(one.low, other.low), min(one.high, other.high)
        if low <= high:
            return AllowedInterval(low, high)
    raise Refused(f"description: {name} cannot be {one} and {other}: nothing could match", "text")
