"""A platform with too much to do sends less, by importance, says so, and does all again when there is time."""

from collections import defaultdict
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.agents.effects import Pressed
from dyknow.agents.exchange.options import SheddingOptions
from dyknow.agents.options import Chosen
from dyknow.agents.shedding import EASIER_US, EVERY, HARDER_US, Shedding
from dyknow.federation import keys
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.codec import decode_samples, encode_samples
from dyknow.federation.messages.contents import ImportList, MonitorProximity
from dyknow.reasoning.monitoring.monitors import Monitor
from tests.agents.exchange.test_federation_agent import multicast
from tests.box import Box
from tests.strategies import examples

PERIOD_US = 200_000


def press(wire: Box, unit: str, part: float, seconds: float = 0.0) -> None:
    """The process of `unit` measures twice a second that its thread waits for this part of the time."""
    until_us = wire.now_us + round(seconds * 1e6)
    while True:
        wire.happens(unit, Pressed(wire.now_us, part))
        if wire.now_us >= until_us:
            return
        wire.run(0.5)


def put_by(wire: Box, owner: str, since: int) -> dict[str, list[tuple[int, int]]]:
    """By label, the valid times that `owner` has sent since that many puts, with the `every` of their messages."""
    found = defaultdict[str, list[tuple[int, int]]](list)
    for crossed in wire.wire.log[since:]:
        key = keys.parse_key(crossed.put.key)
        if type(key) is keys.StreamKey and key.owner == owner:
            said = decode_samples(crossed.put.payload)
            for label, samples in ((key.label, said.samples), *((each.label, each.samples) for each in said.riders)):
                found[label] += [(sample.valid_us, said.every) for sample in samples]
    return found


def shown(wire: Box, unit: str, by: str = "0") -> list[str]:
    """What `by` sees as conditions of `unit`."""
    entry = wire.platform(by).ports.directory.entry(unit)
    assert entry is not None
    return [condition.text for condition in entry.conditions]


@pytest.fixture
def pair(wire: Box) -> Box:
    """Platform 1 exports its position and altitude to 0; altitude is four times as important."""
    wire.fly("0", 0, 0)
    wire.fly("1", 500, 0)
    wire.run(1.0)
    wire.platform("1").built.exporter.rank("heli-altitude", 4.0)
    wire.asked("0", "1", multicast("heli-position", "heli-altitude", to=("0",)))
    wire.run(1.0)
    return wire


def test_the_less_important_streams_are_sent_less_often_on_a_coarser_grid_and_every_message_says_so(pair: Box) -> None:
    press(pair, "1", 0.6, 0.1 + HARDER_US / 1e6)
    since = len(pair.wire.log)
    pair.run(8.0)
    sent = put_by(pair, "1", since)
    assert [valid_us % (8 * PERIOD_US) for valid_us, _ in sent["heli-position"]] == [0] * 5
    assert [valid_us % (2 * PERIOD_US) for valid_us, _ in sent["heli-altitude"]] == [0] * 20
    assert {every for _, every in sent["heli-position"]} == {8}
    assert {every for _, every in sent["heli-altitude"]} == {2}
    exporter = pair.platform("1").built.exporter
    assert exporter.omitted["heli-position"] > exporter.omitted["heli-altitude"] > 0


def test_it_is_shown_and_counted_at_the_receiver_and_no_sample_counts_as_lost(pair: Box) -> None:
    press(pair, "1", 0.6)
    pair.run(3.0)
    assert shown(pair, "1") == ["too busy: streams are sent, and monitors looked at, less often"]
    [listed] = [
        said
        for said in pair.asked("1", "0", ImportList(), Performative.QUERY_REF).contents
        if isinstance(said, ImportList)
    ]
    assert {each.semantic_label: (each.every, each.lost, each.missing) for each in listed.imports or ()} == {
        "heli-position": (2, 0, 0),
        "heli-altitude": (1, 0, 0),
    }


def test_when_there_is_time_again_all_is_sent_within_ten_seconds_and_the_condition_goes(pair: Box) -> None:
    press(pair, "1", 0.9, 30.0)
    assert pair.platform("1").part(Shedding).level == len(EVERY) - 1
    press(pair, "1", 0.02)
    began_us = pair.now_us
    while pair.platform("1").part(Shedding).level:
        pair.run(0.1)
    assert pair.now_us - began_us <= 10_000_000
    pair.run(6.0)
    assert shown(pair, "1") == []
    since = len(pair.wire.log)
    pair.run(2.0)
    assert [every for _, every in put_by(pair, "1", since)["heli-position"]] == [1] * 10


