"""Policies as text: the constraints of the thesis' grammar (4.4.3), with `use linear` and `delay before approximation`."""

import re
from collections.abc import Mapping
from math import inf
from typing import Any, NamedTuple, NoReturn

from dyknow.errors import TextError
from dyknow.instants import US_PER_MS, parse_duration
from dyknow.policy import Policy

MAX_POLICY = 1024
"""Longest policy in characters."""

_TOKEN = re.compile(r"\s*(?:([A-Za-z][A-Za-z0-9_]*|[0-9][0-9A-Za-z.+-]*|,)|(\S))")
_QUANTITY = re.compile(r"[0-9]{1,40}(?:\.[0-9]{1,40})?(?:[eE][+-]?[0-9]{1,3})?")
_CONSTRAINTS = (
    "any update", "any change", "sample every T", "max delay T", "from T to T", "any order", "monotone order", "strict order",
    "no approximation", "use most recent", "use linear", "delay before approximation T",
    "min certainty P", "max deviation D", "importance N",
)  # fmt: skip
_FLAGS: Mapping[tuple[str, ...], tuple[str, str]] = {
    ("any", "update"): ("change", "any update"),
    ("any", "change"): ("change", "any change"),
    ("any", "order"): ("order", "any"),
    ("monotone", "order"): ("order", "monotone"),
    ("strict", "order"): ("order", "strict"),
    ("no", "approximation"): ("approximation", "none"),
    ("use", "most", "recent"): ("approximation", "most recent"),
    ("use", "linear"): ("approximation", "linear"),
}


class _Token(NamedTuple):
    text: str
    at: int


class _Reader:
    """One pass over the words of a policy; `fields` fills as constraints are read."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.tokens: list[_Token] = []
        self.next = 0
        self.fields: dict[str, Any] = {}
        self.said: dict[str, str] = {}
        for found in _TOKEN.finditer(text.rstrip()):
            if found[2]:
                self.fail(f"unexpected {found[2]!r}", _Token(found[2], found.start(2)))
            self.tokens.append(_Token(found[1], found.start(1)))

    def read(self) -> Policy:
        while self.tokens:
            self.constraint(self.peek())
            if self.next == len(self.tokens):
                break
            after = self.take()
            if after.text != ",":
                self.fail(f"constraints are parted by commas, found {after.text!r}", after)
        return Policy(**self.fields, exact=self.fields.get("approximation") == "none")

    def constraint(self, start: _Token) -> None:
        for words, (field, value) in _FLAGS.items():
            if self.words(*words):
                self.put(field, value, start)
                return
        if self.words("sample", "every"):
            self.fields["sample_us"] = self.duration()
            self.put("change", "sample", start)
        elif self.words("max", "delay"):
            self.put("max_delay_us", self.duration_or_oo(), start)
        elif self.words("delay", "before", "approximation"):
            self.put("delay_before_us", self.duration(), start)
        elif self.words("min", "certainty"):
            self.put("min_certainty", self.quantity(), start)
        elif self.words("max", "deviation"):
            self.put("max_deviation", self.quantity(), start)
        elif self.words("importance"):
            self.put("importance", self.quantity(), start)
        elif self.words("from"):
            self.put("from_us", self.duration(), start)
            if self.words("to"):
                self.put("to_us", self.duration_or_oo(), start)
            elif self.peek().text == "until":
                self.fail(
                    "a duration ends with `to`, not `until`",
                    self.peek(),
                    f"from {self.tokens[self.next - 1].text} to ...",
                )
            else:
                self.fields["to_us"] = None
        elif self.words("to"):
            self.put("to_us", self.duration_or_oo(), start)
        else:
            self.take()
            self.fail(f"no constraint starts like this: {start.text!r}", start, "one of " + ", ".join(_CONSTRAINTS))

    def words(self, *words: str) -> bool:
        """Take these words if they come next."""
        if tuple(t.text for t in self.tokens[self.next : self.next + len(words)]) != words:
            return False
        self.next += len(words)
        return True

    def put(self, field: str, value: Any, start: _Token) -> None:
        last = self.tokens[self.next - 1]
        said = self.text[start.at : last.at + len(last.text)]
        if field in self.fields:
            self.fail(
                f"`{self.said[field]}` and `{said}` collide: a policy has one constraint of each kind",
                start,
                "leave one out",
            )
        self.fields[field], self.said[field] = value, said

    def duration(self) -> int:
        token = self.take()
        return self.number(token)

    def duration_or_oo(self) -> int | None:
        token = self.take()
        return None if token.text == "oo" else self.number(token)

    def number(self, token: _Token) -> int:
        try:
            return parse_duration(token.text)
        except TextError as wrong:
            self.fail(wrong.message, token, wrong.repair)

    def quantity(self) -> float:
        """A number without a suffix."""
        token = self.take()
        if not _QUANTITY.fullmatch(token.text):
            self.fail(f"a number is wanted, found {token.text!r}", token, "0.95")
        found = float(token.text)
        if found == inf:
            self.fail("the number is too large", token, "0.95")
        return found

    def peek(self) -> _Token:
        return self.tokens[self.next] if self.next < len(self.tokens) else _Token("", len(self.text))

    def take(self) -> _Token:
        token = self.peek()
        if not token.text:
            self.fail("the policy ends where a constraint goes on", token)
        self.next += 1
        return token

    def fail(self, message: str, token: _Token, repair: str = "") -> NoReturn:
        raise TextError.at_offset(self.text, token.at, message, width=len(token.text), repair=repair)


def parse_policy(text: str) -> Policy:
    """The policy a text describes; see `Policy.parse`."""
    if len(text) > MAX_POLICY:
        raise TextError(
            f"a policy has at most {MAX_POLICY} characters, this one has {len(text)}", text=text[:80], width=80
        )
    return _Reader(text).read()


def print_policy(policy: Policy) -> str:
    """The canonical text: one constraint of each kind that restricts anything, in this order; read back it is equal."""
    said = [
        "any change" if policy.change == "any change" else "",
        _said("sample every", policy.sample_us),
        _said("max delay", policy.max_delay_us),
        _duration(policy.from_us, policy.to_us),
        f"{policy.order} order" if policy.order != "any" and policy.sample_us is None else "",
        "no approximation" if policy.exact else "",
        f"use {policy.approximation}" if policy.approximation != "none" else "",
        _said("delay before approximation", policy.delay_before_us),
        _number("min certainty", policy.min_certainty),
        _number("max deviation", policy.max_deviation),
        _number("importance", None if policy.importance == 1 else policy.importance),
    ]
    return ", ".join(filter(None, said)) or "any update"


def _said(words: str, time_us: int | None) -> str:
    return "" if time_us is None else f"{words} {_time(time_us)}"


def _number(words: str, number: float | None) -> str:
    return "" if number is None else f"{words} {number:g}" if float(f"{number:g}") == number else f"{words} {number!r}"


def _duration(from_us: int | None, to_us: int | None) -> str:
    if from_us is None:
        return _said("to", to_us)
    return f"from {_time(from_us)} to {'oo' if to_us is None else _time(to_us)}"


def _time(time_us: int) -> str:
    return f"{time_us}us" if time_us % US_PER_MS else f"{time_us // US_PER_MS}"
