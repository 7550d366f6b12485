"""Hosts register with an instance, run processes for it, and are missed (thesis 5.2, 5.3)."""

from itertools import pairwise

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dyknow import (
    Label,
    Policy,
    Quality,
    Sample,
    Sort,
    SourcePrototype,
    UnitPrototype,
    computational_unit,
    of_values,
    prototypes_in,
)
from dyknow.agents.effects import DropHost, HostCame, HostMessage
from dyknow.agents.hosts.host_desk import MAX_HOSTS, SILENT_US
from dyknow.agents.specification.declared_streams import DeclaredStreams
from dyknow.federation.hosts.messages import KEPT, WINDOW, Begin, Chain, End, HostInputs, Want
from dyknow.kpl import parse_specification
from dyknow.kpl.introspection.governor import Governor
from dyknow.kpl.introspection.graph import graph_of
from dyknow.model.errors import TextErrors, UnknownLabel, ValueNotAvailable
from dyknow.network.refinement import RefinementProcess
from tests.agents.hosting import Guest, Site

TEXT = """source number raw
compunit number twice(number)
strmgen r = raw
strmgen t = twice(r)
stream out = t
"""


def unit(name: str, function=lambda value: 2 * value) -> UnitPrototype:
    return UnitPrototype(name, "number", ("number",), lambda: of_values(function), samplewise=True)


TWICE, PLUS, NEXT = unit("twice"), unit("plus", lambda value: value + 1), unit("next", lambda value: value + 0.5)
CHAIN = """source number raw
compunit number twice(number)
compunit number plus(number)
compunit number next(number)
strmgen r = raw
strmgen a = twice(r)
strmgen b = plus(a)
strmgen c = next(b)
stream first = a
stream out = c
"""


def heard(guest: Guest, kind: type) -> list:
    return [message for message in guest.heard if isinstance(message, kind)]


def test_what_a_host_offers_is_made_there_and_nobody_sees_where() -> None:
    here, there = Site(TEXT), Site(TEXT)
    here.instance.offer([TWICE], here.now_us)
    there.open(TWICE)
    for site in (here, there):
        site.push("raw", 1_000_010, 1_000_020, 1_000_030)
    assert there.values("out") == here.values("out") == [2_000_020.0, 2_000_040.0, 2_000_060.0]
    assert [each.valid_us for each in there.samples["out"]] == [each.valid_us for each in here.samples["out"]]
    assert here.links == there.links == {"out": [True]}


def test_nothing_is_made_at_a_host_that_nobody_wants() -> None:
    site = Site(TEXT.replace("stream out = t\n", ""))
    guest = site.open(TWICE)
    site.push("raw", 1_000_010)
    assert not heard(guest, Begin)
    site.declare(TEXT)
    site.settle()
    assert [message.label for message in heard(guest, Begin)] == ["t"]
    site.declare("")
    site.settle()
    assert len(heard(guest, End)) == 1


def test_when_a_host_goes_its_clients_are_told_and_served_again_without_connecting_again() -> None:
    site = Site(TEXT)
    guest = site.open(TWICE)
    site.push("raw", 1_000_010)
    site.leave(guest)
    site.push("raw", 1_000_020)
    site.open(TWICE)
    site.push("raw", 1_000_030)
    assert site.values("out") == [2_000_020.0, 2_000_060.0]
    assert site.links == {"out": [True, False, True]}
    assert "gone" in site.notes[1]


def test_a_host_that_falls_silent_is_missed_and_taken_back_when_it_speaks_again() -> None:
    site = Site(TEXT)
    guest = site.open(TWICE)
    site.wait(SILENT_US, beating=[guest])
    assert site.links["out"] == [True]
    guest.is_frozen = True
    site.wait(SILENT_US + 300_000)
    assert site.links["out"] == [True, False]
    guest.is_frozen = False
    site.beat(guest)
    site.push("raw", site.now_us + 10)
    assert site.links["out"] == [True, False, True]
    assert len(site.values("out")) == 1
    assert len(guest.welcomed) == 2


def test_a_platform_that_stood_still_itself_does_not_take_its_hosts_for_silent() -> None:
    site = Site(TEXT)
    guest = site.open(TWICE)
    site.now_us += 10 * SILENT_US
    site.desk.on_time(site.now_us)
    site.beat(guest)
    site.wait(SILENT_US, beating=[guest])
    assert site.links["out"] == [True]


def test_who_connects_and_does_not_register_is_sent_away() -> None:
    site = Site()
    site.desk.on_event(HostCame(site.now_us, 1), site.now_us)
    site.desk.on_time(site.now_us + SILENT_US)
    assert site.desk.flush() == [DropHost(1)]
    assert site.desk.deadline_us is None


