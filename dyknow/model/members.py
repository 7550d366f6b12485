"""Members: the objects, or the pairs of objects, that a value names.

Declarations for each member of a stream, and quantifiers, range over these.
"""

import re
from functools import lru_cache
from typing import Final

from dyknow.model.errors import SortError
from dyknow.model.labels import RESERVED
from dyknow.model.sample import Value
from dyknow.model.values import NO_VALUE

MAX_MEMBERS: Final = 4096
MAX_NAME: Final = 128
"""Longest name of a member, in characters."""
_OBJECT: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(-[A-Za-z0-9_]+)*|[0-9]+")
_OTHER: Final = re.compile(r"[^A-Za-z0-9_-]|-(?![A-Za-z0-9_])|^-")


def members_of(value: Value) -> tuple[str, ...]:
    """The objects a value names: one, or a set of them as a tuple or frozenset; `no_value` names none.

    Raises:
        SortError: it names no objects, or too many.
    """
    if value is NO_VALUE:
        return ()
    if type(value) is NamedMembers:
        return value
    several = value if isinstance(value, tuple | frozenset) else (value,)
    if len(several) > MAX_MEMBERS:
        raise SortError(f"{len(several)} objects at once; at most {MAX_MEMBERS} can be members")
    members = list(map(member_name, several))
    return tuple(dict.fromkeys(sorted(members) if isinstance(value, frozenset) else members))


def tuples_of(value: Value, count: int) -> tuple[tuple[str, ...], ...]:
    """The tuples of `count` objects that a value names; for 1 each object by itself.

    Raises:
        SortError: it names something else, or too many.
    """
    if count == 1:
        return tuple([(one,) for one in members_of(value)])
    if value is NO_VALUE:
        return ()
    if not isinstance(value, tuple | frozenset) or not all(
        isinstance(one, tuple) and len(one) == count for one in value
    ):
        raise SortError(f"{str(value)[:80]} is no set of {count} objects each")
    if len(value) > MAX_MEMBERS:
        raise SortError(f"{len(value)} of {count} objects at once; at most {MAX_MEMBERS} can be members")
    return tuple(dict.fromkeys(tuple(map(member_name, one)) for one in value))


def member_name(one: Value) -> str:
    """The name of one object, a text or an integer; raises SortError if it is none."""
    if isinstance(one, int) and not isinstance(one, bool):
        if 0 <= one < 10**MAX_NAME:
            return str(one)
        raise SortError(f"{'a number of that size' if one > 0 else 'a negative number'} names no object")
    if not isinstance(one, str):
        raise SortError(f"a {type(one).__name__} names no object; a text or an integer does")
    if not is_object_name(one):
        raise SortError(f"{one[:80]!r} names no object")
    return one


class NamedMembers(tuple[str, ...]):
    """Members whose names are known to be names, each once."""

    __slots__ = ()


@lru_cache(maxsize=2 * MAX_MEMBERS)
def is_object_name(text: str) -> bool:
    """Whether formulas, labels and sets take it as the name of an object."""
    is_reserved = text in RESERVED and text not in {"from", "to"}
    return len(text) <= MAX_NAME and _OBJECT.fullmatch(text) is not None and not is_reserved


def object_name(text: str) -> str:
    """A text as the name of an object: itself, if it is one, else with `_` in place of other characters, and cut."""
    if is_object_name(text):
        return text
    plain = _OTHER.sub("_", text[: MAX_NAME - 1])
    return plain if is_object_name(plain) else f"_{plain}"
