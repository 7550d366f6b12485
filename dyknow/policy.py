"""Policies: what a stream must be like for the one who subscribes to it (thesis, Def. 4.4.8 to 4.4.13, 4.5.11)."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from hashlib import sha256
from math import inf
from typing import Literal, TypeAlias, get_args

from dyknow import adapters
from dyknow.errors import PolicyError
from dyknow.instants import MAX_DURATION_US, print_duration
from dyknow.sample import Sample

Change: TypeAlias = Literal["any update", "any change", "sample"]
Order: TypeAlias = Literal["any", "monotone", "strict"]
Approximation: TypeAlias = Literal["none", "most recent", "linear"]


@dataclass(frozen=True, slots=True)
class Policy:
    """A set of constraints on one stream; equal policies are one policy, whatever words they were typed with.

    Attributes:
        change: which samples count as news; `sample` keeps to a grid of valid times and implies strict order.
        sample_us: the grid's period. The grid is anchored on `from_us`, else on the first sample delivered.
        max_delay_us: available time may exceed valid time by so much; None is no limit.
        from_us: first valid time of interest, `to_us` the last, both inclusive; None is no bound.
        order: relation of valid times of successive samples.
        approximation: what may stand in for a missing sample. `most recent` needs `sample`, `from_us` and
            `max_delay_us`, so that it is known what is missing, and when; `linear` needs `sample`.
        exact: `no approximation` was said, as nothing else was: the stream is the same, but a state has no other values
            of it (7.8.2), where it would have the most recent one.
        delay_before_us: of state streams: how long to wait before an approximation is used (7.8.2).
        min_certainty: samples are right with at least this probability, in [0, 1]; None is no limit (12.3).
        max_deviation: no component has a greater standard deviation, in its unit; None is no limit (12.3).
        importance: which streams are to suffer last when there is too much to do; says nothing of the samples.

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

    def __post_init__(self) -> None:
        self._check_words()
        self._check_times()
        if (self.change == "sample") != (self.sample_us is not None):
            raise PolicyError("a sample period goes with the constraint `sample every`, and only with it")
        self._constraints()  # each refuses a number that is wrong by itself
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

    def satisfied_by(self, samples: Iterable[Sample]) -> bool:
        """Whether a stream, ordered by available time, satisfies every constraint (Def. 4.5.11).

        `sample every` holds when valid times differ by positive multiples of the period: a miss is a gap, not the end.
        """
        constraints = self._constraints()
        last: Sample | None = None
        for sample in samples:
            if not all(accept(sample, last) for accept in constraints):
                return False
            last = sample
        return True

    def content_hash(self) -> str:
        """8 hexadecimal digits of the canonical text, without what says nothing of samples: equal streams, equal keys."""
        return sha256(str(replace(self, importance=1.0, exact=False)).encode()).hexdigest()[:8]

    @classmethod
    def parse(cls, text: str) -> "Policy":
        """Read `sample every 100, max delay 1s, from 0 to oo, use most recent`; the empty text is `Policy()`.

        Raises:
            TextError: it is not a policy; the error says where and what to write.
            PolicyError: the constraints cannot hold together.
        """
        from dyknow.policy_text import parse_policy  # it builds policies

        return parse_policy(text)

    def __str__(self) -> str:
        from dyknow.policy_text import print_policy

        return print_policy(self)

    def named_constraints(self) -> list[tuple[str, adapters.Accept]]:
        """Each constraint in the words of KPL, and whether a sample satisfies it after the one before."""
        found: list[tuple[str, adapters.Accept]] = []
        if self.sample_us is not None:
            found.append((f"sample every {print_duration(self.sample_us)}", adapters.sample_every(self.sample_us)))
        elif self.change == "any change":
            found.append(("any change", adapters.any_change))
        if self.max_delay_us is not None:
            found.append((f"max delay {print_duration(self.max_delay_us)}", adapters.max_delay(self.max_delay_us)))
        if self.from_us is not None or self.to_us is not None:
            begins = "" if self.from_us is None else f"from {print_duration(self.from_us)} "
            ends = "oo" if self.to_us is None else print_duration(self.to_us)
            found.append((f"{begins}to {ends}", adapters.duration(self.from_us, self.to_us)))
        if self.order != "any":
            order = adapters.strict_order if self.order == "strict" else adapters.monotone_order
            found.append((f"{self.order} order", order))
        if self.min_certainty is not None:
            found.append((f"min certainty {self.min_certainty:g}", adapters.min_certainty(self.min_certainty)))
        if self.max_deviation is not None:
            found.append((f"max deviation {self.max_deviation:g}", adapters.max_deviation(self.max_deviation)))
        return found

    def _constraints(self) -> tuple[adapters.Accept, ...]:
        return tuple([accept for _, accept in self.named_constraints()])

    def _check_words(self) -> None:
        for word, allowed in ((self.change, Change), (self.order, Order), (self.approximation, Approximation)):
            if word not in get_args(allowed):
                raise PolicyError(f"{word!r} is none of {', '.join(get_args(allowed))}")

    def _check_times(self) -> None:
        for name in ("sample_us", "max_delay_us", "from_us", "to_us", "delay_before_us"):
            time_us = getattr(self, name)
            if time_us is not None and not 0 <= time_us <= MAX_DURATION_US:
                raise PolicyError(f"{name} must be a time from 0 to {MAX_DURATION_US} us, got {time_us}")
