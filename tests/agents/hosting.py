"""A platform's instance and its hosts in one process: what one says the other hears when the test lets it."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from dyknow import Label, Network, Prototype, Sample, SourcePrototype
from dyknow.agents.effects import DropHost, HostCame, HostEffect, HostLeft, HostMessage, TellHost
from dyknow.agents.hosts.host_desk import HostDesk
from dyknow.agents.hosts.knowledge_host import KnowledgeHost, Read
from dyknow.agents.hosts.outbox import Outbox
from dyknow.federation.hosts.codec import decode_from_platform
from dyknow.federation.hosts.messages import End, Refuse, Welcome
from dyknow.federation.members.clock import FederationClock
from dyknow.kpl import Hooks, Instance, parse_specification


@dataclass
class Guest:
    """One host and its connection."""

    number: int
    host: KnowledgeHost
    outbox: Outbox = field(default_factory=Outbox)
    welcomed: list[Welcome] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    read: dict[int, SourcePrototype] = field(default_factory=dict)
    heard: list[object] = field(default_factory=list)
    is_there: bool = True
    is_frozen: bool = False
    unheard: list[bytes] = field(default_factory=list)

    def hear(self, payloads: Iterable[bytes]) -> None:
        self.unheard += payloads
        if self.is_frozen:
            return
        payloads, self.unheard = self.unheard, []
        for payload in payloads:
            message = decode_from_platform(payload)
            self.heard.append(message)
            for step in self.host.on_message(message):
                match step:
                    case Welcome():
                        self.welcomed.append(step)
                    case Refuse(reason):
                        self.refused.append(reason)
                    case Read(process, source):
                        self.read[process] = source
                    case End(process):
                        self.read.pop(process, None)
                    case _ if hasattr(step, "said"):
                        self.outbox.put(step)

    def work(self, now_us: int) -> None:
        while (said := self.host.work(now_us)) is not None:
            for each in said:
                self.outbox.put(each)


class Site:
    """An instance that runs a specification, the desk, and what clients get and are told."""

    def __init__(self, text: str = "") -> None:
        self.now_us = 1_000_000
        self.samples: dict[str, list[Sample]] = {}
        self.links: dict[str, list[bool]] = {}
        self.faults: list[tuple[Label, str]] = []
        self.notes: list[str] = []
        self.network = Network()
        hooks = Hooks(
            lambda name, sample: self.samples.setdefault(name, []).append(sample),
            lambda name, linked: self.links.setdefault(name, []).append(linked),
            on_fault=lambda label, said: self.faults.append((label, said)),
        )
        self.instance = Instance(self.network, hooks=hooks)
        self.desk = HostDesk(self.instance, FederationClock(), self.notes.append)
        self.guests: dict[int, Guest] = {}
        self.declare(text)

    def declare(self, text: str) -> None:
        self.instance.change(parse_specification(text), self.now_us, text)

    def open(self, *prototypes: Prototype, batch: int = 1, train: bool = False, module: str = "units.py") -> Guest:
        """A host connects and registers."""
        number = len(self.guests) + 1
        guest = self.guests[number] = Guest(number, KnowledgeHost(prototypes, 4711, module, batch=batch, train=train))
        self.desk.on_event(HostCame(self.now_us, number), self.now_us)
        guest.outbox.put(guest.host.registration())
        self.settle()
        return guest

    def leave(self, guest: Guest) -> None:
        guest.is_there = False
        self.desk.on_event(HostLeft(self.now_us, guest.number), self.now_us)
        self.settle()

    def push(self, source: str, *valid_us: int, settle: bool = True) -> None:
        """A source has samples, each its own valid time."""
        for each in valid_us:
            self.now_us = max(self.now_us, each)
            self.instance.push(source, Sample(self.now_us, each, float(each)))
        if settle:
            self.settle()

    def made(self, guest: Guest, process: int, sample: Sample) -> None:
        """A source that the host reads has a sample."""
        for message in guest.host.on_reading(process, (sample,)):
            guest.outbox.put(message)
        self.settle()

    def settle(self) -> None:
        """Until nobody has anything to say."""
        busy = True
        while busy:
            busy = self.perform(self.desk.flush())
            for guest in tuple(self.guests.values()):
                if guest.is_frozen or not guest.is_there:
                    continue
                guest.hear(())
                guest.work(self.now_us)
                for payload in guest.outbox.take():
                    busy = True
                    self.desk.on_event(HostMessage(self.now_us, guest.number, payload), self.now_us)

    def perform(self, effects: Iterable[HostEffect]) -> bool:
        told = False
        for effect in effects:
            guest = self.guests[effect.host]
            match effect:
                case TellHost(_, payloads) if guest.is_there:
                    told = True
                    guest.hear(payloads)
                case DropHost():
                    guest.is_there = False
                    self.desk.on_event(HostLeft(self.now_us, guest.number), self.now_us)
        return told

    def wait(self, span_us: int, *, beating: Iterable[Guest] = ()) -> None:
        """Time passes; these say that they live."""
        until_us = self.now_us + span_us
        while self.now_us < until_us:
            self.now_us = min(until_us, self.now_us + 250_000)
            for guest in beating:
                self.beat(guest)
            due_us = self.desk.deadline_us
            if due_us is not None and due_us <= self.now_us:
                self.desk.on_time(self.now_us)
            self.settle()

    def beat(self, guest: Guest) -> None:
        from dyknow.federation.hosts.codec import encode
        from dyknow.federation.hosts.messages import Beat

        self.desk.on_event(HostMessage(self.now_us, guest.number, encode(Beat(0))), self.now_us)
        self.settle()

    def values(self, name: str) -> list[object]:
        return [sample.value for sample in self.samples.get(name, ())]
