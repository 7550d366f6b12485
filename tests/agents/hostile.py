"""A member with a valid key that says anything: samples, recovered samples, answers, heartbeats and descriptions.

What it says is well-formed and drawn from a seed: numbers at the borders of their ranges, texts of every kind. It is
put before the platforms as if the wire had brought it.
"""

from collections import Counter
from collections.abc import Iterator
from math import inf, nan
from random import Random
from typing import Any

from dyknow import Policy
from dyknow.agents.admission.admission import Admission
from dyknow.agents.exchange.import_proxy import ImportProxy
from dyknow.agents.platform import Platform
from dyknow.federation import keys
from dyknow.federation.messages import codec, contents
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.contents import Content
from dyknow.federation.messages.descriptions import (
    ConditionEntry,
    DefinitionEntry,
    Description,
    LabelEntry,
    ServiceEntry,
)
from dyknow.federation.messages.sexpr import Expr
from dyknow.federation.messages.unpacking import pack
from dyknow.federation.security.trust import Trust
from dyknow.federation.transport import Answered, Arrived
from dyknow.model.errors import DyknowError
from dyknow.model.sample import Predicted, Quality
from dyknow.model.values import Sort
from dyknow.sim_uavs.world.world import World

POLICY, HASH = Policy(), "ab12cd34"
FINITE = (0.0, -0.0, 1.0, -1.0, 0.5, 90.0, -90.0, 180.0, 360.0, 58.0, 15.0, 100.0, 1e5, 1e9, 1e15, 1e154, 1e155, 1e303, 1.7e308, -1.7e308, 1e-300, 5e-324)  # fmt: skip
NUMBERS = (*FINITE, inf, -inf, nan)
WHOLE = (0, 1, -1, 2, 255, 2**31, 2**53, 2**62, 2**63 - 1, -(2**63))
TEXTS = ("", "a", "co1", "co2", "p1", "0", "1", "2", "cc", "red", "passes", "overtake", "car", "0 1 2", "é" * 40, "x" * 200, "auto", "lost", "newest")  # fmt: skip


def heads() -> dict[str, type[Content]]:
    """Every content there is."""
    contents.prepare()
    found: dict[str, type[Content]] = {}
    todo = [Content]
    while todo:
        for kind in todo.pop().__subclasses__():
            todo.append(kind)
            if isinstance(getattr(kind, "head", None), str):
                found[kind.head] = kind
    return found


