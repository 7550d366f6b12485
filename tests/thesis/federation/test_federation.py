"""Thesis 9.3: the components, interfaces, messages and functionalities of a federation, one test each."""

from itertools import pairwise

import pytest

from dyknow import Label, Policy, Sample, UnknownLabel, ValueNotAvailable
from dyknow.agents.exchange.federation_agent import FederationAgent
from dyknow.agents.exchange.gateway import stream_policy
from dyknow.agents.platform import Platform
from dyknow.federation import keys
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import (
    Answers,
    CreateMulticast,
    Directory,
    DirectoryEvent,
    Done,
    Leave,
    Query,
    Rejoin,
    Samples,
    Search,
    SearchResult,
    Stream,
    read,
)
from dyknow.federation.sharing.ontology import default_ontology
from dyknow.federation.sharing.translation import Translation
from dyknow.federation.transport import Put
from dyknow.model.errors import Refused
from tests.box import EPOCH, Box, Question, Vehicle
from tests.federation.expressions import parse_expr
from tests.satisfaction import satisfied

P = Performative
SECOND = 1_000_000


@pytest.fixture
def federation(wire: Box) -> Box:
    """UAVs a, b, c and d, and a command centre, two seconds after they met."""
    return met(wire, "abcd")


def met(wire: Box, units: str) -> Box:
    for at, unit in enumerate(units):
        wire.join(unit, Vehicle(north_m=500.0 * at, altitude_m=100.0 + at))
    wire.centre()
    wire.run(2.0)
    return wire


def ask(wire: Box, by: str, to: str, **query: object) -> Question:
    """Ask `to` a question; `since_s` and so on are seconds since the beginning."""
    return wire.asked(by, to, Query(semantic_label="heli-position", **query), P.QUERY_REF)  # type: ignore[arg-type]


def values(found: object) -> list[tuple[int, float]]:
    """(valid time in us since the beginning, latitude) of the readings in an answer."""
    assert isinstance(found, Samples)
    return [(r.valid_us - EPOCH, r.value["latitude_deg"]) for r in found.samples]  # type: ignore[index]


# 9.3.2  The multi-agent framework


def test_9_3_2_the_directory_facilitator_finds_services_and_who_provides_them(federation: Box) -> None:
    for unit in ("a", "cc"):
        found = federation.member(unit).directory.search(service="dyknow-federation")
        assert [entry.unit for entry in found] == list("abcd")
    found_by_act = federation.asked("cc", "a", Search(service="dyknow-federation"), P.QUERY_REF).contents[0]
    assert found_by_act == SearchResult(agents=tuple(f"interface@{unit}" for unit in "abcd"))


# 9.3.3  The DyKnow federation service: the messages


def test_9_3_3_message_1_create_stream_multicast_exports_to_all_receivers(federation: Box) -> None:
    """ "UAV A could send a create stream multicast request for the semantic label heli-position to UAV B with a sample
    period of 2 seconds and UAVs C and D as receivers"."""
    content = CreateMulticast(semantic_labels=("heli-position",), sample_period_s=2.0, delay_s=1.0, to_units=("c", "d"))
    request = federation.asked("a", "b", content)
    assert request.performatives == [P.AGREE, P.INFORM]
    assert isinstance(request.contents[-1], Done)
    federation.run(9.0)
    for receiver in "cd":
        imported = federation.platform(receiver).ports.network.generator(Label.parse("heli-position[b]")).history
        times = [s.valid_us for s in imported.get_between(0, federation.now_us)]
        assert len(times) >= 4
        assert {b - a for a, b in pairwise(times)} == {2 * SECOND}
        assert all(at % (2 * SECOND) == 0 for at in times)
    assert federation.platform("a").built.gateway.importer.imports.streams == {}, "who asked does not receive"
    assert len({c.put.key for c in federation.wire.log if c.put.key.startswith("x/b/")}) == 1, (
        "one put for all receivers"
    )


