"""Figures of an instance as streams: `stream_delay[speed_car1]` and so on, one sample every 100 ms (10.7).

The object is the name of a declared stream, or the label of a generator with its objects after hyphens, `pos-car1` for
`pos[car1]`; of delays also `worst`, the longest of all generators. Nothing is computed without demand.
"""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from dyknow import NO_VALUE, Generator, History, Label, Network, Sample, Sort, Value
from dyknow.kpl.checking.symbols import MARGIN
from dyknow.kpl.running.formula_monitors import FormulaMonitor
from dyknow.kpl.running.margins import MarginStream, has_margins
from dyknow.model.instants import US_PER_MS, US_PER_S
from dyknow.network.mediation import Failover
from dyknow.network.process import Process
from dyknow.network.processes import OnDemand
from dyknow.network.stream_proxy import StreamProxy

PERIOD_US: Final = 100 * US_PER_MS
WORST: Final = "worst"
MEANINGS: Final[Mapping[str, str]] = {
    "stream_delay": "ms between the valid time and the available time of what came last, or by which what comes regularly is overdue",
    "stream_rate": "samples per second, of the last samples",
    "stream_drops": "samples that a declared stream's policy has dropped, all in all",
    "stream_memory": "bytes of the history, about",
    "producer": "of a stream that is `first of` several: which of them it is from",
    MARGIN: "of a monitor: by how much values would have to change for its formula to be violated, or kept",
}
LAST = 32
"""Samples from which the rate and delay of a stream are computed."""
REGULAR: Final = 4
"""Gaps between samples that show whether they come regularly: the longest is at most twice the shortest."""
SAMPLE_BYTES = 250
"""Size of a sample of a few numbers in a history, about."""
SORT: Final = Sort("figure")


class InstanceFigures(NamedTuple):
    """The figures of one instance: of the streams it declares, of its generators, and of its monitors."""

    network: Network
    streams: Mapping[str, StreamProxy]
    monitors: Mapping[str, FormulaMonitor]

    def find(self, label: Label) -> tuple[Sort, Process] | None:
        """The process of a figure, or None."""
        if label.feature not in MEANINGS or len(label.objects) != 1:
            return None
        if label.feature == MARGIN:
            monitor = self.monitors.get(label.objects[0])
            return (
                None if monitor is None or not has_margins(monitor.monitor.formula) else (SORT, MarginStream(monitor))
            )
        return SORT, Figure(self, label)


class Figure(OnDemand):
    """One figure, looked at when a point of its grid has come."""

    def __init__(self, figures: InstanceFigures, label: Label) -> None:
        super().__init__()
        self._figures, self._name = figures, label.objects[0]
        looks: dict[str, Callable[[], Value]] = {
            "stream_delay": self._delay_ms,
            "stream_rate": self._rate_hz,
            "stream_drops": self._drops,
            "stream_memory": self._memory_bytes,
            "producer": self._producer,
        }
        self._look = looks[label.feature]
        self._due_us = 0

    def begin(self) -> None:
        if self._network is not None:
            self._due_us = -(-self._network.now_us // PERIOD_US) * PERIOD_US
            self._network.step(self)

    def since_us(self) -> int:
        """There was no reader before."""
        return self._due_us if self.running else self._figures.network.now_us

    def on_time(self, now_us: int) -> None:
        point_us = now_us // PERIOD_US * PERIOD_US
        if point_us >= self._due_us:
            self._due_us = point_us + PERIOD_US
            self.emit(Sample(now_us, point_us, self._look()))

    @property
    def deadline_us(self) -> int | None:
        return self._due_us if self.running else None

    def _generator_of(self) -> Generator | None:
        network = self._figures.network
        proxy = self._figures.streams.get(self._name)
        if proxy is not None:
            return network.generator(proxy.label) if network.has(proxy.label) else None
        return next((network.generator(label) for label in network.labels() if flat(label) == self._name), None)

    def _delay_ms(self) -> Value:
        if self._name == WORST:
            network = self._figures.network
            generators = [network.generator(label) for label in network.labels() if label.feature not in MEANINGS]
        else:
            found = self._generator_of()
            if found is None:
                return NO_VALUE
            return _last_us(found.history, self._due_us - PERIOD_US) / US_PER_MS
        since_us = self._due_us - 2 * PERIOD_US
        return max((_longest_us(generator, since_us) for generator in generators), default=0) / US_PER_MS

    def _rate_hz(self) -> Value:
        generator = self._generator_of()
        rate_hz = None if generator is None else rate_and_delay(generator.history)[0]
        return NO_VALUE if rate_hz is None else rate_hz

    def _drops(self) -> Value:
        proxy = self._figures.streams.get(self._name)
        return NO_VALUE if proxy is None else sum(proxy.adapter.dropped.values())

    def _memory_bytes(self) -> Value:
        generator = self._generator_of()
        return NO_VALUE if generator is None else generator.history.get_size() * SAMPLE_BYTES

    def _producer(self) -> Value:
        generator = self._generator_of()
        made_by = None if generator is None else self._figures.network.process(generator.label)
        return NO_VALUE if not isinstance(made_by, Failover) or made_by.producer is None else str(made_by.producer)


def _last_us(history: History, now_us: int) -> int:
    """The longest delay in the last 100 ms, or of the last sample; of an overdue stream, the least it is overdue."""
    held = min(history.get_size(), LAST)
    if not held:
        return 0
    last = history.get_nth_latest(0)
    since_us = min(now_us - PERIOD_US, last.available_us - 1)
    newest = [each for n in range(held) if (each := history.get_nth_latest(n)).available_us > since_us]
    gaps_us = [
        history.get_nth_latest(n).available_us - history.get_nth_latest(n + 1).available_us for n in range(held - 1)
    ]
    is_regular = len(gaps_us) >= REGULAR and 0 < max(gaps_us) <= 2 * min(gaps_us)
    overdue_us = now_us - last.available_us - max(gaps_us) if is_regular else 0
    return max(*(each.delay_us for each in newest), overdue_us)


def _longest_us(generator: Generator, since_us: int) -> int:
    """The longest delay of what became available since then, among the last samples."""
    longest_us, history = 0, generator.history
    for n in range(min(history.get_size(), LAST)):
        sample = history.get_nth_latest(n)
        if sample.available_us <= since_us:
            break
        longest_us = max(longest_us, sample.delay_us)
    return longest_us


def flat(label: Label) -> str:
    """A label as the name of an object."""
    return "-".join((label.feature.replace(".", "-"), *label.objects))


def rate_and_delay(history: History) -> tuple[float | None, float | None]:
    """Samples per second, and the mean delay in microseconds, of the last samples."""
    held = min(history.get_size(), LAST)
    if held == 0:
        return None, None
    last: list[Sample] = history.get_slice(history.get_size() - held, history.get_size() - 1)
    span_us = last[-1].available_us - last[0].available_us
    rate_hz = (held - 1) * US_PER_S / span_us if span_us > 0 else None
    return rate_hz, sum(sample.delay_us for sample in last) / held
