"""Policies: the constraints of a subscriber on its stream (thesis, Def. 4.4.8 to 4.4.13, 4.5.11)."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from hashlib import sha256
from math import inf
from typing import Any, Final, Literal, NamedTuple, NoReturn, TypeAlias, get_args

from dyknow.model.errors import PolicyError, TextError
from dyknow.model.instants import (
    MAX_DURATION_US,
    US_PER_MS,
    RelativeInstant,
    parse_duration,
    parse_instant,
    print_duration,
    print_instant,
)
from dyknow.policies import adapters

Change: TypeAlias = Literal["any update", "any change", "sample", "all updated", "all changed"]
Order: TypeAlias = Literal["any", "monotone", "strict"]
Approximation: TypeAlias = Literal["none", "most recent", "linear"]

MAX_POLICY: Final = 1024
"""Longest policy in characters."""
_TOKEN = re.compile(r'\s*(?:([A-Za-z][A-Za-z0-9_]*|[+-]?\s*[0-9][0-9A-Za-z.+-]*|"[^"\n]*"|,)|(\S))')
_QUANTITY = re.compile(r"[0-9]{1,40}(?:\.[0-9]{1,40})?(?:[eE][+-]?[0-9]{1,3})?")
_CONSTRAINTS: Final = (
    ("any update", "change", "any update"),
    ("any change", "change", "any change"),
    ("all updated", "change", "all updated"),
    ("all changed", "change", "all changed"),
    ("sample every", "sample_us", "$time"),
    ("max delay", "max_delay_us", "$time or oo"),
    ("from", "from_us", "$instant"),
    ("to", "to_us", "$instant or oo"),
    ("any order", "order", "any"),
    ("monotone order", "order", "monotone"),
    ("strict order", "order", "strict"),
    ("no approximation", "approximation", "none"),
    ("use most recent", "approximation", "most recent"),
    ("use linear", "approximation", "linear"),
    ("delay before approximation", "delay_before_us", "$time"),
    ("max age of prediction", "prediction_age_us", "$time"),
    ("max age", "max_age_us", "$time"),
    ("min certainty", "min_certainty", "$number"),
    ("max deviation", "max_deviation", "$number"),
    ("predict", "predict_us", "$time"),
    ("importance", "importance", "$number"),
)
"""The words of each constraint (thesis 4.4.3 and ours), the attribute it sets, and to what."""
_KINDS: Final = {"sample_us": "change"}
"""Attributes that share one kind of constraint."""
_FORMS: Final = (
    "any update, any change, all updated, all changed, sample every T, max delay T, from T to T, any order, monotone order, strict order, "
    "no approximation, use most recent, use linear, delay before approximation T, max age T, min certainty P, max deviation D, "
    "predict T, max age of prediction T, importance N"
)


@dataclass(frozen=True, slots=True)
class Policy:
    """A set of constraints on one stream; equal policies are one policy, whatever words they were typed with.

    Attributes:
        change: which samples count as news; `sample` keeps to a grid of valid times and implies strict order. Of states
            also `all updated` and `all changed`: once every input has a new sample, or another value (7.8, Fig. 7.9).
        sample_us: the grid's period. The grid is anchored on `from_us`, else on the first sample delivered.
        max_delay_us: available time may exceed valid time by so much; None is no limit.
        from_us: first valid time of interest, `to_us` the last, both inclusive; None is no bound. Either may be an
            `RelativeInstant` from the moment of declaration until `at` knows when that was.
        order: relation of valid times of successive samples.
        approximation: the replacement of a missing sample. `most recent` needs `sample`, `from_us` and `max_delay_us`,
            so that it is known what is missing, and when; `linear` needs `sample`.
        exact: `no approximation` was given, by itself: the stream is the same, but a state has no other values
            of it (7.8.2), where it would have the most recent one.
        delay_before_us: of state streams: how long to wait before an approximation is used (7.8.2).
        max_age_us: of state streams: a value observed longer before the state is none there; a prediction was observed
            when it was made. None is no limit.
        min_certainty: samples are right with at least this probability, in [0, 1]; None is no limit (12.3).
        max_deviation: no component has a greater standard deviation, in its unit; None is no limit (12.3).
        predict_us: values so long after each sample, on the straight line through it and the one before; each is valid
            then, and marked as predicted. A predicted sample stays as it is (12.3).
        prediction_age_us: a predicted sample that was made longer ago when it comes is dropped; None is no limit (12.3).
        importance: which streams are to suffer last when there is too much to do; does not affect the samples.

    Raises:
        PolicyError: the constraints cannot hold together.
    """

    change: Change = "any update"
    sample_us: int | None = None
    max_delay_us: int | None = None
    from_us: int | None = None
    to_us: int | None = None
    order: Order = "any"
    approximation: Approximation = "none"
    delay_before_us: int | None = None
    min_certainty: float | None = None
    max_deviation: float | None = None
    importance: float = 1.0
    exact: bool = False
    predict_us: int | None = None
    prediction_age_us: int | None = None
    max_age_us: int | None = None

    def __post_init__(self) -> None:
        self._check_words()
        self._check_times()
        if (self.change == "sample") != (self.sample_us is not None):
            raise PolicyError("a sample period goes with the constraint `sample every`, and only with it")
        self.named_constraints()  # each refuses a number that is wrong by itself
        if not 0 < self.importance < inf:
            raise PolicyError(f"an importance is a number > 0, got {self.importance}", "importance 2")
        if self.exact and self.approximation != "none":
            raise PolicyError(f"`no approximation` and `use {self.approximation}` collide", "leave one out")
        if self.approximation != "none" and self.sample_us is None:
            raise PolicyError(
                f"`use {self.approximation}` needs `sample every`: else nothing is missing",
                f"sample every 100, use {self.approximation}",
            )
        if self.approximation == "most recent" and (self.from_us is None or self.max_delay_us is None):
            raise PolicyError(
                "`use most recent` needs `from` and `max delay`: which samples are missing, and when that is sure",
                "sample every 100, max delay 200, from 0 to oo, use most recent",
            )
        if self.sample_us is not None:
            object.__setattr__(self, "order", "strict")

    def content_hash(self) -> str:
        """8 hexadecimal digits of the canonical text, without parts that do not affect samples: equal streams, equal
        keys.

        Raises:
            PolicyError: it has a time relative to its declaration, which means another stream at another time.
        """
        if self.is_relative:
            raise PolicyError(f"`{self}` is relative to when it is declared", "times since 1970")
        return sha256(str(replace(self, importance=1.0, exact=False)).encode()).hexdigest()[:8]

    @property
    def is_relative(self) -> bool:
        """Whether a bound is relative to the moment of declaration."""
        return isinstance(self.from_us, RelativeInstant) or isinstance(self.to_us, RelativeInstant)

    @property
    def of_states(self) -> str:
        """The words of a constraint that needs the inputs of states, and means nothing of another stream; empty: there is none."""
        if self.delay_before_us is not None:
            return "delay before approximation"
        if self.max_age_us is not None:
            return "max age"
        return self.change if self.change in {"all updated", "all changed"} else ""

    def at(self, now_us: int) -> "Policy":
        """The policy, declared at `now_us`: relative bounds become instants.

        A relative `from` is the next multiple of the sample period, if there is one: so it meets the grid of the epoch.

        Raises:
            PolicyError: the duration ends before it starts.
        """
        if not self.is_relative:
            return self
        from_us, to_us = (
            each.at(now_us) if isinstance(each, RelativeInstant) else each for each in (self.from_us, self.to_us)
        )
        if self.sample_us is not None and from_us is not None and isinstance(self.from_us, RelativeInstant):
            from_us += -from_us % self.sample_us
        return replace(self, from_us=from_us, to_us=to_us)

    @classmethod
    def of(cls, policy: "Policy | str") -> "Policy":
        """A policy, or the one that a text describes; see `parse`."""
        return cls.parse(policy) if isinstance(policy, str) else policy

    @classmethod
    def parse(cls, text: str) -> "Policy":
        """Read `sample every 100, max delay 1s, from 0 to oo, use most recent`; the empty text is `Policy()`.

        Bounds of a duration are read by `parse_instant`.

        Raises:
            TextError: it is not a policy; the error says where and what to write.
            PolicyError: the constraints cannot hold together.
        """
        if len(text) > MAX_POLICY:
            raise TextError(
                f"a policy has at most {MAX_POLICY} characters, this one has {len(text)}", text=text[:80], width=80
            )
        return _Reader(text).read()

    def __str__(self) -> str:
        """The canonical text: one constraint of each kind that restricts anything; `parse` reads it back."""
        words = [
            "" if self.change in {"any update", "sample"} else self.change,
            _timed("sample every", self.sample_us),
            _timed("max delay", self.max_delay_us),
            _duration(self.from_us, self.to_us),
            f"{self.order} order" if self.order != "any" and self.sample_us is None else "",
            "no approximation" if self.exact else "",
            f"use {self.approximation}" if self.approximation != "none" else "",
            _timed("delay before approximation", self.delay_before_us),
            _timed("max age", self.max_age_us),
            _number("min certainty", self.min_certainty),
            _number("max deviation", self.max_deviation),
            _timed("predict", self.predict_us),
            _timed("max age of prediction", self.prediction_age_us),
            _number("importance", None if self.importance == 1 else self.importance),
        ]
        return ", ".join(filter(None, words)) or "any update"

    def named_constraints(self) -> list[tuple[str, adapters.Accept]]:
        """Each constraint in the words of KPL, and whether a sample satisfies it after the one before (Def. 4.5.11).

        `sample every` holds when valid times differ by positive multiples of the period: a miss is a gap, not the end.
        """
        found: list[tuple[str, adapters.Accept]] = []
        if self.sample_us is not None:
            found.append((f"sample every {print_duration(self.sample_us)}", adapters.sample_every(self.sample_us)))
        elif self.change == "any change":
            found.append(("any change", adapters.any_change))
        if self.max_delay_us is not None:
            found.append((f"max delay {print_duration(self.max_delay_us)}", adapters.max_delay(self.max_delay_us)))
        if self.from_us is not None or self.to_us is not None:
            begins = "" if self.from_us is None else f"from {print_instant(self.from_us)} "
            ends = "oo" if self.to_us is None else print_instant(self.to_us)
            found.append((f"{begins}to {ends}", adapters.duration(self.from_us, self.to_us)))
        if self.order != "any":
            order = adapters.strict_order if self.order == "strict" else adapters.monotone_order
            found.append((f"{self.order} order", order))
        if self.min_certainty is not None:
            found.append((f"min certainty {self.min_certainty:g}", adapters.min_certainty(self.min_certainty)))
        if self.max_deviation is not None:
            found.append((f"max deviation {self.max_deviation:g}", adapters.max_deviation(self.max_deviation)))
        if self.predict_us is not None:
            found.append((f"predict {print_duration(self.predict_us)}", adapters.predicted(self.predict_us)))
        if (age_us := self.prediction_age_us) is not None:
            found.append((f"max age of prediction {print_duration(age_us)}", adapters.max_prediction_age(age_us)))
        return found

    def _check_words(self) -> None:
        for word, allowed in ((self.change, Change), (self.order, Order), (self.approximation, Approximation)):
            if word not in get_args(allowed):
                raise PolicyError(f"{word!r} is none of {', '.join(get_args(allowed))}")

    def _check_times(self) -> None:
        for name in (
            "sample_us",
            "max_delay_us",
            "from_us",
            "to_us",
            "delay_before_us",
            "predict_us",
            "prediction_age_us",
            "max_age_us",
        ):
            time_us = getattr(self, name)
            least_us = -MAX_DURATION_US if isinstance(time_us, RelativeInstant) else 0
            if time_us is not None and not least_us <= int(time_us) <= MAX_DURATION_US:
                raise PolicyError(f"{name} must be a time from 0 to {MAX_DURATION_US} us, got {time_us}")


class _Token(NamedTuple):
    text: str
    at: int


class _Reader:
    """One pass over the words of a policy; `fields` fills as constraints are read."""

    def __init__(self, text: str) -> None:
        self.text, self.next = text, 0
        self.tokens: list[_Token] = []
        self.fields: dict[str, Any] = {}
        self.written: dict[str, str] = {}
        for match in _TOKEN.finditer(text.rstrip()):
            if match[2]:
                self.fail(f"unexpected {match[2]!r}", _Token(match[2], match.start(2)))
            self.tokens.append(_Token(match[1], match.start(1)))

    def read(self) -> Policy:
        while self.tokens:
            self.constraint(self.peek())
            if self.next == len(self.tokens):
                break
            after = self.take()
            if after.text != ",":
                self.fail(f"constraints are separated by commas, got {after.text!r}", after)
        if self.fields.get("sample_us") is not None:
            self.fields["change"] = "sample"
        return Policy(**self.fields, exact=self.fields.get("approximation") == "none")

    def constraint(self, start: _Token) -> None:
        for words, field, value in _CONSTRAINTS:
            if self.words(*words.split()):
                self.put(field, self.value(value) if value.startswith("$") else value, start)
                if field == "from_us":
                    self.end_of_duration(start)
                return
        self.take()
        self.fail(f"no constraint starts like this: {start.text!r}", start, f"one of {_FORMS}")

    def end_of_duration(self, start: _Token) -> None:
        """`from T` may be followed by `to T`."""
        if self.words("to"):
            self.put("to_us", self.value("$instant or oo"), start)
        elif self.peek().text == "until":
            begin = self.tokens[self.next - 1].text
            self.fail("a duration ends with `to`, not `until`", self.peek(), f"from {begin} to ...")
        else:
            self.fields["to_us"] = None

    def words(self, *words: str) -> bool:
        """Take these words if they come next."""
        if tuple(t.text for t in self.tokens[self.next : self.next + len(words)]) != words:
            return False
        self.next += len(words)
        return True

    def put(self, field: str, value: Any, start: _Token) -> None:
        last = self.tokens[self.next - 1]
        written = self.text[start.at : last.at + len(last.text)]
        kind = _KINDS.get(field, field)
        if kind in self.written:
            self.fail(
                f"`{self.written[kind]}` and `{written}` collide: a policy has one constraint of each kind",
                start,
                "leave one out",
            )
        self.fields[field], self.written[kind] = value, written

    def value(self, kind: str) -> Any:
        """What the next word stands for; None for `oo` where that may stand."""
        kind, _, endless = kind.partition(" or ")
        if endless and self.words(endless):
            return None
        token = self.take()
        try:
            return _VALUES[kind](token.text)
        except TextError as wrong:
            self.fail(wrong.message, token, wrong.repair)

    def peek(self) -> _Token:
        return self.tokens[self.next] if self.next < len(self.tokens) else _Token("", len(self.text))

    def take(self) -> _Token:
        token = self.peek()
        if not token.text:
            self.fail("the policy ends within a constraint", token)
        self.next += 1
        return token

    def fail(self, message: str, token: _Token, repair: str = "") -> NoReturn:
        raise TextError.at_offset(self.text, token.at, message, width=len(token.text), repair=repair)


def _quantity(text: str) -> float:
    if not _QUANTITY.fullmatch(text):
        raise TextError(f"expected a number, got {text!r}", repair="0.95")
    if float(text) == inf:
        raise TextError("the number is too large", repair="0.95")
    return float(text)


_VALUES: Final[Mapping[str, Callable[[str], float]]] = {
    "$time": parse_duration,
    "$instant": lambda text: parse_instant("".join(text.split()) if text[0] in "+-" else text),
    "$number": _quantity,
}


def _timed(words: str, time_us: int | None) -> str:
    return "" if time_us is None else f"{words} {_time(time_us)}"


def _number(words: str, number: float | None) -> str:
    return "" if number is None else f"{words} {number:g}" if float(f"{number:g}") == number else f"{words} {number!r}"


def _duration(from_us: int | None, to_us: int | None) -> str:
    if from_us is None:
        return "" if to_us is None else f"to {print_instant(to_us)}"
    return f"from {print_instant(from_us)} to {'oo' if to_us is None else print_instant(to_us)}"


def _time(time_us: int) -> str:
    return f"{time_us}us" if time_us % US_PER_MS else f"{time_us // US_PER_MS}"