PERCENT = Sort("gas", unit="percent")
METER = UnitPrototype("meter", "gas", ("number",), lambda: of_values(abs), checked_sorts=(PERCENT,))


@pytest.mark.parametrize(
    ("text", "offered", "why"),
    [
        ("", [TWICE, unit("taken")], "taken"),
        (TEXT, [UnitPrototype("twice", "number", ("number", "number"), lambda: of_values(max))], "declared as"),
        (TEXT, [SourcePrototype("own", "number", label="r")], "exists already"),
        ("sort gas in ppm\n", [METER], "the sort gas is gas in ppm here; meter is offered with gas in percent"),
        ("", [SourcePrototype("one", "number", label="x"), SourcePrototype("other", "number", label="x")], ""),
    ],
)
def test_a_host_with_something_that_cannot_be_taken_is_refused_whole_and_nothing_has_changed(
    text, offered, why
) -> None:
    site = Site(text)
    site.instance.offer([unit("taken")], site.now_us)
    before = site.instance.prototypes.all(), site.network.labels(), dict(site.links)
    guest = site.open(*offered)
    assert not guest.is_there
    assert why in "".join(guest.refused)
    assert (site.instance.prototypes.all(), site.network.labels(), dict(site.links)) == before
    assert not site.desk.hosts


def test_there_is_room_for_so_many_hosts() -> None:
    site = Site()
    guests = [site.open(unit(f"u{number}")) for number in range(MAX_HOSTS + 1)]
    assert [guest.is_there for guest in guests] == [True] * MAX_HOSTS + [False]
    site.leave(guests[0])
    assert site.open(unit("late")).welcomed


def test_a_host_registers_stream_generators_of_its_own_which_are_read_on_demand() -> None:
    site = Site()
    camera = SourcePrototype("camera", "picture", label="picture[self]")
    guest = site.open(camera)
    label = Label("picture", ("0",))
    assert guest.welcomed[0].labels == ("picture[0]",)
    assert site.network.has(label)
    assert not guest.read
    got: list[Sample] = []
    links: list[bool] = []
    proxy = site.network.connect(label, Policy(), got.append, links.append)
    site.settle()
    (process,) = guest.read
    site.made(guest, process, Sample(0, 5, "a cat", Quality(0.9)))
    site.leave(guest)
    again = site.open(camera)
    (process,) = again.read
    site.made(again, process, Sample(0, 6, "a dog"))
    proxy.cancel()
    site.settle()
    assert not again.read
    assert [(each.valid_us, each.value, each.quality.certainty) for each in got] == [(5, "a cat", 0.9), (6, "a dog", 1)]
    assert links == [True, False, True]


def test_what_is_wanted_of_a_source_is_told_and_told_again_when_it_changes() -> None:
    site = Site()
    guest = site.open(SourcePrototype("camera", "picture", label="picture"))
    sampled = Policy.parse("sample every 100, from 0")
    slow = site.network.connect(Label("picture"), sampled, lambda _sample: None)
    site.settle()
    assert [(begin.prototype, begin.grid) for begin in heard(guest, Begin)] == [("camera", (100_000, 0))]
    fast = site.network.connect(Label("picture"), Policy.parse("sample every 40, from 0"), lambda _sample: None)
    site.settle()
    fast.cancel()
    everything = site.network.connect(Label("picture"), Policy(), lambda _sample: None)
    site.settle()
    everything.cancel()
    slow.cancel()
    site.settle()
    assert [want.grid for want in heard(guest, Want)] == [(20_000, 0), (100_000, 0), None, (100_000, 0)]
    assert not guest.read


def test_the_past_of_what_a_host_makes_cannot_be_had_and_the_earliest_time_is_told() -> None:
    site = Site(TEXT.replace("stream out = t\n", "stream kept = r\n"))
    site.open(TWICE)
    site.push("raw", 1_000_010)
    with pytest.raises(ValueNotAvailable, match="earliest possible"):
        site.network.connect(Label("t"), Policy(), lambda _sample: None, from_us=5)


