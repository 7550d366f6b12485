"""One stream made to satisfy one policy, sample by sample (thesis, 4.4.5, Def. 4.5.9 to 4.5.11)."""

from collections import Counter
from collections.abc import Callable, Iterable
from math import inf
from typing import Final, NamedTuple

from dyknow.model.errors import PolicyError
from dyknow.model.sample import SURE, Predicted, Sample
from dyknow.model.values import NO_VALUE
from dyknow.policies.lines import between, interpolate
from dyknow.policies.policy import Policy
from dyknow.policies.upcoming import Upcoming

CATCH_UP = 1024
"""Grid points approximated at once after a silence of the caller; older ones are a gap."""
STARVED = 10
"""A sampled stream starves when for this number of periods nothing came on its grid, and as many samples off it."""
MAX_REPLAYED = 16 * CATCH_UP
"""Grid points approximated for a stream that begins in the past; older ones are a gap."""

_REASONS: Final = {
    "_late": "late",
    "_out_of_order": "out of order",
    "_outside": "outside duration",
    "_no_change": "no change",
    "_off_grid": "off grid",
    "_uncertain": "uncertain",
    "_too_old": "old prediction",
    "_unpredictable": "not predictable",
}
"""The counters of samples that did not come through, with the reasons."""
_UNRESTRICTED: Final = Policy()
_EVER_US: Final = 2**80  # beyond every time, so that "no limit" needs no test of its own on the hot path


class Grid(NamedTuple):
    """Valid times that differ by multiples of a period; without an anchor the first sample says where they lie."""

    period_us: int
    anchor_us: int | None


