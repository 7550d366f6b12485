"""What strangers and members forge or repeat, drawn from seeds: nothing is accepted, nothing is done twice, all is counted."""

import os
from collections import Counter
from random import Random
from typing import Any

import pytest

from dyknow.agents.capabilities.flight.flight import FlightAgent
from dyknow.agents.platform import Platform
from dyknow.federation import keys
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.codec import (
    Heartbeat,
    Pong,
    StreamSample,
    decode_act,
    encode_act,
    encode_heartbeat,
    encode_pong,
    encode_samples,
)
from dyknow.federation.messages.contents import (
    AddDeclarations,
    Cancel,
    Content,
    CreateMonitor,
    Goto,
    HandOver,
    Hold,
    MonitorProximity,
    Query,
)
from dyknow.federation.messages.receipts import Receipt, encode_receipt, receipt_key
from dyknow.federation.security.trust import MAX_AGE_US, OFFSET_US, Signer, Trust, Verifier
from dyknow.federation.transport import Answered, Arrived
from tests.agents.rosters import trust
from tests.box import EPOCH, Box, Vehicle

P = Performative
FULL = os.environ.get("DYKNOW_FULL") == "1"
FORGED = [
    pytest.param(1, 4_000, id="short"),
    pytest.param(2, 1_000_000, id="bar", marks=[pytest.mark.full, pytest.mark.timeout(3600)]),
]
REPLAYED = [pytest.param(1, 5_000, id="short"), pytest.param(2, 100_000, id="bar", marks=pytest.mark.full)]
BETWEEN = 50
"""How many are forged before the world goes on for a hundredth of a second."""
CONTENTS: tuple[Content, ...] = (
    Hold(), Goto(latitude_deg=58.0, longitude_deg=15.0, altitude_m=90.0), MonitorProximity(), Cancel(),
    AddDeclarations(text="monitor low = always heli-height.height_m[self] > 5"),
    CreateMonitor(name="proximity", task="cc-1", coordinator="1", generation=2),
    HandOver(task="cc-1", coordinator="1", boot=1, generation=9), Query(semantic_label="heli-position"),
)  # fmt: skip
LIES_US = (0, 1, -1, 10**6, -(10**6), 3_600_000_000, -3_600_000_000, 2**60, -(2**60))
DAY_US = 86_400_000_000


@pytest.fixture
def signed(wire: Box) -> Box:
    return members(wire)


def members(wire: Box) -> Box:
    """0 and 1 fly 3 km apart; cc has delegated monitoring; each act is signed."""
    for unit in "01":
        wire.join(unit, Vehicle(north_m=3000.0 * int(unit)), control=True, trust=trust(unit))
    wire.centre("cc", trust=trust("cc"))
    wire.run(2.0)
    wire.asked("cc", "0", MonitorProximity())
    wire.run(2.0)
    return wire


def forget_streams(box: Box) -> None:
    """What is kept of the wire is acts alone: it would fill the memory."""
    box.wire.log[:] = [crossed for crossed in box.wire.log if crossed.put.key.startswith("acl/")]


