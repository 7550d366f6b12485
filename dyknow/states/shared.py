"""Many state streams over one time grid that have inputs in common: shared inputs are kept once and looked at once.

Every pair that a platform watches needs the platform's own position. Where all inputs are sampled with the period of
the states and only exact values count, the algorithm of thesis 7.8.2 comes down to this: a state is ready as soon as
each of its inputs has brought a sample valid at or after the synchronisation point, at the latest `max_delay_us` after
it. So it is enough to know up to when all the shared inputs are known, and all those of one strand. The output equals
that of a `Synchronizer` for each stream.
"""

from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import Generic, NamedTuple, TypeVar

from dyknow.model.errors import PolicyError
from dyknow.model.sample import Sample, Value
from dyknow.model.values import NO_VALUE
from dyknow.states.synchronization import CATCH_UP

_NEVER_US = 2**80
_new = tuple.__new__  # makes a NamedTuple in half the time

K = TypeVar("K", bound=Hashable)


class _Side:
    """The samples of some inputs.

    Attributes:
        known_us: all of them are known up to here.
        rows: their values by valid time.
    """

    __slots__ = ("known_us", "latest_us", "rows")

    def __init__(self, inputs: int) -> None:
        self.latest_us = [-_NEVER_US] * inputs
        self.known_us = -_NEVER_US if inputs else _NEVER_US
        self.rows: dict[int, list[Value]] = {}

    def add(self, i: int, sample: Sample, period_us: int, from_us: int) -> bool:
        """Keep a sample that can matter from `from_us` on; whether more is known by it of all inputs together."""
        valid_us, latest_us = sample.valid_us, self.latest_us
        if valid_us >= from_us:
            row = self.rows.get(valid_us)
            if row is None:
                row = self.rows[valid_us] = [NO_VALUE] * len(latest_us)
            row[i] = sample.value
        if valid_us <= latest_us[i]:
            return False
        latest_us[i] = valid_us
        known_us = min(latest_us) + period_us - 1
        if known_us <= self.known_us:
            return False
        self.known_us = known_us
        return True

    def forget(self, before_us: int) -> None:
        rows = self.rows
        for valid_us in [valid_us for valid_us in rows if valid_us < before_us]:
            del rows[valid_us]


class Strand(Generic[K]):
    """One of the state streams: its own inputs, and how far it is. Made by `SharedSynchronizer.add`.

    Attributes:
        blind_us: by shared input, the last valid time that came before this stream was there.
        hidden_us: the greatest of them; beyond it the shared inputs are as everybody sees them.
        step_us: distance of its states: the period, or a multiple of it while there is too much to do.
    """

    __slots__ = ("blind_us", "hidden_us", "key", "side", "step_us", "sync_us")

    def __init__(self, key: K, inputs: int, blind_us: Sequence[int], step_us: int) -> None:
        self.key, self.side, self.step_us = key, _Side(inputs), step_us
        self.sync_us = _NEVER_US
        self.blind_us = tuple(blind_us)
        self.hidden_us = max(blind_us, default=-_NEVER_US)


class SharedState(NamedTuple, Generic[K]):
    """A state of one of the streams: its values are those of the shared inputs, then those of its own."""

    key: K
    valid_us: int
    values: list[Value]


