"""Streams that conditions of links read, each taken on demand: by their values at the time of a state.

The value of a stream is its newest one at that time. It counts for `LASTS_US`, or twice as long as lies between two of its
samples if that is longer: a stream that is silent is not known to hold. An event belongs to the first state that is not
earlier, or is still to be made.
"""

from collections import deque
from collections.abc import Callable
from typing import Final

from dyknow import NO_VALUE, US_PER_S, Label, Policy, Sample, Value
from dyknow.model.errors import SortError, TextError
from dyknow.model.members import members_of
from dyknow.network.network import Network
from dyknow.network.stream_proxy import StreamProxy
from dyknow.reasoning.features.derived_streams import MAX_DELAY_US, PERIOD_US, DerivedStream, stream_of

LASTS_US: Final = PERIOD_US + MAX_DELAY_US
UNUSED_US: Final = 10 * US_PER_S
"""A stream that was not asked for so long is taken no more."""
MOST_STREAMS: Final = 4096
_KEPT: Final = 64
_DERIVED: Final = Policy(change="sample", sample_us=PERIOD_US, from_us=0, exact=True, max_delay_us=MAX_DELAY_US)


class _TakenStream:
    """The newest samples of one stream."""

    def __init__(self) -> None:
        self.samples: deque[tuple[int, Value]] = deque(maxlen=_KEPT)
        self.events_us: deque[int] = deque(maxlen=_KEPT)
        self.asked_us = 0
        self.proxy: StreamProxy | None = None

    def value(self, valid_us: int) -> Value:
        before_us: int | None = None
        for i in range(len(self.samples) - 1, -1, -1):
            at_us, value = self.samples[i]
            if at_us <= valid_us:
                before_us = self.samples[i - 1][0] if i else None
                lasts_us = LASTS_US if before_us is None else max(LASTS_US, 2 * (at_us - before_us))
                return value if valid_us - at_us <= lasts_us else NO_VALUE
        return NO_VALUE


class TakenStreams:
    """The streams that the conditions of one linkage read.

    Args:
        label: of a stream, with the unit in place of `self`.
        fault: called with what goes wrong.
    """

    def __init__(self, label: Callable[[Label], Label], fault: Callable[[str], None]) -> None:
        self._label, self._fault = label, fault
        self._network: Network | None = None
        self._taken: dict[Label, _TakenStream] = {}
        self._tick_us: int | None = None
        self._before_us: int | None = None
        self._swept_us = 0
        self._is_full = False

    def begin(self, network: Network | None) -> None:
        """States come from now on."""
        self.end()
        self._network = network

    def end(self) -> None:
        """Take no stream."""
        taken, self._taken, self._network = self._taken, {}, None
        self._tick_us = self._before_us = None
        self._is_full = False
        for each in taken.values():
            if each.proxy is not None:
                each.proxy.cancel()

    @property
    def labels(self) -> tuple[Label, ...]:
        """The streams that are taken now."""
        return tuple(self._taken)

    def value(self, label: Label, valid_us: int) -> Value:
        """The value of a stream in the state of a time."""
        taken = self._asked(label, valid_us)
        return NO_VALUE if taken is None else taken.value(valid_us)

    def members(self, domain: str) -> tuple[str, ...]:
        """The objects that a stream names."""
        taken = self._asked(Label.parse(domain), self._tick_us or 0)
        if taken is None or not taken.samples:
            return ()
        try:
            return members_of(taken.samples[-1][1])
        except SortError as wrong:
            self._fault(f"{domain}: {wrong}")
            return ()

    def has_occurred(self, label: Label, after_us: int | None, valid_us: int) -> bool:
        """Whether an event belongs to the state of a time; without a state before it, whether it came since the last tick."""
        taken = self._asked(label, valid_us)
        after_us = self._before_us if after_us is None else after_us
        return taken is not None and any(
            (after_us is None or after_us < at_us) and at_us <= valid_us for at_us in taken.events_us
        )

    def _asked(self, label: Label, valid_us: int) -> _TakenStream | None:
        """A stream, which is taken from now on; None: there are too many."""
        if self._tick_us is None or valid_us > self._tick_us:
            self._before_us, self._tick_us = self._tick_us, valid_us
            self._sweep(valid_us)
        label = self._label(label)
        taken = self._taken.get(label)
        if taken is None:
            if len(self._taken) >= MOST_STREAMS:
                if not self._is_full:
                    self._fault(
                        f"conditions speak of more than {MOST_STREAMS} streams at once: the others have no value"
                    )
                self._is_full = True
                return None
            taken = self._take(label)
        taken.asked_us = valid_us
        return taken

    def _take(self, label: Label) -> _TakenStream:
        taken = self._taken[label] = _TakenStream()
        network = self._network
        if network is None:
            return taken

        def on_sample(sample: Sample) -> None:
            taken.samples.append((sample.valid_us, sample.value))
            is_over = self._tick_us is not None and sample.valid_us <= self._tick_us
            taken.events_us.append(self._tick_us + 1 if is_over and self._tick_us is not None else sample.valid_us)

        try:
            stream = stream_of(network, label)
            network.find(stream)
            policy = _DERIVED if isinstance(network.process(stream), DerivedStream) else Policy()
            taken.proxy = network.connect(stream, policy, on_sample, current=True)
        except TextError as wrong:
            self._fault(f"{label}: {wrong.message}")
        else:
            taken.events_us.clear()  # samples from before are no events
        return taken

    def _sweep(self, valid_us: int) -> None:
        """Leave what was not asked for long ago."""
        if valid_us - self._swept_us < UNUSED_US:
            return
        self._swept_us = valid_us
        for label, each in list(self._taken.items()):
            if valid_us - each.asked_us > UNUSED_US:
                del self._taken[label]
                if each.proxy is not None:
                    each.proxy.cancel()
