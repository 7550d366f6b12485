"""The language of contents: `(head name: value ...)`, printed as the thesis prints it and parsed back exactly.

    (create-multicast semantic-labels: (sequence heli-position heli-altitude) sample-period: 1.0 delay: 1.0)

Values are symbols, quoted texts, numbers, `true`, `false`, `no_value`, `(sequence ...)`, `(record name: value ...)` and
expressions. Blanks and line ends between them are free.
"""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import islice
from math import isfinite
from typing import Any, TypeAlias

from dyknow.model.errors import TextError
from dyknow.model.values import NO_VALUE, NoValue

MAX_TEXT = 65_536
MAX_DEPTH = 16
MAX_INTEGER = 2**63 - 1
MIN_INTEGER = -(2**63)
MAX_COUNT = 2**62
"""Of a number of something: sums of such numbers are of 64 bits."""

_SYMBOL = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_./@\[\],-]{0,255}")
_NAME = re.compile(r"(?=.{1,64}\Z)[a-z][a-z0-9]*([-_][a-z0-9]+)*")
_INTEGER = re.compile(r"-?(0|[1-9][0-9]*)")
_NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")
_QUOTED = re.compile(r'"(?:[^"\\]++|\\.)*+":?', re.DOTALL)
_TOKEN = re.compile(rf'[()]|{_QUOTED.pattern}|[^\s()"]+|".*', re.DOTALL)
"""A quoted text without end is one token with all that follows: nothing of it is looked at again."""
_WORDS: dict[str, Any] = {"true": True, "false": False, "no_value": NO_VALUE}
_FORMS = frozenset({"sequence", "record"})


class QuotedText(str):
    """Words for a person: always printed in quotes, also where they could pass for a symbol."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Expr:
    """An expression; `str` prints it.

    Attributes:
        head: the kind of content, e.g. `create-multicast`; a name as `is_name` has it.
        arguments: by name, in the order in which they are printed. A tuple is a sequence, a dict a record.
    """

    head: str
    arguments: Mapping[str, "ExprValue"] = field(default_factory=dict)

    def __str__(self) -> str:
        return print_value(self)


ExprValue: TypeAlias = "str | int | float | bool | NoValue | tuple[ExprValue, ...] | dict[str, ExprValue] | Expr"


def is_name(text: str) -> bool:
    """Can `text` be the head or an argument's name of an expression?"""
    return _NAME.fullmatch(text) is not None and text not in _FORMS


def is_symbol(text: str) -> bool:
    """Can `text` be printed without quotes and still be read back as a string?"""
    return _SYMBOL.fullmatch(text) is not None and text not in _WORDS and not _NUMBER.fullmatch(text)


def quote(text: str) -> str:
    """`text` in quotes, as JSON has it; characters that a terminal would obey rather than show are escaped."""
    shown = json.dumps(text, ensure_ascii=False)
    if shown.isprintable():
        return shown
    return "".join(char if char.isprintable() else json.dumps(char)[1:-1] for char in shown)


def print_value(value: ExprValue) -> str:
    """The text of a value.

    Raises:
        ValueError: the value has no text: a number that is not finite or not of 64 bits, a name that is none, nesting
            deeper than MAX_DEPTH.
    """
    return _print(value, 0)


def _print(value: ExprValue, depth: int) -> str:
    if isinstance(value, str):
        return value if not isinstance(value, QuotedText) and is_symbol(value) else quote(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, NoValue):
        return "no_value"
    if isinstance(value, int):
        if not MIN_INTEGER <= value <= MAX_INTEGER:
            raise ValueError(f"{value} does not fit into 64 bits")
        return str(value)
    if isinstance(value, float):
        if not isfinite(value):
            raise ValueError(f"{value} cannot be encoded in an act: a number must be finite")
        return repr(value)
    if depth >= MAX_DEPTH:
        raise ValueError(f"nested deeper than {MAX_DEPTH}")
    if isinstance(value, tuple):
        return f"({' '.join(['sequence', *(_print(member, depth + 1) for member in value)])})"
    if isinstance(value, dict):
        named = (f"{_key(name)}: {_print(member, depth + 1)}" for name, member in value.items())
        return f"({' '.join(['record', *named])})"
    if not is_name(value.head) or not all(map(is_name, value.arguments)):
        raise ValueError(f"{value.head!r} or one of its arguments {list(value.arguments)} is not a name")
    named = (f"{name}: {_print(member, depth + 1)}" for name, member in value.arguments.items())
    return f"({' '.join([value.head, *named])})"


def _key(name: str) -> str:
    return name if is_symbol(name) else quote(name)


