"""Labels of stream generators (thesis, Def. 4.4.6): a feature of some objects."""

import re
from typing import NamedTuple

from dyknow.model.errors import TextError

MAX_LABEL = 512
"""Longest label in characters."""

RESERVED = frozenset(
    [
        "any",
        "approximation",
        "change",
        "compunit",
        "delay",
        "every",
        "from",
        "max",
        "monotone",
        "most",
        "no",
        "oo",
        "order",
        "recent",
        "sample",
        "source",
        "stream",
        "strict",
        "strmgen",
        "to",
        "update",
        "use",
        "with",
        "not",
        "and",
        "or",
        "until",
        "always",
        "eventually",
        "forall",
        "exists",
        "true",
        "false",
        "abs",
    ]
)
"""Words that name nothing, wherever names stand (Def. 4.4.2 and the words of logic). `from`, `to` may be objects."""

_NAME = r"[A-Za-z_][A-Za-z0-9_]*(?:-[A-Za-z0-9_]+)*"
_FEATURE = re.compile(rf"{_NAME}(?:\.{_NAME})?")
_OBJECT = re.compile(rf"{_NAME}|[0-9]+")


class Label(NamedTuple):
    """`feature[object, ...]`; the feature may carry `.attribute`, as in `cars.link[car1]`.

    Objects that are integers stay text: `Label("xy_dist", ("0", "1"))`.
    """

    feature: str
    objects: tuple[str, ...] = ()

    @classmethod
    def of(cls, label: "Label | str") -> "Label":
        """A label, or the one that a text names; see `parse`."""
        return cls.parse(label) if isinstance(label, str) else label

    @classmethod
    def parse(cls, text: str) -> "Label":
        """Read a label; blanks around names are free.

        Raises:
            TextError: it is not a label; the error says where.
        """
        if len(text) > MAX_LABEL:
            raise TextError(
                f"a label has at most {MAX_LABEL} characters, this one has {len(text)}", text=text[:80], width=80
            )
        head, bracket, rest = text.partition("[")
        feature = _name(text, head, 0, _FEATURE, "a feature name")
        if not bracket:
            return cls(feature)
        inside, closing, tail = rest.partition("]")
        if not closing:
            raise _wrong(text, len(text), 1, "a label ends with `]`", f"{feature}[{rest.strip()}]")
        objects, start = [], len(head) + 1
        for part in inside.split(","):
            objects.append(_name(text, part, start, _OBJECT, "an object name or an integer"))
            start += len(part) + 1
        if tail.strip():
            raise _wrong(
                text, start, len(tail), f"nothing may follow `]`, found {tail.strip()!r}", text[:start].strip()
            )
        return cls(feature, tuple(objects))

    def __str__(self) -> str:
        return f"{self.feature}[{', '.join(self.objects)}]" if self.objects else self.feature


def _name(text: str, part: str, start: int, pattern: re.Pattern[str], wanted: str) -> str:
    name = part.strip()
    reserved = name in RESERVED and not (pattern is _OBJECT and name in {"from", "to"})
    if reserved or not pattern.fullmatch(name):
        found = f"the reserved word {name!r}" if reserved else repr(name) if name else "nothing"
        raise _wrong(text, start + len(part) - len(part.lstrip()), len(name), f"expected {wanted}, found {found}", "")
    return name


def _wrong(text: str, at: int, width: int, message: str, repair: str) -> TextError:
    return TextError.at_offset(text, at, message, width=width, repair=repair)