def test_a_unit_that_needs_the_past_of_its_inputs_gets_it_and_what_it_makes_of_it_is_history() -> None:
    @computational_unit("number", "number", name="twice", history_us=1_000_000)
    class Sum:
        def __init__(self) -> None:
            self.sum = 0.0

        def __call__(self, _now_us, sample):
            self.sum += sample.value
            return self.sum

    site = Site(TEXT.replace("stream out = t\n", "stream kept = r\n"))
    site.open(*prototypes_in([Sum]))
    site.push("raw", 1_000_001, 1_000_002)
    site.declare(TEXT + "stream kept = r\n")
    site.settle()
    assert site.values("out") == []
    assert [each.value for each in site.network.generator(Label("t")).history.get_between(0, 2**60)] == [
        1_000_001.0,
        2_000_003.0,
    ]
    site.push("raw", 1_000_003)
    assert site.values("out") == [3_000_006.0]


def test_what_a_unit_does_wrong_is_told_and_ends_nothing() -> None:
    def wrong(value: float):
        return {1_000_001.0: [1], 1_000_002.0: float("nan"), 1_000_003.0: 1 / (value - 1_000_003)}.get(value, value)

    site = Site(TEXT)
    site.open(unit("twice", lambda value: [1] if value == 1_000_001 else float("nan") if value == 1_000_002 else 1 / (value - 1_000_003)))  # fmt: skip
    site.push("raw", 1_000_001, 1_000_002, 1_000_003, 1_000_004)
    assert site.values("out") == [1.0]
    assert [label for label, _said in site.faults] == [Label("t")] * 3
    assert "list" in site.faults[0][1]
    assert "nan cannot be handed" in site.faults[1][1]
    assert "ZeroDivisionError" in site.faults[2][1]


def test_a_host_that_does_not_take_costs_no_memory_and_keeps_the_newest() -> None:
    site = Site(TEXT)
    guest = site.open(TWICE)
    guest.is_frozen = True
    site.push("raw", *range(1_000_001, 1_000_001 + 3 * KEPT), settle=False)
    site.perform(site.desk.flush())
    site.push("raw", *range(2_000_001, 2_000_001 + 3 * KEPT))
    assert sum(len(message) for message in guest.unheard) < 40 * WINDOW
    (host,) = site.desk.hosts
    assert host.dropped == 6 * KEPT - WINDOW - KEPT
    guest.is_frozen = False
    site.settle()
    assert len(site.values("out")) == WINDOW + KEPT
    assert site.values("out")[-1] == 2.0 * (2_000_000 + 3 * KEPT)
    assert len(site.faults) == 1


def test_a_batch_is_waited_for_and_answered_at_once() -> None:
    site = Site(TEXT)
    guest = site.open(TWICE, batch=4)
    site.push("raw", *range(1_000_001, 1_000_004))
    assert site.values("out") == []
    site.push("raw", *range(1_000_004, 1_000_011), settle=False)
    site.perform(site.desk.flush())
    guest.work(site.now_us)
    assert len(guest.outbox.take()) == 1
    site.settle()


def test_with_trains_a_chain_is_one_action_and_its_samples_make_no_detour() -> None:
    plain, train = Site(CHAIN), Site(CHAIN)
    chained = train.open(TWICE, PLUS, NEXT, train=True)
    detoured = plain.open(TWICE, PLUS, NEXT)
    for site in (plain, train):
        site.push("raw", 1_000_001)
        site.push("raw", 1_000_002, 1_000_003)
    assert train.values("out") == plain.values("out") == [2_000_003.5, 2_000_005.5, 2_000_007.5]
    assert train.values("first") == plain.values("first")
    assert [(each.process, each.maker) for each in heard(chained, Chain)] and not heard(detoured, Chain)
    assert {each.process for each in heard(chained, HostInputs)} != {
        each.process for each in heard(detoured, HostInputs)
    }


@given(st.lists(st.sampled_from(["push", "work", "say", "hear", "begin", "end", "narrow", "widen"]), max_size=60))
@example(
    [
        "push",
        "hear",
        "work",
        "push",
        "hear",
        "work",
        "begin",
        *["say"] * 4,
        "hear",
        "say",
        "say",
        "push",
        "hear",
        "work",
    ]
)
def test_no_sample_is_lost_or_doubled_while_chains_come_and_go(steps: list[str]) -> None:
    """Messages of both sides are under way while streams, and with them chains, begin and end."""
    site = Site(CHAIN)
    guest = site.open(TWICE, PLUS, NEXT, train=True)
    number, begun, unsaid = 0, [0], list[bytes]()
    for step in [*steps, *["say"] * len(steps) * 4]:
        match step:
            case "push":
                number += 1
                site.push("raw", 1_000_000 + 1_000 * number, settle=False)
            case "hear":
                site.perform(site.desk.flush())
            case "work":
                guest.work(site.now_us)
                unsaid += guest.outbox.take()
            case "say" if unsaid:
                site.desk.on_event(HostMessage(site.now_us, guest.number, unsaid.pop(0)), site.now_us)
            case "begin" | "end":
                extra = "strmgen d = plus(b)\nstrmgen e = next(d)\nstream other = e\n" if step == "begin" else ""
                site.declare(CHAIN + extra)
                if step == "end":
                    begun.append(len(site.values("other")))
            case "narrow" | "widen":
                site.instance.streams["out"].change(Policy.parse("sample every 1" if step == "narrow" else ""))
    site.settle()
    assert site.values("out") == [2.0 * (1_000_000 + 1_000 * each) + 1.5 for each in range(1, number + 1)]
    others = site.values("other")
    for begins, ends in pairwise([*begun, len(others)]):
        assert all(after - before == 2000.0 for before, after in pairwise(others[begins:ends]))
    assert not site.faults