class ExprReader:
    """Tokens of one text, read from left to right."""

    def __init__(self, text: str) -> None:
        if len(text) > MAX_TEXT:
            raise TextError(f"an expression has at most {MAX_TEXT} characters, this one {len(text)}")
        self._text = text
        self._tokens: list[str] = _TOKEN.findall(text)
        self._next = 0
        if self._tokens and self._tokens[-1].startswith('"') and not _QUOTED.fullmatch(self._tokens[-1]):
            raise self.wrong("this quoted text has no end", at=len(self._tokens) - 1, repair='"..."')

    def _error(self, message: str, offset: int, width: int, repair: str) -> TextError:
        line = self._text.count("\n", 0, offset) + 1
        column = offset - (self._text.rfind("\n", 0, offset) + 1) + 1
        return TextError(message, text=self._text, line=line, column=column, width=width, repair=repair)

    def wrong(self, message: str, *, at: int | None = None, repair: str = "") -> TextError:
        """The error to raise about token number `at`, by default the one that comes next."""
        number = self._next if at is None else at
        if number < len(self._tokens):
            token = next(islice(_TOKEN.finditer(self._text), number, None))
            return self._error(message, token.start(), min(len(token[0]), 40), repair)
        return self._error(f"{message}, but the text ends", len(self._text), 1, repair)

    @property
    def position(self) -> int:
        """The number of the token that comes next, for `wrong`."""
        return self._next

    def peek(self) -> str:
        """The next token, or the empty string at the end."""
        return self._tokens[self._next] if self._next < len(self._tokens) else ""

    def take(self, token: str) -> None:
        """Step over `token`, which must come next."""
        if self.peek() != token:
            raise self.wrong(f"`{token}` is expected here", repair=token)
        self._next += 1

    def word(self) -> str:
        """The next token, whatever it is."""
        token = self.peek()
        if token in {"", "(", ")"}:
            raise self.wrong("a word is expected here")
        self._next += 1
        return token

    def end(self) -> None:
        if self.peek():
            raise self.wrong("nothing may follow here")

    def value(self, depth: int = 0) -> ExprValue:
        if self.peek() == "(":
            if depth >= MAX_DEPTH:
                raise self.wrong(f"nested deeper than {MAX_DEPTH}")
            return self._form(depth)
        token = self.word()
        try:
            return _atom(token)
        except ValueError as wrong:
            raise self.wrong(str(wrong), at=self._next - 1) from None

    def _form(self, depth: int) -> ExprValue:
        self.take("(")
        head = self.word()
        if head == "sequence":
            members = []
            while self.peek() != ")":
                members.append(self.value(depth + 1))
            self.take(")")
            return tuple(members)
        if head == "record":
            return self._named(depth, record=True)
        if not is_name(head):
            raise self.wrong(
                f"{head!r:.40} is not what an expression can begin with",
                at=self._next - 1,
                repair="(head name: value ...)",
            )
        return Expr(head, self._named(depth, record=False))

    def _named(self, depth: int, *, record: bool) -> dict[str, ExprValue]:
        members: dict[str, ExprValue] = {}
        while self.peek() != ")":
            word = self.word()
            name = _field_name(word, record=record)
            if name is None or name in members:
                why = "a name with a colon is expected here" if name is None else f"{name!r} is given twice"
                raise self.wrong(why, at=self._next - 1, repair="name: value")
            members[name] = self.value(depth + 1)
        self.take(")")
        return members


def _field_name(word: str, *, record: bool) -> str | None:
    if not word.endswith(":"):
        return None
    name = word[:-1]
    if not record:
        return name if is_name(name) else None
    if name.startswith('"'):
        try:
            return _unquote(name)
        except ValueError:
            return None
    return name if is_symbol(name) else None


def _unquote(token: str) -> str:
    try:
        text: str = json.loads(token, strict=False)
    except ValueError:
        raise ValueError("an escape in this text is not one of JSON's") from None
    if any("\ud800" <= char <= "\udfff" for char in text):
        raise ValueError("half a character: a surrogate without its partner")
    return text


def _atom(token: str) -> ExprValue:
    if token.startswith('"'):
        if token.endswith(":"):
            raise ValueError("a value is expected here, not a name")
        return QuotedText(_unquote(token))
    if token in _WORDS:
        word: ExprValue = _WORDS[token]
        return word
    if _INTEGER.fullmatch(token):
        if len(token) > 20 or not MIN_INTEGER <= int(token) <= MAX_INTEGER:
            raise ValueError("an integer has at most 64 bits")
        return int(token)
    if _NUMBER.fullmatch(token):
        number = float(token)
        if not isfinite(number):
            raise ValueError("this number is too large")
        return number
    if _SYMBOL.fullmatch(token):
        return token
    raise ValueError(
        f"{token!r:.40} is not a symbol; put it in quotes" if not token.endswith(":") else "a value is expected here"
    )
