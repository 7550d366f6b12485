"""Floods of all that a member or a stranger can send: refused by quota, nothing grows without end, monitors and answers go on."""

import gc
import os
import tracemalloc
from collections.abc import Callable
from random import Random
from typing import Any

import pytest

from dyknow.agents.exchange.import_proxy import STREAMS_OF_ONE, ImportProxy
from dyknow.federation import keys
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.beats import MAX_TAILS
from dyknow.federation.messages.codec import (
    Heartbeat,
    StreamSample,
    encode_act,
    encode_description,
    encode_heartbeat,
    encode_samples,
)
from dyknow.federation.messages.contents import (
    Alarm,
    CheckFormula,
    Content,
    MonitorProximity,
    Query,
    Reason,
    Search,
    Stream,
    read,
)
from dyknow.federation.messages.descriptions import Description, LabelEntry
from dyknow.federation.security.trust import Trust
from dyknow.federation.transport import DeclareToken, Put, Urgency
from tests.agents.rosters import trust
from tests.box import Box, Vehicle

P = Performative
FULL = os.environ.get("DYKNOW_FULL") == "1"
ROUNDS = 4000 if FULL else 30
MOST_BYTES = 50 << 20 if FULL else 4 << 20
PAUSE_S = 0.01


class Flooder:
    """Member 2, or a stranger: a session of its own, and a key of the roster or none."""

    def __init__(self, box: Box, random: Random, trust: Trust | None) -> None:
        self.box, self.random, self.trust = box, random, trust
        self.unit = "2" if trust is not None else "n1"
        self.boot, self.seq, self.zid, self.beats = box.now_us // 1000, 0, "abcdef", 0
        box.wire.open("flood", self.zid, lambda _event: None, lambda: box.now_us)
        box.wire.perform("flood", DeclareToken(keys.token_platform(self.zid, self.unit, "uav", 1)))

    def put(self, key: str, payload: bytes) -> None:
        self.box.wire.put("flood", Put(key, payload, Urgency.ACT))

    def beat(self, tails: tuple[Any, ...] = (), version: int = 1) -> None:
        self.beats += 1
        hears = ("0", "1", "cc")
        beat = Heartbeat(self.unit, self.boot, self.beats, self.box.now_us, version, hears, tails)
        self.put(keys.heartbeat(self.unit), encode_heartbeat(beat))

    def say(self, performative: Performative, content: Content, conversation: str | None = None) -> None:
        self.seq += 1
        act = Act(
            performative,
            AgentName("interface", self.unit),
            AgentName("interface", "0"),
            content.expr(),
            conversation or f"{self.unit}-{self.boot:x}-{self.seq}",
            "fipa-request",
            reply_with=f"r{self.seq}",
            reply_by_us=self.box.now_us + 2_000_000,
            ontology="dyknow",
            boot=self.boot,
            seq=self.seq,
            created_us=self.box.now_us,
        )
        self.put(act.key, encode_act(act, None if self.trust is None else self.trust.signer))

    def word(self) -> str:
        return "x" + "".join(self.random.choices("abcdefgh", k=12))

    # -- what is sent again and again ----------------------------------------------------------------------------

    def acts(self, _task: str) -> None:
        self.say(P.QUERY_REF, Search(service=self.word()))
        self.say(P.QUERY_REF, Query(semantic_label="heli-position"))

    def tails(self, _task: str) -> None:
        self.beat(tuple((f"{self.word()}-{number}", "ab12cd34", number) for number in range(MAX_TAILS)))

    def descriptions(self, _task: str) -> None:
        labels = tuple(LabelEntry(label=f"{self.word()}-{n}", sort="x", type_hash="0" * 8) for n in range(120))
        found = Description(
            unit=self.unit, boot=self.boot, version=self.beats + 2, kind="uav", labels=labels, roster=self.roster
        )  # fmt: skip
        self.beat(version=self.beats + 2)
        self.put(keys.announcement(self.unit), encode_description(found))

    @property
    def roster(self) -> str | None:
        return None if self.trust is None else self.trust.roster.fingerprint

    def streams(self, _task: str) -> None:
        period = self.random.randrange(1, 10_000)
        policy = f"from 0, sample every {period}, max delay 100"
        labels = ("heli-position", "heli-altitude", "heli-velocity", "battery")
        hashed = f"{self.random.getrandbits(32):08x}"
        self.say(P.INFORM, Stream(owner=self.unit, semantic_labels=labels, policy=policy, hash=hashed))

    def labels(self, _task: str) -> None:
        sample = StreamSample(self.beats + 1, self.box.now_us, 1.0)
        self.put(keys.stream(self.unit, self.word(), "ab12cd34"), encode_samples(self.boot, [sample] * 20))

    def alarms(self, task: str) -> None:
        number = self.seq
        self.say(
            P.INFORM,
            Alarm(id=f"{self.unit}/{number}", event="opened", monitor="proximity", by=self.unit, units=(self.unit, "0"), valid_us=number, detected_us=number + 1),
            task,
        )  # fmt: skip

    def formulas(self, _task: str) -> None:
        text = " and ".join(f"heli-altitude[self] > {self.random.randrange(10**6)}" for _ in range(240))
        self.say(P.QUERY_IF, CheckFormula(text=text))

    def names(self, _task: str) -> None:
        for _ in range(5):
            name = self.random.choice(["n", "cc-"]) + str(self.random.randrange(10**6))
            self.put(keys.heartbeat(name), encode_heartbeat(Heartbeat(name, 5, 1, self.box.now_us, 1)))


