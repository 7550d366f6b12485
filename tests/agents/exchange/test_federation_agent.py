"""The DyKnow Federation Agent at its edges: what it refuses, what it takes back, what it cannot say in one act."""

import pytest

from dyknow import Policy
from dyknow.agents.admission.limits import STREAMS_PER_PEER
from dyknow.agents.exchange.federation_agent import FederationAgent
from dyknow.agents.platform import Platform
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.codec import StreamSample, encode_samples
from dyknow.federation.messages.contents import Answers, CreateMulticast, EndStream, Query, Samples, Stream
from dyknow.federation.sharing.exports import STREAMS
from tests.box import Box, Vehicle

P = Performative
POLICY = Policy(change="sample", sample_us=200_000, max_delay_us=1_000_000, from_us=0)


def multicast(*labels: str, to: tuple[str, ...] = ("cc",), period_s: float = 0.2, **given: int) -> CreateMulticast:
    return CreateMulticast(
        semantic_labels=labels or ("heli-position",), sample_period_s=period_s, delay_s=1.0, to_units=to, **given
    )


def test_a_refused_multicast_leaves_nothing_behind(wire: Box, node: Platform) -> None:
    assert wire.asked("cc", "0", multicast("heli-position", "car-position")).performatives == [P.REFUSE]
    assert wire.asked("cc", "0", multicast(to=("0",))).reason == "a stream needs a receiver"
    assert wire.asked("cc", "0", multicast(to=())).reason == "a stream needs a receiver"
    assert node.built.gateway.exporter.exports.streams() == []
    assert node.built.tasks.all() == []


def test_a_multicast_that_does_not_fit_is_taken_back_as_a_whole(wire: Box, node: Platform) -> None:
    for at in range(STREAMS - 1):
        node.built.gateway.exporter.exports.open(
            f"c{at}", "battery", Policy(change="sample", sample_us=1000 + at, from_us=0), ["1"]
        )
    question = wire.asked("cc", "0", multicast("heli-position", "heli-altitude"))
    assert question.reason == f"this platform exports {STREAMS} streams already"
    assert len(node.built.gateway.exporter.exports.streams()) == STREAMS - 1
    assert wire.acts("0", "cc", "stream") == []
    for at in range(STREAMS - 1):
        node.built.gateway.exporter.on_events(node.built.gateway.exporter.exports.stop(f"c{at}", wire.now_us))