def test_a_chain_that_is_sampled_is_none() -> None:
    site = Site(CHAIN.replace("plus(a)", "plus(a with sample every 2)"))
    guest = site.open(TWICE, PLUS, NEXT, train=True)
    site.push("raw", 1_000_000, 1_001_000, 1_002_000)
    assert site.values("out") == [2_000_001.5, 2_004_001.5]
    begun = {begin.label: begin.process for begin in heard(guest, Begin)}
    assert [(each.process, each.maker) for each in heard(guest, Chain)] == [(begun["c"], begun["b"])]


def test_a_process_can_be_replaced_by_one_at_a_host_and_back() -> None:
    site = Site(TEXT)
    site.instance.offer([unit("twice", lambda value: value)], site.now_us)
    site.push("raw", 1_000_001)
    site.instance.withdraw(["twice"], site.now_us)
    guest = site.open(TWICE)
    site.push("raw", 1_000_002)
    site.leave(guest)
    site.instance.offer([TWICE], site.now_us)
    site.push("raw", 1_000_003)
    assert isinstance(site.network.process(Label("t")), RefinementProcess)
    assert site.values("out") == [1_000_001.0, 2_000_004.0, 2_000_006.0]


@given(st.lists(st.binary(max_size=200), max_size=20))
def test_hostile_bytes_end_one_connection_and_change_nothing(payloads: list[bytes]) -> None:
    site = Site(TEXT)
    good = site.open(TWICE)
    for number, payload in enumerate(payloads, 100):
        site.guests[number] = Guest(number, good.host)
        site.desk.on_event(HostCame(site.now_us, number), site.now_us)
        site.desk.on_event(HostMessage(site.now_us, number, payload), site.now_us)
        site.perform(site.desk.flush())
        assert not site.guests[number].is_there
        del site.guests[number]
    site.push("raw", 1_000_001)
    assert site.values("out") == [2_000_002.0]
    assert site.desk.malformed == len(payloads)


def test_the_graph_says_what_is_made_at_a_host_and_the_governor_leaves_it_there() -> None:
    site = Site(TEXT)
    site.open(TWICE)
    node = next(node for node in graph_of(site.instance).nodes if node.name == "t")
    assert (node.kind, node.made_by, node.running) == ("unit", "twice at a host", True)
    assert Governor(site.instance, lambda: 0, 0)._unit("twice") is None


def test_the_sorts_of_a_host_are_those_that_its_module_declares_and_its_values_are_checked() -> None:
    text = (
        "source number raw\nstrmgen raw = raw\ncompunit gas meter(number)\nstrmgen gas = meter(raw)\nstream out = gas\n"
    )
    site = Site(text)
    assert site.open(METER).is_there
    assert site.network.generator(Label("gas")).sort == PERCENT
    with pytest.raises(TextErrors, match="the sort gas is declared already, as gas in percent"):
        site.instance.change(parse_specification(f"{text}sort gas in ppm\n"), site.now_us)


def test_a_stream_of_a_host_is_asked_for_by_its_own_label_while_the_host_is_there() -> None:
    site = Site()
    guest = site.open(SourcePrototype("gauge", "number", label="level[self]"))
    asked = DeclaredStreams("0", site.network, Unshared(), Unshared(), site.instance)
    assert asked.find("1", "level[self]") == asked.find("1", "level[0]") == Label("level", ("0",))
    site.network.add_source(Label("inner"), Sort("number"))
    with pytest.raises(UnknownLabel):
        asked.find("1", "inner")
    site.leave(guest)
    with pytest.raises(UnknownLabel):
        asked.find("1", "level[self]")


class Unshared:
    """Translation and agreements of a platform that shares nothing under semantic labels."""

    def check_stream(self, *_who) -> None:
        """Anybody may ask."""

    def semantic_label(self, *_what) -> None:
        """None."""
