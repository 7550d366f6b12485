"""Hostile bytes fed to a whole platform: nothing raises, nothing changes, nothing grows, everything is counted."""

import gc
from collections.abc import Iterator
from hashlib import sha256
from random import Random

import psutil
import pytest

from dyknow.agents.capabilities.flight.flight import FlightAgent
from dyknow.agents.config import PlatformConfig
from dyknow.agents.monitoring.alarm_log import AlarmLog
from dyknow.agents.platform import Platform
from dyknow.federation import keys
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.codec import decode_act, encode_act
from dyknow.federation.messages.contents import (
    AddDeclarations,
    Goto,
    Hold,
    LoadSpecification,
    MonitorProximity,
    Query,
    RemoveDeclarations,
    RestoreSpecification,
    Specification,
)
from dyknow.federation.security.trust import Roster, RosterMember, Signer, Trust, Verifier
from dyknow.federation.transport import Arrived
from dyknow.model.errors import DecodeError
from tests.box import EPOCH, Box
from tests.federation.mutants import encode, mutate_bytes, mutate_tree
from tests.federation.test_hostile import act_mutants, heartbeat_tree, recovered_tree, sample_tree

P = Performative
PROFILES = [pytest.param(10_000, id="tenth"), pytest.param(100_000, id="bar", marks=pytest.mark.full)]
MIB = 2**20


def signer(unit: str) -> Signer:
    return Signer(sha256(unit.encode()).digest(), "default")


def roster() -> Roster:
    roles = {"0": "uav", "1": "uav", "2": "uav", "cc": "command-centre", "eye": "observer"}
    return Roster({u: RosterMember(u, signer(u).public_key, role) for u, role in roles.items()}).revoked("2")  # type: ignore[arg-type]


def trust(unit: str) -> Trust:
    return Trust(signer(unit), Verifier(roster(), "default", EPOCH - 1_000_000))


def hostile(rng: Random) -> Iterator[tuple[str, bytes]]:
    """(key, payload): mutants of acts under the key they claim or another; samples and heartbeats; replays."""
    acts, said = act_mutants(rng), []
    key = keys.act("0", "7", "interface")
    while True:
        way = rng.randrange(8)
        if way < 4:
            payload = next(acts)
            try:
                key = decode_act(payload)[0].key
                said.append((key, payload))
            except DecodeError:
                key = keys.act("0", rng.choice(["7", "9", "uav1"]), "interface")
            yield (
                rng.choice([key, key, keys.act("0", "8", "interface"), "acl/0/7/interface/x", "nonsense", "x/1"]),
                payload,
            )
        elif way == 4 and said:
            yield rng.choice(said[-50:])
        elif way == 5:
            yield keys.stream("1", "heli-position", "ab12cd34"), encode(mutate_tree(sample_tree(rng), rng))
        elif way == 6:
            yield keys.heartbeat("7"), mutate_bytes(encode(mutate_tree(heartbeat_tree(rng), rng)), rng)
        else:
            yield keys.act("0", "7", "receipt"), encode(mutate_tree(recovered_tree(rng), rng))


def state(platform: Platform) -> object:
    return (
        platform.built.tasks.all(), dict(platform.built.monitors.named), platform.built.gateway.exporter.exports.streams(), platform.built.gateway.importer.imports.streams,
        platform.ports.network.labels(), platform.part(AlarmLog).subscribers, platform.built.tasks.coordinated, platform.part(FlightAgent).pilot.flying,
    )  # fmt: skip


@pytest.mark.parametrize("count", PROFILES)
def test_hostile_bytes_change_nothing_and_cost_no_memory(count: int) -> None:
    rng = Random(7)
    platform = Platform(PlatformConfig("0", boot=EPOCH, control=True), EPOCH)
    platform.start(EPOCH)
    before, process, settled = state(platform), psutil.Process(), 0
    now_us = EPOCH
    for given, (key, payload) in enumerate(hostile(rng), start=1):
        now_us += 2_000
        platform.on_event(Arrived(key, now_us, payload), now_us)
        if platform.deadline_us <= now_us:
            platform.on_time(now_us)
        if given == count // 10:
            gc.collect()
            settled = process.memory_info().rss
        if given == count:
            break
    assert state(platform) == before
    counted = sum(platform.refused.values()) + sum(platform.ports.agent.audit_log.refused.values())
    assert counted > count // 4
    assert set(platform.ports.agent.audit_log.refused) > {"not understood", "sender and key differ", "duplicate"}
    gc.collect()
    assert process.memory_info().rss - settled < 8 * MIB
    assert len(platform.ports.agent.audit_log.entries) <= 1000