def test_one_peer_gets_so_many_streams_and_no_more(wire: Box, node: Platform) -> None:
    for at in range(STREAMS_PER_PEER // 4):
        labels = ("heli-position", "heli-altitude", "heli-velocity", "battery")
        assert wire.asked("cc", "0", multicast(*labels, period_s=0.1 * (at + 1))).performatives == [P.AGREE, P.INFORM]
    assert wire.asked("cc", "0", multicast()).performatives == [P.REFUSE]
    assert wire.asked("1", "0", multicast(to=("1",))).performatives == [P.AGREE, P.INFORM]


def test_contracts_of_long_conversations_are_not_confused(wire: Box, node: Platform) -> None:
    """An id is never cut: two owners that differ in their first letter alone hold two contracts."""
    end = "-" + "7" * 62
    for unit, owner in (("cc", "a" + end), ("1", "b" + end)):
        node.part(FederationAgent).export(multicast(to=(unit,)), owner, wire.now_us)
    ((_, receivers),) = node.built.gateway.exporter.exports.streams()
    assert receivers == ("1", "cc")
    node.part(FederationAgent).end_exports([f"a{end}.heli-position.{POLICY.content_hash()}"], wire.now_us)
    ((_, receivers),) = node.built.gateway.exporter.exports.streams()
    assert receivers == ("1",)
    node.part(FederationAgent).end_exports([f"b{end}.heli-position.{POLICY.content_hash()}"], wire.now_us)
    wire.settle("0")


def test_a_stream_that_has_run_out_ends_its_task_and_tells_who_asked_and_who_received(
    wire: Box, node: Platform
) -> None:
    until_us = wire.now_us + 2_000_000
    question = wire.asked("1", "0", multicast(to=("1",), to_us=until_us))
    assert question.performatives == [P.AGREE, P.INFORM]
    wire.run(2.0)
    assert len(node.built.tasks.all()) == 1, "a last sample may be late"
    wire.run(1.2)
    assert question.performatives[2:] == [P.FAILURE]
    assert question.reason == "end of its duration"
    assert node.built.tasks.all() == []
    assert node.built.gateway.exporter.exports.streams() == []
    assert wire.platform("1").built.gateway.importer.imports.streams == {}
    assert node.ports.agent.conversations.conversations() == []
    history = (
        wire.platform("1").ports.network.generator(wire.platform("1").built.gateway.local("heli-position", "0")).history
    )
    assert history.get_latest().valid_us == until_us // 200_000 * 200_000


def test_a_receiver_is_told_when_its_own_contract_ends_though_others_receive_on(wire: Box, node: Platform) -> None:
    wire.join("2")
    wire.run(1.0)
    first = wire.asked("1", "0", multicast(to=("1",)))
    second = wire.asked("2", "0", multicast(to=("2",)))
    wire.run(1.0)
    wire.cancel("1", "0", first.conversation)
    wire.run(0.5)
    assert wire.platform("1").built.gateway.importer.imports.streams == {}
    assert len(wire.platform("2").built.gateway.importer.imports.streams) == 1
    wire.cancel("2", "0", second.conversation)
    wire.run(0.5)


def test_a_task_of_several_streams_ends_with_the_last_of_them(wire: Box, node: Platform) -> None:
    question = wire.asked("1", "0", multicast("heli-position", "battery", to=("1",), to_us=wire.now_us + 1_000_000))
    wire.run(4.0)
    assert question.performatives == [P.AGREE, P.INFORM, P.FAILURE], "said once"


@pytest.mark.parametrize(
    "told",
    [
        Stream(owner="2", semantic_labels=("battery",), policy=str(POLICY), hash=POLICY.content_hash()),
        Stream(owner="1", semantic_labels=("battery",), policy="sample every 17", hash=POLICY.content_hash()),
        EndStream(owner="2", semantic_labels=("battery",), hash=POLICY.content_hash()),
    ],
)
def test_streams_are_announced_and_ended_by_their_owner_as_they_are(
    wire: Box, node: Platform, told: Stream | EndStream
) -> None:
    wire.platform("1").ports.agent.tell("0", told, wire.now_us)
    wire.settle("1")
    wire.run(0.1)
    assert node.built.gateway.importer.imports.streams == {}
    assert node.ports.agent.audit_log.refused == {"refused": 1}


def test_the_end_of_a_stream_that_never_was_ends_nothing(wire: Box, node: Platform) -> None:
    told = EndStream(owner="1", semantic_labels=("battery",), hash=POLICY.content_hash())
    wire.platform("1").ports.agent.tell("0", told, wire.now_us)
    wire.settle("1")
    wire.run(0.1)
    assert node.ports.agent.audit_log.refused == {}


@pytest.mark.parametrize("label", ["heli-velocity", "heli-position", "heli-home"])
def test_a_local_answer_longer_than_an_act_comes_in_pages(wire: Box, node: Platform, label: str) -> None:
    wire.run(60.0)
    query = Query(semantic_label=label, op="between", from_us=wire.now_us - 55_000_000, to_us=wire.now_us)
    question = wire.asked("cc", "0", query, P.QUERY_REF)
    pages = [page for page in question.contents if isinstance(page, Samples)]
    assert [page.more for page in pages] == [True, True, False]
    found = [reading.valid_us for page in pages for reading in page.samples]
    assert len(found) == 551
    assert found == sorted(found)
    assert wire.member("cc").acts.conversations.conversations() == [], "closed by the last page"


def test_a_global_answer_longer_than_an_act_comes_in_pages_and_nothing_is_left_out(wire: Box, node: Platform) -> None:
    wire.join("2", Vehicle(is_silent=True))
    wire.run(40.0)
    query = Query(
        semantic_label="heli-velocity", op="between", scope="global", select="newest",
        from_us=wire.now_us - 30_000_000, to_us=wire.now_us,
    )  # fmt: skip
    question = wire.asked("cc", "0", query, P.QUERY_REF)
    wire.run(1.0)
    pages = [page for page in question.contents if isinstance(page, Answers)]
    assert [page.more for page in pages] == [True, True, False]
    by_unit = {unit: [r for page in pages for s in page.answers if s.unit == unit for r in s.samples] for unit in "012"}
    assert [len(by_unit[unit]) for unit in "01"] == [301, 301]
    assert by_unit["0"] != by_unit["1"] or wire.vehicle("0") == wire.vehicle("1")
    assert pages[-1].merged is not None
    assert all(page.missing == () and page.merged is None for page in pages[:-1])
    for unit in ("0", "1", "cc"):
        assert wire.member(unit).acts.conversations.conversations() == []


def test_a_silent_platform_costs_a_global_question_its_answer_and_not_the_others(wire: Box, node: Platform) -> None:
    wire.freeze("1")
    question = wire.question("cc", "0", Query(semantic_label="heli-position", scope="global"), P.QUERY_REF)
    wire.run(1.9)
    (found,) = question.contents
    assert isinstance(found, Answers)
    assert [said.unit for said in found.answers] == ["0"]
    assert [(missing.unit, missing.reason) for missing in found.missing] == [("1", "not delivered")]


def test_a_sample_of_another_sort_is_dropped_and_counted(wire: Box, node: Platform) -> None:
    wire.asked("0", "1", multicast(to=("0",)))
    wire.run(1.0)
    key = next(crossed.put.key for crossed in wire.wire.log if crossed.put.key.startswith("x/1/"))
    before = node.built.gateway.latest("heli-position", "1")
    boot, far = wire.platform("1").config.boot, 10_000
    for at, value in enumerate([(1.0, 2.0, 3.0), (1.0,), 5.0, "here", (None, 1.0), ((1.0, 2.0),)]):
        wire.put(key, encode_samples(boot, (StreamSample(far + at, wire.now_us, value),)))
    wire.run(0.01)
    assert node.built.gateway.importer.refused == {"sort": 6}
    assert node.built.gateway.latest("heli-position", "1") == before


@pytest.mark.parametrize("valid_us", [-(2**63), 0, 2**62, 2**63 - 1])
def test_a_sample_from_any_time_is_taken_in_stride(wire: Box, node: Platform, valid_us: int) -> None:
    from dyknow.federation.messages.contents import MonitorProximity

    wire.asked("cc", "0", MonitorProximity())
    wire.run(1.0)
    key = next(crossed.put.key for crossed in wire.wire.log if crossed.put.key.startswith("x/1/heli-position"))
    boot = wire.platform("1").config.boot
    wire.put(key, encode_samples(boot, (StreamSample(10_000, valid_us, (58.0, 15.0)),)))
    wire.run(5.0)
    wire.cancel("cc", "0", node.built.tasks.all()[0].conversation)
    wire.run(1.0)