def test_who_did_all_again_too_early_waits_longer(pair: Box) -> None:
    part = pair.platform("1").part(Shedding)

    def calm_s() -> float:
        press(pair, "1", 0.7, 4.5)
        press(pair, "1", 0.05)
        began_us = pair.now_us
        while part.level:
            pair.run(0.1)
        return (pair.now_us - began_us) / 1e6

    assert [round(calm_s() / (EASIER_US / 1e6)) for _ in range(3)] == [3, 4, 6], "and the step from the worst"


def monitored(wire: Box, apart_m: float) -> Monitor:
    """That of platform 0 over platform 1, so far north of it."""
    for unit, north_m in (("0", 0.0), ("1", apart_m)):
        wire.fly(unit, north_m, 0)
    wire.centre()
    wire.run(1.0)
    wire.asked("cc", "0", MonitorProximity())
    wire.run(4.0)
    return wire.platform("0").built.monitors.named["proximity"].instances["1"].monitor


def test_monitors_go_on_with_half_of_the_samples_and_are_unknown_with_less(wire: Box) -> None:
    monitor = monitored(wire, 300)
    assert monitor.inputs == "fresh"
    press(wire, "1", 0.6)
    seen = set()
    for _ in range(50):
        wire.run(0.1)
        seen.add((monitor.inputs, monitor.shows))
    assert seen == {("fresh", "ok")}
    assert not monitor.counted
    press(wire, "1", 0.6)
    assert wire.platform("1").part(Shedding).level == 2
    wire.run(2.0)
    for _ in range(50):
        wire.run(0.1)
        seen.add((monitor.inputs, monitor.shows))
    assert seen == {("fresh", "ok"), ("stale", "unknown")}, "each time for as long as the policy allows"
    press(wire, "1", 0.0)
    wire.run(10.0)
    assert (monitor.inputs, monitor.shows) == ("fresh", "ok")


def test_while_an_alarm_is_open_monitors_get_what_they_need(wire: Box) -> None:
    monitor = monitored(wire, 5)
    assert monitor.shows == "alarm"
    for unit in ("0", "1"):
        press(wire, unit, 0.9, 3.0)
    wire.run(5.0)
    assert wire.platform("1").part(Shedding).level == 2
    assert (monitor.inputs, monitor.shows) == ("fresh", "alarm")


def test_a_member_that_says_it_sends_less_and_does_so_is_shown_as_unknown(wire: Box) -> None:
    """Whoever has a valid key may claim it; nothing is shown as safe because of it."""
    wire.fly("0", 0, 0)
    wire.fly("1", 300, 0)
    wire.centre()
    wire.run(1.0)
    wire.asked("cc", "0", MonitorProximity())
    wire.run(4.0)
    monitor = wire.platform("0").built.monitors.named["proximity"].instances["1"].monitor
    key = next(crossed.put.key for crossed in wire.wire.log if crossed.put.key.startswith("x/1/"))
    wire.wire.drop = lambda _by, _to, put: put.key.startswith("x/1/")
    wire.put(key, encode_samples(wire.platform("1").config.boot, (), every=16))
    wire.run(2.0)
    assert (monitor.inputs, monitor.shows) == ("stale", "unknown")


def test_who_may_not_shed_sends_all(wire: Box) -> None:
    platform = wire.fly("0", 0, 0, options=Chosen(SheddingOptions(shedding=False)))
    wire.run(0.5)
    press(wire, "0", 1.0, 5.0)
    assert (platform.part(Shedding).level, platform.built.exporter.shed) == (0, 1)


@settings(max_examples=examples(8), deadline=None)
@given(st.integers(0, 2**32))
def test_whatever_is_measured_the_level_follows_and_everything_comes_back(seed: int) -> None:
    wire, random = Box(), Random(seed)
    wire.fly("0", 0, 0)
    wire.run(0.5)
    part = wire.platform("0").part(Shedding)
    for _ in range(40):
        press(wire, "0", random.choice([0.0, 0.05, 0.12, 0.2, 0.3, 0.31, 0.55, 0.56, 1.0]))
        wire.run(random.choice([0.1, 0.5, 3.0]))
        assert 0 <= part.level < len(EVERY)
        assert wire.platform("0").built.exporter.shed == EVERY[part.level]
    press(wire, "0", 0.0)
    wire.run(60.0)
    assert (part.level, wire.platform("0").built.exporter.shed, tuple(part.conditions())) == (0, 1, ())