class HostileMember:
    """Speaks as `unit` to the platforms `victims` of a world in which `unit` is a platform, too.

    Attributes:
        said: how many messages of each sort were taken to be genuine, or at least read.
    """

    def __init__(self, world: World, rng: Random, unit: str, victims: tuple[str, ...], trust: Trust | None) -> None:
        self.world, self.rng, self.unit, self.victims = world, rng, unit, victims
        self._signer, self._seq, self._heads = None if trust is None else trust.signer, 10**6, heads()
        self.said: Counter[str] = Counter()
        self._beats, self._version = 10**6, 10**6
        self.begin()

    def begin(self) -> None:
        """Its process is there: it answers no act, since that is done here, and will stream every label there is."""
        platform = self.world.platform(self.unit)
        requests: list[Act] = platform.ports.agent.requests
        platform.part(Admission)._admit_all = lambda _now_us: requests.clear()  # type: ignore[method-assign]
        for victim, _ in tuple(self._platforms()):
            self.announce(victim)

    def _platforms(self) -> Iterator[tuple[str, Platform]]:
        for victim in self.victims:
            node = self.world.nodes[victim]
            if node.platform is not None and not node.frozen:
                yield victim, node.platform

    def _reach(self, victim: str, make: type, *given: Any) -> None:
        node = self.world.nodes[victim]
        node_us = node.clock.node_us(self.world.now_us)
        fields = {"at_us": node_us}
        self.world._reach(node, make(*given[:-1], **fields, payload=given[-1]))
        self.said[make.__name__] += 1

    @property
    def boot(self) -> int:
        process = self.world.nodes[self.unit].process
        return 1 if process is None else process.member.boot

    def announce(self, victim: str) -> None:
        """It will stream every label there is."""
        platform = self.world.platform(victim)
        now_us = self.world.nodes[victim].clock.node_us(self.world.now_us)
        for name in platform.config.ontology:
            platform.part(ImportProxy).expect(self.unit, name, HASH, POLICY, now_us)

    # -- what it says ------------------------------------------------------------------------------------------

    def speak(self) -> None:
        """Something, to each."""
        rare = self.rng.random()
        if rare < 0.01:
            for victim, _ in tuple(self._platforms()):
                self.announce(victim)
        say = self.rng.choice(
            (self.sample, self.sample, self.sample, self.recovered, self.beat, self.describe, self.answer)
        )
        for victim, platform in tuple(self._platforms()):
            say(victim, platform)

    def _seldom(self, wild: tuple[Any, ...], usual: Any) -> Any:
        return self.rng.choice(wild) if self.rng.random() < 0.02 else usual

    def value(self, sort: Sort) -> Any:
        """Of that sort, as far as a check of sorts sees."""
        rng = self.rng
        wild = rng.random() < 0.3
        now_s = self.world.now_us / 1e6

        def one(name: str, unit: str) -> Any:
            if unit == "text":
                return rng.choice(TEXTS)
            if unit == "bool":
                return rng.random() < 0.2
            if name.endswith("_s") and unit == "s" and rng.random() < 0.6:
                return now_s - rng.uniform(0.0, 30.0)
            return rng.choice(NUMBERS if wild else FINITE) if rng.random() < 0.4 else rng.uniform(-50.0, 50.0)

        if not sort.fields:
            return one("", sort.unit)
        return tuple(one(each.name, each.unit) for each in sort.fields)

    def _samples(self, sort: Sort) -> list[codec.StreamSample]:
        rng, now_us = self.rng, self.world.now_us
        found = []
        for _ in range(rng.choice((1, 1, 2, 5))):
            self._seq += rng.choice((1, 1, 1, 3))
            valid_us = now_us + rng.choice((0, 0, 0, -100_000, 1, -(10**9), 59_000_000, 10**9, 2**62))
            quality = Quality()
            if rng.random() < 0.3:
                covariance = rng.choice(((), ((1.0,),), ((nan, 0.0), (0.0, 1.0)), ((1e308, 0.0), (0.0, 1e308)), ((-1.0, 2.0), (2.0, -1.0))))  # fmt: skip
                made = Predicted(now_us + rng.choice((0, -(10**9), 2**61))) if rng.random() < 0.3 else None
                quality = Quality(rng.choice((0.0, 0.5, 1.0)), covariance, made)
            found.append(codec.StreamSample(self._seq, valid_us, self.value(sort), quality))
        return found

    def sample(self, victim: str, platform: Platform) -> None:
        """Samples of one of the streams that are imported from it, and of others that ride along."""
        imported = [name for name in platform.member.imports.streams if name[0] == self.unit]
        if not imported:
            return
        name = self.rng.choice(imported)
        riders = [
            codec.Rider(label, policy, self._samples(platform.config.ontology[label].sort))
            for _, label, policy in self.rng.sample(imported, min(len(imported), self.rng.choice((0, 0, 2))))
        ]
        boot = self.boot + self._seldom((1, -1, 2**40), 0)
        try:
            samples = self._samples(platform.config.ontology[name[1]].sort)
            payload = codec.encode_samples(boot, samples, riders=riders, every=self.rng.choice((1, 1, 1, 2, 50)))
        except (DyknowError, OverflowError, ValueError, TypeError):
            return
        self._reach(victim, Arrived, keys.stream(*name), payload)

    def recovered(self, victim: str, platform: Platform) -> None:
        """An answer to a question for missing samples, or for a clock, or for a description."""
        member, rng = platform.member, self.rng
        asked = list(member.imports._asked.items())
        if asked and rng.random() < 0.7:
            question, record = rng.choice(asked)
            stream = record.stream
            samples = self._samples(platform.config.ontology[stream.label].sort)
            answer = codec.Recovered(
                self.boot, rng.choice((1, 10**6, 2**62)), rng.choice((1, self._seq, 2**62)), samples
            )
            self._reach(
                victim, Answered, question, keys.history(self.unit, stream.label), codec.encode_recovered(answer)
            )
        else:
            payload = rng.choice((b"", pack(rng.choice(WHOLE)), pack((1, *rng.sample(WHOLE, 4)))))
            self._reach(victim, Answered, rng.randint(1, 400), keys.clock(self.unit), payload)

    def beat(self, victim: str, platform: Platform) -> None:
        """A heartbeat."""
        del platform
        rng = self.rng
        self._beats += 1
        tails = tuple(
            (rng.choice((*TEXTS[1:3], "battery", "object-tracks")), HASH, rng.choice(WHOLE))
            for _ in range(rng.choice((0, 1, 60)))
        )
        found = codec.Heartbeat(
            self.unit, self.boot + self._seldom((1, 2**40), 0), self._seldom(WHOLE, self._beats), rng.choice((self.world.now_us, 0, 2**62)),
            self._seldom((0, 1, 2**62), self._version), tuple(rng.choice(("0", "1", "9", "cc")) for _ in range(rng.choice((0, 2, 50)))), tails,
        )  # fmt: skip
        self._reach(victim, Arrived, keys.heartbeat(self.unit), codec.encode_heartbeat(found))

    def describe(self, victim: str, platform: Platform) -> None:
        """A description that is announced."""
        rng, names = self.rng, tuple(platform.config.ontology)
        self._version += 1
        text = rng.choice(("x", "follows car1", "avoidance off: é", "y" * 200))
        try:
            found = Description(
                unit=self.unit,
                boot=self.boot,
                version=self._seldom((1, 2**62), self._version),
                kind=self._seldom(("command-centre",), "uav"),
                clock_epoch_us=self._seldom((2**60,), platform.clock.epoch_us),
                clock_speed=self._seldom((1e-300, 1e6), platform.clock.speed),
                roster=None if platform.config.trust is None else platform.config.trust.roster.fingerprint,
                services=tuple(
                    ServiceEntry(agent="federation", service=name, visibility="protected")
                    for name in rng.sample(("dyknow-federation", "flight", "monitor-coordination", "x"), 3)
                ),
                labels=tuple(
                    LabelEntry(label=name, sort=platform.config.ontology[name].sort.name, type_hash=self._seldom(("0" * 8,), platform.config.ontology[name].type_hash), period_us=rng.choice((0, 1, 100_000, 2**60)))
                    for name in rng.sample(names, self._seldom((0, 1, 5), len(names)))
                ),
                conditions=(ConditionEntry(text=text, since_us=rng.choice((0, 2**62))),),
                definitions=tuple(
                    DefinitionEntry(label=name, sort="x", unit=rng.choice(("", "m")), meaning="x")
                    for name in rng.sample(("x-y", "object-tracks", "battery"), self._seldom((1, 2), 0))
                ),
            )  # fmt: skip
        except ValueError:
            return
        self._reach(victim, Arrived, keys.announcement(self.unit), codec.encode_description(found))

    def answer(self, victim: str, platform: Platform) -> None:
        """An act in a conversation that the victim has opened with it."""
        asked = [
            each.opening
            for each in platform.member.acts.conversations.conversations()
            if each.ours and each.peer == self.unit
        ]
        if not asked:
            return
        opening, rng = self.rng.choice(asked), self.rng
        self._seq += 1
        act = Act(
            rng.choice((Performative.AGREE, Performative.INFORM, Performative.INFORM, Performative.REFUSE, Performative.FAILURE, Performative.PROPOSE, Performative.NOT_UNDERSTOOD)),
            AgentName("interface", self.unit), AgentName("interface", victim), self._content(platform), opening.conversation_id,
            opening.protocol, in_reply_to=opening.reply_with, ontology="dyknow", boot=self.boot, seq=self._seq,
            created_us=self.world.now_us,
        )  # fmt: skip
        try:
            payload = codec.encode_act(act, self._signer)
        except (DyknowError, OverflowError, ValueError, TypeError):
            return
        self._reach(victim, Arrived, act.key, payload)

    def _content(self, platform: Platform) -> Expr | None:
        rng = self.rng
        kind = self._heads[rng.choice((*self._heads, *("done", "reason", "samples", "found", "progress") * 8))]
        for _ in range(30):
            given = {
                field.alias or name: self._field(field.alias or name, platform)
                for name, field in kind.model_fields.items()
                if field.is_required() or rng.random() < 0.5
            }
            try:
                return contents.read(Expr(kind.head, given)).expr()
            except (DyknowError, ValueError, TypeError, OverflowError):
                continue
        return None

    def _field(self, name: str, platform: Platform) -> Any:
        rng = self.rng
        if "label" in name:
            return rng.choice(tuple(platform.config.ontology))
        if name == "samples":
            sort = platform.config.ontology[rng.choice(tuple(platform.config.ontology))].sort
            now_us = self.world.now_us
            return (Expr("sample", {"valid": now_us, "available": now_us, "value": self.value(sort)}),)
        pick = rng.random()
        if pick < 0.35:
            return rng.choice(TEXTS)
        if pick < 0.5:
            return tuple(rng.sample(TEXTS, 2))
        if pick < 0.6:
            return rng.random() < 0.5
        if pick < 0.8:
            return rng.choice((*WHOLE, self.world.now_us))
        return rng.choice(NUMBERS)