class PolicyAdapter:
    """The stream of one subscription. Call `on_sample` as samples arrive, `on_time` at `deadline_us`.

    The output satisfies the policy, with available times that are strictly increasing: a tie is moved by 1 us, after
    the maximum delay was checked. Exact samples leave when they arrive. `use most recent` owes a sample for every grid
    point from the first call on: a missing one is approximated at valid time + max delay, and exact samples after it
    wait until then, because a sampled stream is strictly ordered. So each grid point comes out once, in order and
    within its delay; if the caller is late, it is handed on late, but is the sample that the policy says: value and
    available time are those of the instant at which it was due. `use linear` interpolates a missing grid point when the
    sample after it arrives.

    Attributes:
        on_sample: `(sample, now_us) -> list[Sample]`: the subscriber's samples now, often none.
        gaps: how often grid points are missing between two successive samples of the stream.
        on_starved: called once, when nearly all that comes lies off the grid.
    """

    __slots__ = (
        "_all",
        "_anchor_us",
        "_before",
        "_beyond",
        "_changes",
        "_confined_to",
        "_from_us",
        "_hungry_us",
        "_in_vain",
        "_is_unrestricted",
        "_last",
        "_late",
        "_least_certainty",
        "_least_step_us",
        "_max_delay_us",
        "_most_deviation",
        "_no_change",
        "_off_grid",
        "_oldest_us",
        "_out_of_order",
        "_outside",
        "_owed",
        "_patience_us",
        "_period_us",
        "_previous",
        "_take",
        "_to_us",
        "_too_old",
        "_uncertain",
        "_unpredictable",
        "gaps",
        "on_sample",
        "on_starved",
        "policy",
    )  # fmt: skip
    on_sample: Callable[[Sample, int], list[Sample]]
    _all: Callable[[Sample, int], list[Sample]]
    _take: Callable[[Sample, int], list[Sample]]
    _beyond: Callable[[Sample, int], list[Sample]]

    def __init__(self, policy: Policy) -> None:
        assert not policy.is_relative, "`Policy.at` says when it was declared"  # noqa: S101
        if policy.change in {"all updated", "all changed"}:
            raise PolicyError(f"`{policy.change}` is a constraint of states", "any change")
        self.policy, self._is_unrestricted = policy, policy == _UNRESTRICTED
        self.gaps = self._late = self._out_of_order = self._outside = self._no_change = self._off_grid = 0
        self._period_us = policy.sample_us or 0
        self._from_us = -_EVER_US if policy.from_us is None else policy.from_us
        self._to_us = _EVER_US if policy.to_us is None else policy.to_us
        self._max_delay_us = _EVER_US if policy.max_delay_us is None else policy.max_delay_us
        self._least_step_us = {"any": -2 * _EVER_US, "monotone": 0, "strict": 1}[policy.order]
        self._changes = policy.change == "any change"
        self._anchor_us = policy.from_us
        self._last: Sample | None = None
        self._previous: Sample | None = None
        self._owed: _Owed | None = None
        if policy.approximation == "most recent":
            self._owed = _Owed(self._from_us, self._to_us, self._period_us, self._max_delay_us)
        self.on_sample = {"none": self._exact, "most recent": self._most_recent, "linear": self._linear}[
            policy.approximation
        ]
        self.on_starved: Callable[[], None] = _ignore
        self._patience_us, self._in_vain, self._hungry_us = STARVED * self._period_us, 0, -_EVER_US
        self._uncertain = self._too_old = self._unpredictable = 0
        self._least_certainty = 0.0 if policy.min_certainty is None else policy.min_certainty
        self._most_deviation = inf if policy.max_deviation is None else policy.max_deviation
        self._oldest_us = _EVER_US if policy.prediction_age_us is None else policy.prediction_age_us
        if (policy.min_certainty, policy.max_deviation, policy.prediction_age_us) != (None, None, None):
            self._take, self.on_sample = self.on_sample, self._good
        self._before: Sample | None = None
        if policy.predict_us is not None:
            self._beyond, self.on_sample = self.on_sample, self._ahead
        self._all, self._confined_to = self.on_sample, (1, 0)

    def on_time(self, now_us: int) -> list[Sample]:
        """The samples due at `now_us`; more often than at `deadline_us` is harmless."""
        return [] if self._owed is None else self._on_grid(self._settle(self._owed, now_us, now_us))

    def confine(self, grid: Grid | None) -> None:
        """From now on nothing leaves that lies off `grid`, which has an anchor; order and counts are as without it.

        So the rest of the stream is unaffected, and its subscriber computes nothing without need.
        """
        if grid is None or grid.anchor_us is None:
            self._confined_to, self.on_sample = (1, 0), self._all
        else:
            self._confined_to, self.on_sample = (grid.period_us, grid.anchor_us), self._confined

    def replay(self, samples: Iterable[Sample], from_us: int, now_us: int) -> list[Sample]:
        """The samples of this stream until now, had it been there from `from_us` on; timers included."""
        if self._owed is not None:
            self._owed.listen(max(from_us, now_us - MAX_REPLAYED * self._period_us))
        found: list[Sample] = []
        for sample in samples:
            found += self._until(sample.available_us - 1)
            found += self.on_sample(sample, sample.available_us)
        return found + self._until(now_us - 1)  # at one instant inputs are first

    def _until(self, now_us: int) -> list[Sample]:
        found: list[Sample] = []
        while (due_us := self.deadline_us) is not None and due_us <= now_us:
            found += self.on_time(due_us)
        return found

    def _confined(self, sample: Sample, now_us: int) -> list[Sample]:
        return self._on_grid(self._all(sample, now_us))

    def _on_grid(self, samples: list[Sample]) -> list[Sample]:
        period_us, anchor_us = self._confined_to
        return samples if period_us == 1 else [each for each in samples if (each.valid_us - anchor_us) % period_us == 0]

    @property
    def deadline_us(self) -> int | None:
        """Next instant at which `on_time` has work, or None."""
        return None if self._owed is None else self._owed.deadline_us

    def continued(self, policy: Policy) -> "PolicyAdapter":
        """The rest of this stream under another policy: order, counts and, where it has none of its own, the grid."""
        after = PolicyAdapter(policy)
        after._last, after._previous, after._before = self._last, self._previous, self._before
        starving = ("_hungry_us", "_in_vain", "_patience_us") if after._period_us == self._period_us else ()
        for name in ("gaps", *_REASONS, *starving):
            setattr(after, name, getattr(self, name))
        if after._anchor_us is None:
            after._anchor_us = self._anchor_us
        if self._owed is not None and after._owed is not None:
            after._owed.take_over(self._owed)
        return after

    @property
    def grid(self) -> Grid | None:
        """The valid times that can come through; None: any."""
        return Grid(self._period_us, self._anchor_us) if self._period_us else None

    @property
    def settling(self) -> bool:
        """Whether only its first sample says where its grid lies."""
        return self._period_us > 0 and self._anchor_us is None

    @property
    def is_fresh(self) -> bool:
        """Whether it gives what another of its policy would from now on: it has passed and owes nothing."""
        began = self._last or self._previous or self._before
        return began is None and self._owed is None and self._confined_to[0] == 1

    @property
    def is_open(self) -> bool:
        """Whether every sample passes as it is."""
        return self._is_unrestricted and self._confined_to[0] == 1

    @property
    def needed(self) -> Grid | None:
        """Only samples on this grid, which has an anchor, make a difference to the output; None: all do."""
        policy = self.policy
        if policy.approximation != "none" or policy.predict_us is not None:
            return None
        if self._period_us:
            return None if self._anchor_us is None else self.grid
        if policy.change != "any update" or policy.order != "any" or self._confined_to[0] == 1:
            return None
        return Grid(*self._confined_to)

    @property
    def dropped(self) -> Counter[str]:
        """Samples that did not come through, by reason."""
        counts = {reason: getattr(self, name) for name, reason in _REASONS.items()}
        counts["overflow"] = self._owed.upcoming.refused if self._owed else 0
        return Counter({reason: count for reason, count in counts.items() if count})

    def _good(self, sample: Sample, now_us: int) -> list[Sample]:
        """Treat an uncertain sample as if it had not come."""
        quality = sample.quality
        if quality.certainty < self._least_certainty or quality.deviation > self._most_deviation:
            self._uncertain += 1
            return self.on_time(now_us - 1)
        if quality.prediction is not None and sample.available_us - quality.prediction.made_us > self._oldest_us:
            self._too_old += 1
            return self.on_time(now_us - 1)
        return self._take(sample, now_us)

    def _ahead(self, sample: Sample, now_us: int) -> list[Sample]:
        """In place of a sample the one that is predicted from it and the one before."""
        made = sample.quality.prediction
        if made is not None and sample.valid_us > sample.available_us:
            return self._beyond(sample, now_us)
        before = self._before
        if before is not None and sample.valid_us <= before.valid_us:
            self._out_of_order += 1
            return self.on_time(now_us - 1)
        self._before = sample
        if before is None:
            return self.on_time(now_us - 1)
        valid_us = sample.valid_us + (self.policy.predict_us or 0)
        value = interpolate(before, sample, valid_us)
        if value is NO_VALUE:
            self._unpredictable += 1
            return self.on_time(now_us - 1)
        quality = between(before, sample, valid_us)._replace(prediction=made or Predicted(sample.valid_us))
        return self._beyond(Sample(sample.available_us, valid_us, value, quality), now_us)

    def _exact(self, sample: Sample, now_us: int) -> list[Sample]:
        valid_us = sample.valid_us
        if not self._from_us <= valid_us <= self._to_us:
            self._outside += 1
            return []
        if now_us - valid_us > self._max_delay_us:
            self._late += 1
            return []
        period_us, last = self._period_us, self._last
        if period_us:
            if self._anchor_us is None:
                self._anchor_us = valid_us
            elif (valid_us - self._anchor_us) % period_us:
                self._off_grid += 1
                if valid_us - (self._hungry_us if last is None else last.valid_us) > self._patience_us:
                    self._starve(valid_us)
                return []
        if last is not None:
            step_us = valid_us - last.valid_us
            if period_us and step_us > period_us:
                self.gaps += 1
            if step_us < self._least_step_us:
                self._out_of_order += 1
                return []
            if self._changes and step_us == 0 and sample.value == last.value:
                self._no_change += 1
                return []
        if sample.available_us < now_us or (last is not None and sample.available_us <= last.available_us):
            earliest_us = now_us if last is None else max(now_us, last.available_us + 1)
            sample = Sample(max(earliest_us, sample.available_us), valid_us, sample.value, sample.quality)
        self._last = sample
        return [sample]

    def _starve(self, valid_us: int) -> None:
        """One more sample lies off the grid although nothing on it has come for long."""
        if self._hungry_us == -_EVER_US and self._last is None:
            self._hungry_us = valid_us
            return
        self._in_vain += 1
        if self._in_vain == STARVED:
            self._patience_us = 2 * _EVER_US
            self.on_starved()

    def _linear(self, sample: Sample, now_us: int) -> list[Sample]:
        previous, valid_us = self._previous, sample.valid_us
        if self._anchor_us is None:
            self._anchor_us = valid_us
        if previous is not None and valid_us <= previous.valid_us:
            self._out_of_order += 1
            return []
        self._previous = sample
        found: list[Sample] = []
        period_us, anchor_us = self._period_us, self._anchor_us
        available_us = max(now_us, sample.available_us)  # not before its inputs (P4)
        if previous is not None:
            first_us = max(
                previous.valid_us + 1, self._from_us, now_us - self._max_delay_us, valid_us - CATCH_UP * period_us
            )
            for grid_us in range(
                first_us + (anchor_us - first_us) % period_us, min(valid_us, self._to_us + 1), period_us
            ):
                value = interpolate(previous, sample, grid_us)
                if value is not NO_VALUE:
                    quality = between(previous, sample, grid_us)
                    found += self._exact(Sample(available_us, grid_us, value, quality), now_us)
        if (valid_us - anchor_us) % period_us == 0:
            found += self._exact(sample, now_us)
        return found

    def _most_recent(self, sample: Sample, now_us: int) -> list[Sample]:
        owed = self._owed
        assert owed is not None  # noqa: S101  (this method is bound only where there is one)
        found = self._settle(
            owed, now_us, now_us - 1
        )  # samples due before this one came; at one instant inputs are first
        valid_us = sample.valid_us
        if not self._from_us <= valid_us <= self._to_us:
            self._outside += 1
        elif (valid_us - self._from_us) % self._period_us:
            self._off_grid += 1
        elif valid_us < owed.next_us:
            self._late += now_us - valid_us > self._max_delay_us
            self._out_of_order += now_us - valid_us <= self._max_delay_us
        if sample.available_us < now_us:
            sample = sample._replace(available_us=now_us)
        owed.upcoming.add(sample, owed.next_us)  # also a dropped one is news about the points after it
        return found + self._settle(owed, now_us, now_us - 1)

    def _settle(self, owed: "_Owed", now_us: int, clock_us: int) -> list[Sample]:
        """Deliver the grid points that are known, or due at `clock_us`, up to the first that is neither."""
        owed.catch_up(now_us)
        found: list[Sample] = []
        while (sample := owed.settled(clock_us)) is not None:
            last = self._last
            if last is not None:
                self.gaps += sample.valid_us - last.valid_us > self._period_us
                if sample.available_us <= last.available_us:
                    sample = sample._replace(available_us=last.available_us + 1)
            self._last = sample
            found.append(sample)
            owed.advance()
        return found