class Forger:
    """Has heard what the members say, and no key but that of member 1 and one of its own."""

    def __init__(self, box: Box, rng: Random) -> None:
        self._box, self._rng = box, rng
        self._heard = [
            crossed.put
            for crossed in box.wire.log
            if crossed.put.key.startswith("acl/0/") and not crossed.put.key.endswith("/receipt")
        ]
        self._seq = 10**6
        self._member, self._stranger = trust("1").signer, Signer(bytes(range(32)), "default")
        self._elsewhere = Signer(bytes(range(1, 33)), "other")

    def act(self) -> Arrived:
        """An act to 0 that its sender never made."""
        if self._rng.random() < 0.3:
            return self._changed()
        self._seq += 1
        rng, now_us = self._rng, self._box.now_us
        sender = rng.choice(["cc", "cc", "cc-77", "1", "2", "9"])
        act = Act(
            rng.choice(list(P)), AgentName("interface", sender), AgentName("interface", "0"), rng.choice(CONTENTS).expr(),
            rng.choice(["cc-1-1", f"{sender}-1-{self._seq}"]), "fipa-request", reply_by_us=now_us + 2_000_000, ontology="dyknow",
            boot=rng.choice([1, EPOCH, self._box.member("cc").boot]), seq=rng.choice([1, 2, self._seq]),
            created_us=now_us + rng.choice([0, -1000, -(10**9)]),
        )  # fmt: skip
        signers = [None, self._stranger, self._elsewhere]
        signer = rng.choice(signers if sender == "1" else [*signers, self._member])
        return Arrived(act.key, now_us, encode_act(act) if signer is None else encode_act(act, signer))

    def _changed(self) -> Arrived:
        """A genuine act of which one bit is not what was signed."""
        put = self._rng.choice(self._heard)
        payload = bytearray(put.payload)
        payload[self._rng.randrange(len(payload))] ^= 1 << self._rng.randrange(8)
        return Arrived(put.key, self._box.now_us, bytes(payload))

    def receipt(self) -> Arrived:
        """Says that acts of 0 have arrived which have not."""
        boot, seqs = self._box.member("0").boot, self._rng.sample(range(1, 400), 20)
        payload = encode_receipt(Receipt(self._rng.choice([boot, boot - 1, 1]), seqs))
        return Arrived(receipt_key("0", self._rng.choice(["1", "cc", "9"])), self._box.now_us, payload)

    def pong(self) -> Answered:
        """What the clock of 1 is said to be, in answer to a question that may have been asked."""
        rng, now_us = self._rng, self._box.now_us
        lie_us = now_us + rng.choice([10**5, -(10**6), 10**9])
        payload = encode_pong(Pong(self._box.member("1").boot, now_us - rng.randrange(1, 10**5), lie_us, lie_us))
        return Answered(rng.randrange(10**6, 10**7), keys.clock("1"), now_us, payload)

    def heartbeat(self) -> Arrived:
        """Under a key that is another's."""
        by, named = self._rng.sample(["1", "cc", "9", "0"], 2)
        beat = Heartbeat(named, 2**50, self._rng.randrange(2**40), self._box.now_us, 9, (), ())
        return Arrived(keys.heartbeat(by), self._box.now_us, encode_heartbeat(beat))

    def sample(self) -> Arrived:
        """Of a stream that its owner has not offered, or that no other may have."""
        label, owner = self._rng.choice(["heli-position", "battery"]), self._rng.choice(["0", "9", "cc", "1"])
        entry = StreamSample(self._rng.randrange(1, 2**40), self._box.now_us, {"x": 1e303})
        payload = encode_samples(self._box.member("1").boot, [entry])
        return Arrived(keys.stream(owner, label, f"{self._rng.getrandbits(32):08x}"), self._box.now_us, payload)

    def anything(self) -> tuple[str, Any]:
        """A sort and one of it, acts in half of all cases."""
        sort = self._rng.choice(["act"] * 4 + ["receipt", "pong", "heartbeat", "sample"])
        return sort, getattr(self, sort)()


def kept(platform: Platform) -> object:
    """What an accepted act or sample would have changed."""
    monitors = {name: sorted(one.instances) for name, one in platform.built.monitors.named.items()}
    return (
        [(task.name, task.conversation, task.initiator) for task in platform.built.tasks.all()], monitors, set(platform.ports.network.labels()),
        sorted(platform.built.gateway.importer.imports.streams), platform.part(FlightAgent).pilot.flying,
    )  # fmt: skip


@pytest.mark.parametrize(("seed", "count"), FORGED)
def test_nothing_that_is_forged_is_accepted_and_each_act_of_it_is_counted(signed: Box, seed: int, count: int) -> None:
    platform = signed.platform("0")
    forger, before, given = Forger(signed, Random(seed)), kept(platform), Counter[str]()
    log, beats = platform.ports.agent.audit_log, platform.member.directory
    refused, dropped = Counter(log.refused), platform.refused.copy()
    accepted = trust_of(platform).verifier.accepted
    for at in range(count):
        sort, event = forger.anything()
        given[sort] += 1
        signed.happens("0", event)
        if at % BETWEEN == 0:
            signed.run(0.01)
            assert kept(platform) == before, (at, sort, event)
            forget_streams(signed)
    assert not signed.vehicle("0").commands
    assert not signed.vehicle("1").commands
    now = Counter(log.refused) - refused
    assert now.total() == given["act"] + given["receipt"], (now, given)
    assert set(now) >= {"unsigned", "unknown sender", "forged"}
    assert (platform.refused - dropped)["key"] == given["heartbeat"]
    assert {unit for unit in ("1", "cc") if beats.is_present(unit)} == {"1", "cc"}
    assert not beats.is_present("9")
    offset = platform.member.offsets.of("1")
    assert offset is not None
    assert abs(offset.offset_us) < 10_000
    # what the members themselves say counts as before
    before_us = trust_of(platform).verifier.accepted
    assert before_us >= accepted
    signed.run(3.0)
    assert signed.asked("cc", "0", Query(semantic_label="heli-position"), P.QUERY_REF).performatives == [P.INFORM]
    assert signed.asked("cc", "0", Hold()).performatives[0] is P.AGREE
    print(dict(given), dict(now))


