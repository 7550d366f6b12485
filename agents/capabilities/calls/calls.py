"""The calls of this platform: a stream that its specification calls for is of the platform whose proposal was taken.

A call is out while its stream has subscribers here; samples of the platform in use are passed on, and the next platform
takes its place under the same label. Times are the node clock, but for valid times.
"""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Final

from dyknow import Label, Policy, Sample
from dyknow.agents.admission.trusted import PlatformTrust
from dyknow.agents.effects import Tell
from dyknow.agents.exchange.imported import Imported, converting
from dyknow.agents.exchange.local_instance import LocalInstance
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.calls.call import StreamCall
from dyknow.federation.calls.kept_record import KeptRecord, Unkept
from dyknow.federation.calls.proposals import CallNews, WantedStream
from dyknow.federation.messages.descriptions import ConditionEntry
from dyknow.network.generator import Consumer
from dyknow.network.process import Input
from dyknow.network.stream_proxy import StreamProxy

PERIOD_US: Final = 100_000
MAX_DELAY_US: Final = 1_000_000
KEPT: Final = 600
SHOWN: Final = 4


class CalledStream:
    """One stream that is called for, and where it comes from now."""

    def __init__(self, wanted: WantedStream, begin: Callable[["CalledStream"], StreamCall], take: Consumer) -> None:
        self.wanted, self._begin, self._take = wanted, begin, take
        self.call: StreamCall | None = None
        self.subscription: StreamProxy | None = None
        self.since_us: int | None = None

    def need(self, wanted: bool, now_us: Callable[[], int]) -> None:
        """Begin the call when the stream gets subscribers here, end it when it has none."""
        if wanted and self.call is None:
            self.call = self._begin(self)
        elif not wanted and self.call is not None:
            self.call.end(now_us())
            self.call = self.since_us = None
            self.listen(None)

    def listen(self, subscription: StreamProxy | None) -> None:
        """From this subscription it comes from now on."""
        if self.subscription is not None:
            self.subscription.cancel()
        self.subscription = subscription

    def on_sample(self, unit: str, sample: Sample, now_us: int) -> None:
        """Pass on a sample that is as promised."""
        if self.call is not None and self.call.on_sample(unit, sample.quality.certainty, sample.delay_us, now_us):
            self._take(sample)


class Calls(Part):
    """See the module.

    Args:
        local: declares the streams of other units.
        now_us: the node clock of the present step.
        offer: tells the directory that conditions have changed, at a time.
    """

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._agent, self._directory = ports.unit, ports.agent, ports.directory
        self._network = ports.network
        self._translation, self._clock, self._local = ports.translation, ports.clock, parts[LocalInstance]
        self._now_us = ports.now_us
        self._trust = parts[PlatformTrust]
        self._offer, self._note, self._emit = ports.offer, ports.note, ports.emit
        self._streams: list[CalledStream] = []
        self._record, self._unkept = KeptRecord(), tuple[Unkept, ...]()
        ports.call = self.stream

    def stream(self, semantic: str, label: Label, policy: Policy) -> Callable[[], None]:
        """Call for a label while its stream has subscribers; returns how to take it back."""
        network, translation = self._network, self._translation
        delay_us = MAX_DELAY_US if policy.max_delay_us is None else policy.max_delay_us
        wanted = WantedStream(semantic, policy.sample_us or PERIOD_US, delay_us, policy.min_certainty or 0.0)
        raw = Label(f"called-{label.feature}", label.objects)
        source = network.add_source(raw, translation.local_sort(semantic), KEPT)

        called = CalledStream(wanted, self._begin, source.push)
        sort = translation.ontology[semantic].sort
        unit = converting(sort, translation.to_semantic(semantic))
        network.add_process(label, sort, Imported(unit, Input(raw, policy), partial(called.need, now_us=self._now_us)))
        self._streams.append(called)

        def undo() -> None:
            network.remove(label)
            called.need(False, self._now_us)
            network.remove(raw)
            self._streams.remove(called)

        return undo

    def _begin(self, called: CalledStream) -> StreamCall:
        call = StreamCall(
            called.wanted, self._unit, self._agent.acts, self._directory, partial(self._on_news, called),
            self._clock.speed, self._trust.found, self._trust.declared, self._record,
        )  # fmt: skip
        call.begin(self._now_us())
        return call

    def _on_news(self, called: CalledStream, news: CallNews) -> None:
        label, unit = news.label, news.unit
        if news.event == "taken":
            local, _ = self._local.source(label, unit)

            def take(sample: Sample) -> None:
                called.on_sample(unit, sample, self._now_us())

            called.listen(self._network.connect(local, Policy(), take))
        elif news.event == "failed":
            called.listen(None)
        is_open = news.event == "open"
        if is_open or (news.event == "taken" and called.since_us is not None):
            called.since_us = news.at_us if is_open else None
            self._offer(news.at_us)
        self._emit(Tell({"event": "call", "what": news.event, "label": label, "unit": unit, "text": news.text}))
        if news.event in {"taken", "failed", "open"}:
            self._note(f"call for {label}: {news.event}{f' {unit}' if unit else ''}: {news.text}")

    def conditions(self) -> Iterable[ConditionEntry]:
        """Platforms that break their proposals, and calls without a producer."""
        unkept = [ConditionEntry(text=each.text, since_us=each.since_us) for each in self._unkept]
        waiting = [
            ConditionEntry(text=f"call for {each.wanted}: no platform produces it", since_us=each.since_us)
            for each in self._streams
            if each.since_us is not None
        ]
        return (*unkept[:SHOWN], *waiting[:SHOWN])

    @property
    def deadline_us(self) -> int | None:
        due = [each.call.deadline_us for each in self._streams if each.call is not None]
        due += [each.until_us for each in self._unkept]
        return min((us for us in due if us is not None), default=None)

    def on_time(self, now_us: int) -> None:
        for each in self._streams:
            if each.call is not None:
                each.call.on_time(now_us)
        self._look(now_us)

    def _look(self, now_us: int) -> None:
        """Show the platforms that break their proposals."""
        unkept = tuple(self._record.shown(now_us))
        texts, before = ([each.text for each in these] for these in (unkept, self._unkept))
        self._unkept = unkept
        if texts != before:
            for text in texts:
                if text not in before:
                    self._note(f"calls: {text}")
            self._offer(now_us)