class _Owed:
    """The grid points for which a stream that uses the most recent value still owes a sample."""

    __slots__ = ("delay_us", "listening", "next_us", "period_us", "to_us", "upcoming")

    def __init__(self, from_us: int, to_us: int, period_us: int, delay_us: int) -> None:
        self.next_us, self.to_us, self.period_us, self.delay_us = from_us, to_us, period_us, delay_us
        self.upcoming = Upcoming()
        self.listening = False

    @property
    def deadline_us(self) -> int | None:
        return self.next_us + self.delay_us if self.next_us <= self.to_us else None

    def settled(self, clock_us: int) -> Sample | None:
        """The sample of the next point, once it is exact or its time is over; then it is available."""
        if self.next_us > self.to_us:
            return None
        best = self.upcoming.best
        if best is not None and best.valid_us == self.next_us:
            return best
        due_us = self.next_us + self.delay_us
        if due_us > clock_us:
            return None
        value, quality = (NO_VALUE, SURE) if best is None else (best.value, best.quality)
        return Sample(due_us, self.next_us, value, quality)

    def advance(self, points: int = 1) -> None:
        self.next_us += points * self.period_us
        self.upcoming.advance(self.next_us)

    def take_over(self, before: "_Owed") -> None:
        """Continue where another ended, with its state."""
        self.upcoming, self.listening = before.upcoming, before.listening
        behind_us = before.next_us - self.next_us
        if behind_us > 0:
            self.advance(-(-behind_us // self.period_us))

    def listen(self, now_us: int) -> None:
        """There is a listener from now on."""
        if not self.listening:
            self.catch_up(now_us)

    def catch_up(self, now_us: int) -> None:
        """Skip what was due before there was a listener, and all but the last points after a long silence of the caller."""
        behind = -((self.next_us + self.delay_us - now_us) // self.period_us)  # points due before now
        spared = CATCH_UP if self.listening else 0
        self.listening = True
        if behind > spared:
            self.advance(behind - spared)


def _ignore() -> None:
    """Report nothing."""