def trust_of(platform: Platform) -> Trust:
    found = platform.config.trust
    assert found is not None
    return found


@pytest.mark.parametrize(("seed", "count"), REPLAYED)
def test_of_what_is_repeated_nothing_is_acted_on_twice_whatever_clocks_say(seed: int, count: int) -> None:
    """Restarts with a clock set back, lies about the sender's clock, and acts repeated at any time in between."""
    rng, signer = Random(seed), trust("cc").signer
    roster, truth_us, skew_us = trust("0").roster, EPOCH, 0
    verifier = Verifier(roster, "default", truth_us)
    said: list[tuple[Act, Any, bytes]] = []
    accepted: Counter[int] = Counter()
    refused: Counter[str] = Counter()
    seq = 0
    for _ in range(count):
        truth_us += rng.choice([1_000, 100_000, 10_000_000]) if rng.random() < 0.3 else 0
        if rng.random() < 0.03 or not said:  # one more is made, and arrives at once
            seq += 1
            act = Act(
                P.REQUEST, AgentName("interface", "cc"), AgentName("interface", "0"), Hold().expr(), f"c-{seq}", boot=1, seq=seq,
                created_us=truth_us,
            )  # fmt: skip
            said.append((*decode_act(encode_act(act, signer)),))
            truth_us += 1
        if rng.random() < 0.01:  # off for a while, and back with a clock that is wrong
            truth_us += rng.randrange(1, 3_000_000)
            skew_us = rng.choice([0, 0, -rng.randrange(DAY_US), -rng.randrange(MAX_AGE_US), OFFSET_US])
            verifier = Verifier(roster, "default", truth_us + skew_us, dict(verifier.accepted_us))
        at = max(0, len(said) - rng.choice([1, 1, 2, 5])) if rng.random() < 0.5 else rng.randrange(len(said))
        act, signature, body = said[at]
        reason = verifier.check(act, signature, body, truth_us + skew_us, offset_us=rng.choice(LIES_US))
        accepted[act.seq] += reason is None
        refused[reason or "accepted"] += 1
    assert max(accepted.values()) == 1
    assert accepted.total() + refused.total() - refused["accepted"] == count
    assert accepted.total() > 5, "the test would show nothing"
    assert set(refused) >= {"replayed", "too old", "from an earlier life"}
    print(dict(refused))


@pytest.mark.parametrize(
    ("seed", "count"), [pytest.param(1, 600, id="short"), pytest.param(2, 20_000, id="bar", marks=pytest.mark.full)]
)
def test_a_platform_does_nothing_twice_that_is_repeated_to_it_across_restarts(seed: int, count: int) -> None:
    rng, signed = Random(seed), members(Box())
    for content in (Hold(), Goto(latitude_deg=58.0, longitude_deg=15.0, altitude_m=90.0)):
        assert signed.asked("cc", "0", content).performatives[0] is P.AGREE
        signed.run(1.5)
    heard = list(
        dict.fromkeys(
            crossed.put
            for crossed in signed.wire.log
            if crossed.put.key.startswith("acl/0/") and not crossed.put.key.endswith("/receipt")
        )
    )
    ordered = len(signed.vehicle("0").commands)
    assert ordered >= 2
    for _ in range(count):
        put, log = rng.choice(heard), signed.platform("0").ports.agent.audit_log
        before = log.refused.total()
        signed.happens("0", Arrived(put.key, signed.now_us, put.payload))
        assert log.refused.total() == before + 1
        chance = rng.random()
        if chance < 0.02:
            signed.run(rng.choice([0.05, 0.5, 2.0]))
            forget_streams(signed)
        elif chance < 0.025:
            old = trust_of(signed.platform("0")).verifier
            signed.kill("0")
            new = trust("0")
            verifier = Verifier(new.roster, "default", signed.now_us, dict(old.accepted_us))
            signed.join("0", Vehicle(), control=True, trust=Trust(new.signer, verifier))
            ordered = 0
        assert len(signed.vehicle("0").commands) == ordered