KINDS: tuple[Callable[[Flooder, str], None], ...] = (
    Flooder.acts,
    Flooder.tails,
    Flooder.descriptions,
    Flooder.streams,
    Flooder.labels,
    Flooder.alarms,
    Flooder.formulas,
    Flooder.names,
)


@pytest.mark.parametrize("who", ["member", "stranger"])
def test_a_flood_is_refused_and_the_others_go_on(who: str) -> None:
    box = Box(23)
    for unit in ("0", "1"):
        box.join(unit, Vehicle(east_m=500.0 * int(unit)), trust=trust(unit), control=True)
    box.centre("cc", trust=trust("cc"))
    box.run(2)
    flooder = Flooder(box, Random(23), trust("2") if who == "member" else None)
    for _ in range(10):
        flooder.beat()
        box.run(0.2)
    task = box.asked("cc", "0", MonitorProximity())
    box.run(4)
    refused: dict[str, set[str]] = {}
    tracemalloc.start(1)
    try:
        for kind in KINDS:
            flooder.beat()
            box.run(2)
            box.wire.log.clear()
            gc.collect()
            before, _ = tracemalloc.get_traced_memory()
            for number in range(ROUNDS):
                kind(flooder, task.conversation)
                if number % 20 == 0:
                    flooder.beat()
                box.run(PAUSE_S)
            refused[kind.__name__] = codes(box, flooder.unit)
            box.wire.log.clear()
            gc.collect()
            after, _ = tracemalloc.get_traced_memory()
            assert after - before <= MOST_BYTES, (kind.__name__, (after - before) >> 10)
            check_honest(box)
    finally:
        tracemalloc.stop()
    proxy = box.platform("0").part(ImportProxy)
    if who == "member":
        assert refused["acts"] >= {"too-many-acts"}
        assert refused["formulas"] >= {"too-much-text"}
        assert sum(name[0] == "2" for name in proxy.imports.streams) <= STREAMS_OF_ONE
        assert not FULL or proxy.refused["too many streams"]
    else:
        assert not any(refused.values()), "what is not signed is not answered"
        assert not any(name[0] == flooder.unit for name in proxy.imports.streams)


def codes(box: Box, unit: str) -> set[str]:
    """Of the refusals that 0 has answered."""
    said = (
        read(act.content) for act in box.acts("0", unit) if act.performative is P.REFUSE and act.content is not None
    )
    return {content.code for content in said if isinstance(content, Reason) and content.code}


def check_honest(box: Box) -> None:
    """The monitors of 0 and 1 are decided by samples of now, a query of the centre is answered, and the directory is right."""
    question = box.asked("cc", "0", Query(semantic_label="heli-position"), P.QUERY_REF)
    assert question.performatives == [P.INFORM]
    for unit, other in (("0", "1"), ("1", "0")):
        member = box.member(unit)
        assert member.directory.is_present(other)
        assert len(member.directory._peers) <= 3 + 64
        streams = member.imports.streams
        newest = [one.heard_us for name, one in streams.items() if name[:2] == (other, "heli-position")]
        assert newest
        assert max(newest) >= box.now_us - 500_000
        assert len(streams) <= 200