def test_names_by_the_thousand_open_no_conversations_for_ever() -> None:
    """In an open federation anybody can call himself anything: what is open with strangers ends."""
    platform = Platform(PlatformConfig("0", boot=EPOCH), EPOCH)
    platform.start(EPOCH)
    now_us = EPOCH
    for at in range(1_000):
        now_us += 1_000
        act = Act(
            P.QUERY_REF, AgentName("interface", f"n{at}"), AgentName("interface", "0"),
            Query(semantic_label="battery", scope="global").expr(), conversation_id=f"n{at}-1-{at}", boot=1, created_us=now_us,
        )  # fmt: skip
        platform.on_event(Arrived(act.key, now_us, encode_act(act)), now_us)
    while now_us < EPOCH + 30_000_000:
        now_us = max(now_us + 1, platform.deadline_us)
        platform.on_time(now_us)
    assert platform.ports.agent.conversations.conversations() == []
    outcomes = {entry.outcome for entry in platform.ports.agent.audit_log.entries}
    assert outcomes == {"undelivered"}, "the message log says what became of each answer"


@pytest.fixture
def signed(wire: Box) -> Box:
    """0 and 1 are of the roster, 2 is revoked, cc commands, eye observes."""
    for unit in "012":
        wire.join(unit, control=True, trust=trust(unit))
    for unit in ("cc", "eye"):
        wire.centre(unit, trust=trust(unit))
    wire.run(2.0)
    return wire


GOTO = Goto(latitude_deg=58.0, longitude_deg=15.0, altitude_m=120.0)


def test_with_a_roster_a_command_centre_alone_commands_flight(signed: Box) -> None:
    for by, expected in [("1", [P.REFUSE]), ("eye", [P.REFUSE]), ("cc", [P.AGREE, P.INFORM])]:
        question = signed.asked(by, "0", GOTO)
        signed.run(1.5)  # an autopilot that reports no target is given a second to do so
        assert question.performatives == expected
    assert len(signed.vehicle("0").commands) == 1
    assert signed.platform("0").ports.agent.audit_log.refused == {"role": 2}


def test_an_observer_asks_and_delegates_nothing(signed: Box) -> None:
    assert signed.asked("eye", "0", MonitorProximity()).performatives == [P.REFUSE]
    assert signed.asked("eye", "0", Query(semantic_label="heli-position"), P.QUERY_REF).performatives == [P.INFORM]


WATCHED = "monitor low = always heli-height.height_m[self] > 5"


def test_with_a_roster_a_command_centre_alone_changes_or_restores_what_a_platform_declares(signed: Box) -> None:
    """Otherwise any member could remove a safety monitor. An observer does not get the whole text."""
    assert signed.asked("cc", "0", AddDeclarations(text=WATCHED)).performatives[-1] is P.INFORM
    for by in ("1", "eye"):
        for content in (
            RestoreSpecification(number=0),
            LoadSpecification(text=""),
            RemoveDeclarations(names=("low",)),
            AddDeclarations(text="monitor other = always heli-height.height_m[self] > 6"),
        ):
            assert signed.asked(by, "0", content).performatives == [P.REFUSE]
    assert signed.asked("eye", "0", Specification(), P.QUERY_REF).performatives == [P.REFUSE]
    assert set(signed.platform("0").built.monitors.named) == {"low"}
    assert signed.asked("cc", "0", RestoreSpecification(number=0)).performatives[-1] is P.INFORM
    assert not signed.platform("0").built.monitors.named


