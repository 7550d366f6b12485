"""Declarations as plain data for another process of this platform, and back: without the places of their nodes, which only messages need.

They are no text of a domain: to read one takes thirteen times as long, 4.3 ms for 1.7 kB, and a search process has read it already, so
that the thread of the platform need not. The text is JSON: of each declaration or formula its kind and its fields, in their order. A text
that comes back is checked field by field against the kind's declaration: a platform that a journal is replayed to may read a text
from a stranger.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Any, Final, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from dyknow.planning.domains import model
from dyknow.reasoning.formulas import tree

T = TypeVar("T")
Check = Callable[[Any], Any]
"""Takes what JSON has and gives the value; raises ValueError."""
LONGEST: Final = 32 * 2**20
"""Limit of a text to unpack, in characters: the longest texts come to a third of it."""
_PLACE: Final = "place"
_KINDS: Final[dict[str, type]] = {
    name: kind
    for module in (tree, model)
    for name, kind in vars(module).items()
    if isinstance(kind, type) and is_dataclass(kind) and kind.__module__ == module.__name__
}


def packed(value: object) -> str:
    """As text of one line."""
    return json.dumps(_plain(value), separators=(",", ":"), ensure_ascii=False)


def unpacked(text: str, kind: type[T]) -> T:
    """The declarations in a packed text.

    Raises:
        ValueError: it was not packed here, or is no `kind`.
    """
    if len(text) > LONGEST:
        raise ValueError(f"what was packed has {len(text)} characters, at most {LONGEST} are read")
    try:
        found = _reader_of(kind)(json.loads(text))
    except (ValueError, TypeError, RecursionError) as wrong:
        raise ValueError(f"what was packed cannot be read: {wrong}"[:300]) from None
    if not isinstance(found, kind):
        raise ValueError(f"what was packed is no {kind.__name__}")  # noqa: TRY004  (bad text, not a wrong call)
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(one) for one in value]
    if is_dataclass(value):
        kind = type(value)
        return [kind.__name__, *[_plain(getattr(value, name)) for name in _names(kind)]]
    return dict(value) if isinstance(value, Mapping) else value


def _names(kind: Any) -> tuple[str, ...]:
    """Of the fields that are packed."""
    return tuple([name for name, _ in _declared(kind)])


def _reader_of(kind: Any) -> Check:
    return _reader(kind)


@cache
def _declared(kind: type) -> tuple[tuple[str, Any], ...]:
    """Name and type of each field that is packed."""
    hints = get_type_hints(kind)
    return tuple((one.name, hints[one.name]) for one in fields(kind) if one.init and one.name != _PLACE)


@cache
def _reader(kind: type) -> Check:
    """Reads values of a kind, a class of declarations or formulas."""
    name, declared = kind.__name__, tuple([_check(hint) for _, hint in _declared(kind)])
    names = _names(kind)

    def read(found: Any) -> Any:
        if type(found) is not list or len(found) != len(declared) + 1 or found[0] != name:
            raise ValueError(f"{name} is expected")
        return kind(**{each: check(one) for each, check, one in zip(names, declared, found[1:], strict=True)})

    return read


def _node(found: Any) -> Any:
    """A node of any kind."""
    kind = _KINDS.get(found[0]) if type(found) is list and found and type(found[0]) is str else None
    if kind is None or not issubclass(kind, tree.Node):
        raise ValueError("an expression is expected")
    return _reader_of(kind)(found)


def _check(hint: Any) -> Check:
    """Reads what a field of this type has."""
    origin, given = get_origin(hint), get_args(hint)
    if hint is Any:
        return _node
    if origin in {Union, UnionType}:
        return _any_of(given)
    if origin is Literal:
        return _plain_check(lambda found: found in given, str(given))
    if origin is tuple:
        return _many(given)
    if origin is not None and issubclass(origin, Mapping):
        return _plain_check(
            lambda found: type(found) is dict and all(type(one) is str for one in found.values()), "texts by name"
        )
    if hint is float:
        return _plain_check(lambda found: type(found) in {float, int}, "a number")
    if is_dataclass(hint):
        return _reader_of(hint)
    return _plain_check(lambda found: type(found) is hint, hint.__name__)


def _plain_check(fits: Callable[[Any], bool], what: str) -> Check:
    def read(found: Any) -> Any:
        if not fits(found):
            raise ValueError(f"{what} is expected")
        return found

    return read


def _any_of(given: tuple[Any, ...]) -> Check:
    """One of several: plain values by their type, and a node, of a kind that may stand there or of a domain."""
    plain = {one for one in given if one in {str, int, float, bool, NoneType}}
    lists = [_check(one) for one in given if get_origin(one) is tuple]
    others = plain != set(given)

    def read(found: Any) -> Any:
        if type(found) in plain:
            return found
        if lists and type(found) is list and found[:1] and (type(found[0]) is not str or found[0] not in _KINDS):
            return lists[0](found)
        if not others:
            raise ValueError(f"{', '.join(sorted(one.__name__ for one in plain))} is expected")
        return _node(found)

    return read


def _many(given: tuple[Any, ...]) -> Check:
    if len(given) != 2 or given[1] is not Ellipsis:
        raise TypeError("fields are tuples of one type")
    check = _check(given[0])

    def read(found: Any) -> Any:
        if type(found) is not list:
            raise ValueError("a list is expected")
        return tuple([check(one) for one in found])

    return read
