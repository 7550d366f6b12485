"""A map that each platform makes for itself of shared streams: the base of the maps of tracks and of persons."""

from collections.abc import Callable, Iterable, Mapping
from typing import ClassVar

from dyknow import Label, Policy, Sample, Value
from dyknow.agents.exchange.label_agreements import LabelAgreements
from dyknow.agents.exchange.local_instance import LocalInstance
from dyknow.agents.exchange.partners import Partners
from dyknow.agents.exchange.subscription_keeper import SubscriptionKeeper
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.messages.descriptions import LabelEntry
from dyknow.network.stream_proxy import StreamProxy

_LIVES = 1000


class SharedMap(Part):
    """The base of such a map: it has the labels, subscribes to the sources here and on other platforms, and checks receivers.

    Attributes:
        own: the label whose samples on this platform are taken.
        shared: the label that platforms share: its receivers may see the streams that are made of it.
        shown: the label of the map, a stream while it has subscribers.
        made: the labels of the streams that this platform makes of it.
        partners: the platforms whose streams are asked for.
    """

    own: ClassVar[str]
    shared: ClassVar[str]
    shown: ClassVar[str]
    made: ClassVar[tuple[str, ...]]

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._boot, self._agent, self._network = ports.unit, ports.boot, ports.agent, ports.network
        self._translation, self._directory = ports.translation, ports.directory
        self._agreements = parts[LabelAgreements]
        self._labels = {name: ports.translation.local_label(name, ports.unit) for name in (self.own, *self.made)}
        self.partners = Partners(ports.network, parts[LocalInstance], parts[SubscriptionKeeper], self._on_sample)
        self._taken: StreamProxy | None = None
        self._due_us: int | None = None
        self._on_map = set[str]()
        ports.network.meet(self._on_label)

    def _on_label(self, label: Label) -> None:
        """The stream `own` of this platform is there."""
        if label == self._labels[self.own] and self._taken is None:
            self._due_us = 0

    def _take(self, on_sample: Callable[[Sample], None]) -> bool:
        """Subscribe to the stream `own` of this platform; False if it is subscribed already, or is not there."""
        if self._taken is not None or not self._network.has(self._labels[self.own]):
            return False
        consumer = self._translation.to_semantic(self.own).into(on_sample)
        self._taken = self._network.connect(self._labels[self.own], Policy(), consumer, self._on_link)
        return True

    def _on_link(self, linked: bool) -> None:
        if not linked and self._taken is not None:
            self._taken.cancel()
            self._taken = None
            self._on_end()

    def _on_end(self) -> None:
        """The stream `own` of this platform is gone."""

    def _on_sample(self, unit: str, label: str, sample: Sample) -> None:
        raise NotImplementedError

    def _first_number(self, names_a_life: int) -> int:
        """Numbers for names of this life of the platform: other lives name otherwise."""
        return self._boot // 1000 % _LIVES * names_a_life + 1

    def _add(self, names: Iterable[str]) -> bool:
        """Have these streams; False if they are there."""
        new = [name for name in names if not self._network.has(self._labels[name])]
        for name in new:
            self._network.add_source(self._labels[name], self._translation.local_sort(name))
        return bool(new)

    def labels(self) -> Iterable[LabelEntry]:
        """The streams of this platform that are there."""
        ontology = self._translation.ontology
        return [ontology.entry(name) for name in self.made if self._network.has(self._labels[name])]

    def _push(self, name: str, valid_us: int, value: Value, now_us: int) -> None:
        sample = Sample(now_us, valid_us, value)
        self._network.push(self._labels[name], self._translation.to_local(name).sample(sample))

    def _show(
        self,
        rows: Callable[[], Mapping[str, tuple[int, Value]]],
        ended: Callable[[str], Value],
        end_us: int,
        now_us: int,
    ) -> None:
        """Push the map as a stream: a value and its valid time by name; names that are gone end at `end_us`."""
        label = self._labels[self.shown]
        if not self._network.has(label) or not self._network.generator(label).subscriptions:
            return
        found = rows()
        with self._network.instant.whole():
            for valid_us, value in found.values():
                self._push(self.shown, valid_us, value, now_us)
            for name in self._on_map - found.keys():
                self._push(self.shown, end_us, ended(name), now_us)
        self._on_map = set(found)

    def _hidden(self, units: Iterable[str], requester: str) -> set[str]:
        """The platforms that share with named others, not with the requester: nothing of theirs is handed on."""
        return {unit for unit in units if not self._may_hand_on(unit, requester)}

    def _may_hand_on(self, unit: str, requester: str) -> bool:
        entry = self._directory.entry(unit)
        named = next((each.receivers for each in (entry.labels if entry else ()) if each.label == self.shared), ())
        return not named or requester in named