def test_who_is_revoked_is_not_listened_to(signed: Box) -> None:
    question = signed.question("2", "0", Query(semantic_label="heli-position"), P.QUERY_REF)
    signed.run(3.0)
    assert question.answers == []
    assert question.failed
    assert signed.platform("0").ports.agent.audit_log.refused == {"revoked": 4}, "once, and three times again"


def test_two_of_the_roster_federate(signed: Box) -> None:
    task = signed.asked("cc", "0", MonitorProximity(profile="proximity"))
    signed.run(3.0)
    assert task.performatives[0] is P.AGREE
    assert signed.platform("1").built.monitors.named["proximity"].instances["0"].monitor.inputs == "fresh"
    signed.cancel("cc", "0", task.conversation)
    signed.run(1.0)


def test_only_who_asked_or_a_command_centre_ends_a_task(signed: Box) -> None:
    task = signed.asked("cc", "0", MonitorProximity(profile="proximity"))
    signed.run(1.0)
    cancel = Act(P.CANCEL, AgentName("interface", "1"), AgentName("interface", "0"), conversation_id=task.conversation)
    desk = signed.platform("1").ports.agent
    desk.acts._handle(desk.conversations.send(cancel, signed.now_us)[1], signed.now_us)
    signed.settle("1")
    signed.run(0.2)
    led = [t for t in signed.platform("0").built.tasks.all() if t.name == "monitor-proximity"]
    assert [t.initiator for t in led] == ["cc"]
    assert "a command centre may end" in str(signed.acts("0", "1")[-1].content)
    signed.cancel("cc", "0", task.conversation)
    signed.run(1.0)


def test_forged_foreign_unsigned_and_replayed_acts_are_counted_and_not_acted_on(signed: Box) -> None:
    boot = signed.member("cc").boot

    def order(seq: int) -> Act:
        return Act(
            P.REQUEST, AgentName("interface", "cc"), AgentName("interface", "0"), Hold().expr(),
            conversation_id=f"cc-{boot:x}-{seq}", boot=boot, seq=seq, created_us=signed.now_us,
        )  # fmt: skip

    good = encode_act(order(900), signer("cc"))
    key = order(900).key
    flipped = bytearray(encode_act(order(903), signer("cc")))
    flipped[-1] ^= 1
    for payload in (encode_act(order(901)), encode_act(order(902), signer("1")), bytes(flipped), good, good, good):
        signed.put(key, payload)
        signed.run(0.01)
    assert len(signed.vehicle("0").commands) == 1
    assert signed.platform("0").ports.agent.audit_log.refused == {"unsigned": 1, "forged": 2, "replayed": 2}
    signed.run(40.0)
    signed.put(key, good)
    signed.run(0.01)
    assert len(signed.vehicle("0").commands) == 1


def test_what_was_said_under_another_key_is_not_believed(signed: Box) -> None:
    act = Act(
        P.REQUEST, AgentName("interface", "cc"), AgentName("interface", "0"), Hold().expr(),
        conversation_id="cc-1-1", boot=1, seq=1, created_us=signed.now_us,
    )  # fmt: skip
    for key in (keys.act("0", "1", "interface"), keys.act("0", "cc", "pilot")):
        signed.put(key, encode_act(act, signer("cc")))
    signed.run(0.1)
    assert signed.platform("0").ports.agent.audit_log.refused == {"sender and key differ": 2}


def test_beyond_its_rate_a_peer_is_refused_and_the_others_are_served(wire: Box, node: Platform) -> None:
    questions = [wire.question("1", "0", Query(semantic_label="heli-position"), P.QUERY_REF) for _ in range(60)]
    other = wire.question("cc", "0", Query(semantic_label="heli-position"), P.QUERY_REF)
    wire.run(0.5)
    assert [q.performatives for q in questions[:40]] == [[P.INFORM]] * 40
    assert [q.performatives for q in questions[40:]] == [[P.REFUSE]] * 20
    assert other.performatives == [P.INFORM]
    assert node.ports.agent.audit_log.refused == {"too many acts": 20}
    wire.run(1.0)
    assert wire.asked("1", "0", Query(semantic_label="heli-position"), P.QUERY_REF).performatives == [P.INFORM]