def test_9_3_3_message_1_the_stream_satisfies_its_start_and_end_times(federation: Box) -> None:
    first, last = federation.now_us + SECOND, federation.now_us + 3 * SECOND
    federation.asked(
        "a", "b",
        CreateMulticast(
            semantic_labels=("heli-altitude",), sample_period_s=0.5, delay_s=0.5, to_units=("c",), from_us=first, to_us=last
        ),
    )  # fmt: skip
    federation.run(5.0)
    history = federation.platform("c").ports.network.generator(Label.parse("heli-altitude[b]")).history
    found = history.get_between(0, federation.now_us)
    assert all(first <= s.valid_us <= last and s.delay_us <= SECOND // 2 for s in found)
    assert [b.valid_us - a.valid_us for a, b in pairwise(found)] == [SECOND // 2] * 4
    policy = Policy.parse(str(stream_policy(0.5, 0.5, first, last)))
    assert satisfied(policy, found)


@pytest.mark.parametrize("to", ["a", "c"])
def test_9_3_3_message_2_query_the_latest_value(federation: Box, to: str) -> None:
    (found,) = ask(federation, "b", to).contents
    ((valid_us, latitude),) = values(found)
    assert federation.now_us - EPOCH - valid_us <= 300_000
    expected = federation.platform(to).built.gateway.latest("heli-position").value[0]
    assert latitude == pytest.approx(expected, abs=1e-6)


def test_9_3_3_message_2_query_the_value_at_a_time_point(federation: Box) -> None:
    federation.vehicle("a").north_m_s = 4.0  # type: ignore[union-attr]
    federation.run(5.0)
    at_us = EPOCH + 3 * SECOND + 55_000
    (found,) = ask(federation, "b", "a", op="at", at_us=at_us).contents
    ((valid_us, _),) = values(found)
    assert valid_us == 3 * SECOND, "the most recent one at that time (Def. 4.3.11)"


def test_9_3_3_message_2_query_all_values_between_two_time_points(federation: Box) -> None:
    federation.run(3.0)
    (found,) = ask(federation, "b", "a", op="between", from_us=EPOCH + 2 * SECOND, to_us=EPOCH + 3 * SECOND).contents
    assert [valid_us for valid_us, _ in values(found)] == list(range(2 * SECOND, 3 * SECOND + 1, 100_000)), "inclusive"


def test_9_3_3_a_time_point_in_the_future_is_refused_and_one_before_the_history_fails_and_names_its_start(
    wire: Box,
) -> None:
    federation = met(wire, "ab")
    later = ask(federation, "b", "a", op="at", at_us=federation.now_us + SECOND)
    assert later.performatives == [P.REFUSE]
    assert later.reason == "not yet: 1.0 s in the future"
    federation.run(420.0)
    earlier = ask(federation, "b", "a", op="between", from_us=EPOCH, to_us=EPOCH + SECOND)
    assert earlier.performatives == [P.FAILURE]
    assert "before the first heli-position that is held" in earlier.reason
    assert earlier.reason.endswith(" s ago"), "its start"


def test_9_3_3_a_request_is_local_or_global(federation: Box) -> None:
    (local,) = ask(federation, "cc", "a").contents
    assert isinstance(local, Samples)
    asked = federation.question("cc", "a", Query(semantic_label="heli-position", scope="global"), P.QUERY_REF)
    federation.run(1.0)
    (found,) = asked.contents
    assert isinstance(found, Answers)
    assert sorted(samples.unit for samples in found.answers) == list("abcd")
    assert found.missing == ()
    forwarded = {act.receiver.unit for act in federation.acts(sender="a", head="query")}
    assert forwarded == set("bcd"), "asked of everybody who provides the federation service, through their interfaces"


# 9.3.3  The DyKnow Gateway, the proxies: the interfaces


def test_9_3_3_a_unicast_is_a_multicast_to_one_receiver_translated_with_the_policy_that_is_asked_for(
    federation: Box,
) -> None:
    """`create stream unicast(heli-position, 0, 0, 1, 1, 0)`: "sample every 1, max delay 1"."""
    a = federation.platform("a")
    policy = stream_policy(1.0, 1.0)
    assert (policy.sample_us, policy.max_delay_us, policy.from_us, policy.to_us) == (SECOND, SECOND, 0, None)
    asked = CreateMulticast(semantic_labels=("heli-position",), sample_period_s=1.0, delay_s=1.0, to_units=("b",))
    assert federation.asked("c", "a", asked).performatives == [P.AGREE, P.INFORM]
    ((stream, receivers),) = a.built.gateway.exporter.exports.streams()
    assert (stream.label, stream.policy_hash, receivers) == ("heli-position", policy.content_hash(), ("b",))
    federation.run(3.0)
    imported = federation.platform("b").ports.network.generator(Label.parse("heli-position[a]")).history
    found = imported.get_between(0, federation.now_us)
    assert len(found) >= 2
    assert satisfied(policy, found)
    assert not federation.platform("c").ports.network.has(Label.parse("heli-position[a]")), "who asked does not receive"


def test_9_3_3_create_stream_multicast_is_unicast_to_each_receiver_with_one_stream(federation: Box) -> None:
    a = federation.platform("a")
    first = a.built.gateway.create_stream_multicast("heli-position", stream_policy(1.0, 1.0), ["b", "c"], "contract-1")
    again = a.built.gateway.create_stream_multicast("heli-position", stream_policy(1.0, 1.0), ["d"], "contract-2")
    other = a.built.gateway.create_stream_multicast("heli-position", stream_policy(2.0, 1.0), ["d"], "contract-3")
    assert first == again != other
    assert [receivers for _, receivers in a.built.gateway.exporter.exports.streams()] == [("b", "c", "d"), ("d",)]
    a.part(FederationAgent).end_exports(["contract-1", "contract-2", "contract-3"], federation.now_us)
    federation.settle("a")
    assert a.built.gateway.exporter.exports.streams() == []


def test_9_3_3_start_exporting_pushes_each_new_sample(federation: Box) -> None:
    a = federation.platform("a")
    local = Label.parse("heli-altitude[a]")
    a.built.gateway.exporter.start_exporting(local, "heli-altitude", ["b"], stream_policy(0.1, 1.0), "contract-1")
    since_us = federation.now_us
    federation.run(1.0)
    puts = [c for c in federation.wire.log if c.at_us > since_us and c.put.key.startswith("x/a/heli-altitude/")]
    assert len(puts) == 10
    assert isinstance(puts[0].put, Put)
    with pytest.raises(UnknownLabel):
        a.built.gateway.exporter.start_exporting(Label.parse("nothing[a]"), "battery", ["b"], stream_policy(1, 1), "c2")
    a.part(FederationAgent).end_exports(["contract-1"], federation.now_us)
    federation.settle("a")


def test_9_3_3_a_receiver_that_is_gone_or_slow_harms_no_other(federation: Box) -> None:
    federation.asked("c", "a", CreateMulticast(
        semantic_labels=("heli-position",), sample_period_s=0.1, delay_s=1.0, to_units=("b", "c", "d"))
    )  # fmt: skip
    federation.kill("b")
    federation.freeze("d")
    federation.run(5.0)
    (account,) = [
        found.stream.account for found in federation.platform("c").built.gateway.importer.imports.streams.values()
    ]
    assert account.received >= 49
    assert account.lost == 0
    federation.thaw("d")
    federation.run(1.0)


def test_9_3_3_push_translates_the_label_and_makes_a_source_at_the_first_sample(federation: Box) -> None:
    c = federation.platform("c")
    local = Label.parse("heli-altitude[b]")
    federation.run(1.0 - (federation.now_us - EPOCH) % SECOND / SECOND + 0.1)  # the next sample is 0.9 s away
    asked = CreateMulticast(semantic_labels=("heli-altitude",), sample_period_s=1.0, delay_s=1.0, to_units=("c",))
    federation.asked("a", "b", asked)
    assert c.built.gateway.importer.imports.streams
    assert not c.ports.network.has(local)
    while not c.ports.network.has(local):
        federation.run(0.05)
    (first,) = c.ports.network.generator(local).history.get_between(0, federation.now_us)
    assert first.value == (pytest.approx(101.0, abs=0.3),)
    assert first.valid_us % SECOND == 0
    assert c.built.gateway.latest("heli-altitude", "b").valid_us == first.valid_us


def test_9_3_3_semantic_labels_are_translated_by_each_platform_on_its_own(wire: Box) -> None:
    """Local names and units differ, and the two federate: feet here, metres there, one meaning between."""
    ontology = default_ontology()
    feet = Translation.parse(
        ontology,
        '[heli-altitude]\nlocal = "height_ft[{unit}]"\nfields = { altitude_m = { name = "height_ft", unit = "ft" } }\n',
    )
    wire.join("a", Vehicle(altitude_m=100.0), translation=feet)
    wire.join("b", Vehicle(altitude_m=200.0, north_m=900.0))
    wire.run(2.0)
    for by, to in (("a", "b"), ("b", "a")):
        wire.asked(by, to, CreateMulticast(
            semantic_labels=("heli-altitude",), sample_period_s=0.1, delay_s=1.0, to_units=(by,))
        )  # fmt: skip
    wire.run(2.0)
    a, b = wire.platform("a"), wire.platform("b")
    own = a.ports.network.generator(a.built.gateway.local("heli-altitude")).history.get_latest().value[0]
    assert own == pytest.approx(100.0 / 0.3048, abs=0.5), "feet inside"
    assert str(a.built.gateway.local("heli-altitude", "b")).startswith("height_ft")
    assert a.ports.network.generator(a.built.gateway.local("heli-altitude", "b")).history.get_latest().value[
        0
    ] == pytest.approx(200.0 / 0.3048, abs=0.5)
    assert b.ports.network.generator(Label.parse("heli-altitude[a]")).history.get_latest().value[0] == pytest.approx(
        100.0, abs=0.2
    )
    (found,) = wire.asked("b", "a", Query(semantic_label="heli-altitude"), P.QUERY_REF).contents
    assert isinstance(found, Samples)
    assert found.samples[0].value == {"altitude_m": pytest.approx(100.0, abs=0.2)}


def test_9_3_3_what_the_proxies_agree_on_is_announced_to_the_receiver(federation: Box) -> None:
    request = "(create-multicast semantic-labels: (sequence heli-position heli-altitude) sample-period: 1.0 delay: 1.0 to-units: (sequence c))"
    federation.asked("a", "b", read(parse_expr(request)))
    (told,) = [read(act.content) for act in federation.acts("b", "c", "stream") if act.content is not None]
    assert isinstance(told, Stream)
    assert told.owner == "b"
    assert Policy.parse(told.policy).content_hash() == told.hash
    assert keys.stream_expr("heli-position", told.hash) in federation.wire.session("c").subscriptions


# 9.3.4  The functionalities


def events(question: Question) -> list[tuple[str, str, str | None]]:
    return [(c.event, c.unit, c.what) for c in question.contents if isinstance(c, DirectoryEvent)]


def test_9_3_4_a_node_is_added_by_registering_its_federation_service(federation: Box) -> None:
    watching = federation.asked("cc", "a", Directory(), P.SUBSCRIBE)
    federation.join("e")
    federation.run(1.0)
    told = events(watching)
    assert ("platform-appeared", "e", None) in told
    assert ("service-appeared", "e", "dyknow-federation") in told
    assert ("label-appeared", "e", "heli-position") in told
    assert federation.samples("e") == 0, "no information is yet shared"
    assert federation.platform("e").built.gateway.importer.imports.streams == {}


def test_9_3_4_a_node_is_removed_by_unregistering_and_is_told_of(federation: Box) -> None:
    watching = federation.asked("cc", "a", Directory(), P.SUBSCRIBE)
    assert federation.asked("cc", "d", Leave()).performatives == [P.AGREE, P.INFORM]
    federation.run(1.0)
    assert ("service-gone", "d", "dyknow-federation") in events(watching)
    assert ("platform-gone", "d", None) in events(watching)
    assert [e.unit for e in federation.platform("a").ports.directory.search(service="dyknow-federation")] == list("abc")


def test_9_3_4_streams_to_and_from_a_node_that_left_remain_active(federation: Box) -> None:
    for by, to in (("a", "d"), ("d", "a")):
        federation.asked(by, to, CreateMulticast(
            semantic_labels=("heli-position",), sample_period_s=0.1, delay_s=1.0, to_units=(by,))
        )  # fmt: skip
    federation.run(1.0)
    federation.asked("cc", "d", Leave())
    federation.run(15.0)
    for unit, other in (("a", "d"), ("d", "a")):
        newest = federation.platform(unit).built.gateway.latest("heli-position", other)
        assert federation.now_us - newest.valid_us < 400_000, f"{unit} still hears {other}"


def test_9_3_4_a_node_that_left_can_register_again(federation: Box) -> None:
    federation.asked("cc", "d", Leave())
    federation.run(2.0)
    assert not federation.platform("a").ports.directory.is_present("d")
    federation.question("cc", "d", Rejoin())
    federation.run(2.0)
    assert federation.platform("a").ports.directory.is_present("d")


def test_9_3_4_who_only_knows_the_label_makes_a_global_request(federation: Box) -> None:
    """The leader of the first use case asks for the current value of a label, whoever has it."""
    federation.freeze("c")
    asked = federation.question(
        "a", "b", Query(semantic_label="heli-altitude", scope="global"), P.QUERY_REF, 4 * SECOND
    )
    federation.run(3.0)
    (found,) = asked.contents
    assert isinstance(found, Answers)
    heights = {s.unit: s.samples[0].value["altitude_m"] for s in found.answers}  # type: ignore[index]
    assert heights == {unit: pytest.approx(100.0 + "abcd".index(unit), abs=0.3) for unit in "abd"}
    assert [missing.unit for missing in found.missing] == ["c"], "partial results, and who is missing by name"
    federation.thaw("c")
    federation.run(1.0)


@pytest.mark.parametrize(
    ("chosen", "low", "high"),
    [({"select": "newest"}, 99.5, 103.5), ({"select": "best"}, 99.5, 103.5), ({"merge": "mean"}, 101.2, 101.8),
     ({"merge": "inverse-variance"}, 101.0, 102.0)],
)  # fmt: skip
def test_9_3_4_several_answers_are_selected_from_or_merged(
    federation: Box, chosen: dict[str, str], low: float, high: float
) -> None:
    asked = federation.asked(
        "cc",
        "a",
        Query(semantic_label="heli-altitude", scope="global", **chosen),
        P.QUERY_REF,  # type: ignore[arg-type]
    )
    (found,) = asked.contents
    assert isinstance(found, Answers)
    assert len(found.answers) == 4
    assert found.merged is not None
    assert low <= found.merged.value["altitude_m"] <= high  # type: ignore[index]


def test_9_3_4_a_label_that_nobody_has_is_refused_with_what_there_is(federation: Box) -> None:
    question = federation.asked("cc", "a", Query(semantic_label="max-speed"), P.QUERY_REF)
    assert question.performatives == [P.REFUSE]
    assert "heli-position" in question.reason


def test_9_3_4_an_imported_stream_is_a_source_like_a_sensor(federation: Box) -> None:
    """Streaming information: what comes in is used by local units and policies as if it were local."""
    federation.asked("a", "b", CreateMulticast(
        semantic_labels=("heli-altitude",), sample_period_s=0.1, delay_s=1.0, to_units=("a",))
    )  # fmt: skip
    federation.run(0.5)
    a: Platform = federation.platform("a")
    heard: list[Sample] = []
    a.ports.network.connect(
        Label.parse("heli-altitude[b]"), Policy(change="sample", sample_us=500_000, from_us=0), heard.append
    )
    federation.run(2.0)
    assert {y.valid_us - x.valid_us for x, y in pairwise(heard)} == {500_000}
    assert heard[-1].value == (pytest.approx(101.0, abs=0.3),)
    with pytest.raises((ValueNotAvailable, UnknownLabel)):
        a.built.gateway.latest("heli-altitude", "c")
    with pytest.raises(Refused):
        a.built.gateway.at("heli-altitude", federation.now_us + SECOND, federation.now_us, "b")