class SharedSynchronizer(Generic[K]):
    """Computes the states of many streams; see the module. Every sample must lie on the grid, a multiple of the period, and
    those of a shared input must be in strict order, as its policy has them.

    Call `on_shared` and `on_own` as samples arrive and `on_time` at `deadline_us`. At one instant inputs come before
    timers. The states of each stream leave in order of valid time.

    Args:
        shared: how many inputs all streams have in common.
        period_us: distance of the synchronisation points. A stream begins with the first sample after it was added.
        max_delay_us: a state is computed at the latest this long after its valid time.
        on_begin: called when a stream begins: only then `deadline_us` may have become earlier.

    Attributes:
        deadline_us: when `on_time` has work next, or somewhat earlier; None: nothing waits.
        refused: samples too far ahead: valid more than `CATCH_UP` periods from now.
        skipped: points without a state: due before the first sample, or more than `CATCH_UP` behind.

    Raises:
        PolicyError: the period is not positive, or the delay negative.
    """

    def __init__(
        self, shared: int, period_us: int, max_delay_us: int, on_begin: Callable[[], None] = lambda: None
    ) -> None:
        if period_us <= 0 or max_delay_us < 0:
            raise PolicyError(f"states every {period_us} us with a delay of {max_delay_us} us cannot be computed")
        self._period_us, self._max_delay_us = period_us, max_delay_us
        self._lead_us, self._on_begin = CATCH_UP * period_us, on_begin
        self._shared = _Side(shared)
        self._strands: dict[K, Strand[K]] = {}
        self._idle: dict[K, Strand[K]] = {}
        self._least_us = _NEVER_US  # no synchronisation point is before this
        self._hidden_us = -_NEVER_US  # beyond this the shared inputs are the same for all
        self.deadline_us: int | None = None
        self.refused = self.skipped = 0

    def __len__(self) -> int:
        return len(self._strands)

    def add(self, key: K, inputs: int) -> Strand[K]:
        """One more stream, with `inputs` inputs of its own. Earlier samples are not for it."""
        strand = self._strands[key] = self._idle[key] = Strand(key, inputs, self._shared.latest_us, self._period_us)
        self._hidden_us = max(self._hidden_us, strand.hidden_us)
        return strand

    def remove(self, key: K) -> None:
        """A stream ends."""
        del self._strands[key]
        self._idle.pop(key, None)

    def thin(self, strand: Strand[K], every: int) -> None:
        """From now on `strand` has states at each `every`-th synchronisation point only, since its inputs come so."""
        strand.step_us = every * self._period_us
        if strand.sync_us != _NEVER_US and strand.sync_us not in strand.side.rows:
            strand.sync_us = -(-strand.sync_us // strand.step_us) * strand.step_us

    def on_shared(self, i: int, sample: Sample, now_us: int) -> list[SharedState[K]]:
        """A sample of shared input `i` became available at `now_us`; the states that are ready by it."""
        if not self._is_near(sample, now_us):
            return []
        found = self._on_timers(now_us, now_us - 1)
        for strand in list(self._idle.values()):
            self._begin(strand, sample, now_us)
        shared = self._shared
        if shared.add(i, sample, self._period_us, self._least_us) or self._least_us <= self._hidden_us:
            known_us = shared.known_us
            for strand in self._strands.values():
                if strand.side.known_us >= strand.sync_us <= known_us:
                    self._settle(strand, now_us - 1, found)
        return found

    def on_own(self, strand: Strand[K], i: int, sample: Sample, now_us: int) -> list[SharedState[K]]:
        """A sample of input `i` of one stream became available at `now_us`; the states that are ready by it."""
        found: list[SharedState[K]] = []
        if sample.valid_us > now_us + self._lead_us and not self._is_near(sample, now_us):
            return found
        if strand.sync_us == _NEVER_US:
            self._begin(strand, sample, now_us)
        elif strand.sync_us + self._max_delay_us < now_us:
            self._catch_up(strand, now_us, now_us - 1, found)
        if strand.side.add(i, sample, self._period_us, strand.sync_us):
            self._settle(strand, now_us - 1, found)
        return found

    def on_time(self, now_us: int) -> list[SharedState[K]]:
        """The states that are due at `now_us`; more often than at `deadline_us` is harmless."""
        return self._on_timers(now_us, now_us)

    def _on_timers(self, now_us: int, clock_us: int) -> list[SharedState[K]]:
        found: list[SharedState[K]] = []
        due_us = clock_us - self._max_delay_us
        if due_us >= self._least_us:
            for strand in self._strands.values():
                if strand.sync_us <= due_us:
                    self._catch_up(strand, now_us, clock_us, found)
            self._await(min([strand.sync_us for strand in self._strands.values()], default=_NEVER_US))
            self._shared.forget(self._least_us)
        return found

    def _is_near(self, sample: Sample, now_us: int) -> bool:
        """One sample from the far future would say that all before it is known."""
        if sample.valid_us <= now_us + self._lead_us:
            return True
        self.refused += 1
        return False

    def _begin(self, strand: Strand[K], sample: Sample, now_us: int) -> None:
        """Begin with the first sample; states due by then had no listener."""
        del self._idle[strand.key]
        strand.sync_us = -(-sample.valid_us // strand.step_us) * strand.step_us
        self._skip(strand, now_us, 0)
        self._await(min(self._least_us, strand.sync_us))
        self._on_begin()

    def _await(self, least_us: int) -> None:
        self._least_us = least_us
        self.deadline_us = None if least_us == _NEVER_US else least_us + self._max_delay_us

    def _catch_up(self, strand: Strand[K], now_us: int, clock_us: int, found: list[SharedState[K]]) -> None:
        """After a silence of the caller only the last points get states."""
        self._skip(strand, now_us, CATCH_UP)
        self._settle(strand, clock_us, found)

    def _skip(self, strand: Strand[K], now_us: int, spared: int) -> None:
        overdue = -((strand.sync_us + self._max_delay_us - now_us) // strand.step_us)
        if overdue > spared:
            self.skipped += overdue - spared
            strand.sync_us += (overdue - spared) * strand.step_us
            strand.side.forget(strand.sync_us)

    def _settle(self, strand: Strand[K], clock_us: int, found: list[SharedState[K]]) -> None:
        """Put out what is ready when every timer up to `clock_us` has gone off."""
        side, sync_us, due_us = strand.side, strand.sync_us, clock_us - self._max_delay_us
        known_us, step_us = min(side.known_us, self._shared.known_us), strand.step_us
        while sync_us <= due_us or (sync_us <= known_us and (sync_us > strand.hidden_us or self._has_seen(strand))):
            found.append(_new(SharedState, (strand.key, sync_us, self._values(strand, sync_us))))
            sync_us = strand.sync_us = (sync_us // step_us + 1) * step_us
            if step_us != self._period_us:
                side.forget(sync_us)

    def _has_seen(self, strand: Strand[K]) -> bool:
        """Whether each shared input has brought a sample for this strand."""
        shared = self._shared
        return all(last_us > blind_us for last_us, blind_us in zip(shared.latest_us, strand.blind_us, strict=True))

    def _values(self, strand: Strand[K], sync_us: int) -> list[Value]:
        shared: Iterable[Value] = self._shared.rows.get(sync_us) or [NO_VALUE] * len(self._shared.latest_us)
        if sync_us <= strand.hidden_us:
            shared = [
                NO_VALUE if sync_us <= blind_us else value
                for value, blind_us in zip(shared, strand.blind_us, strict=True)
            ]
        own = strand.side.rows.pop(sync_us, None) or [NO_VALUE] * len(strand.side.latest_us)
        return [*shared, *own]
