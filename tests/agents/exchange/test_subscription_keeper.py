"""What a platform's monitors live on keeps coming, or comes again: after silence, loss, cuts and deaths."""

from itertools import pairwise
from random import Random

import pytest

from dyknow import US_PER_S
from dyknow.agents.platform import Platform
from dyknow.federation import keys
from dyknow.federation.messages.codec import decode_act
from dyknow.federation.messages.contents import MonitorProximity
from dyknow.federation.sharing.streams import ImportStream
from dyknow.federation.transport import Put
from tests.box import Box, Vehicle

UNITS = ("0", "1", "2", "3")
PERIOD_US = 100_000


@pytest.fixture
def task(wire: Box) -> str:
    """Four platforms that watch their distances, a command centre, and the conversation of the task."""
    for number, unit in enumerate(UNITS):
        wire.join(unit, Vehicle(east_m=500.0 * number), simulated=True)
    wire.centre()
    wire.run(1.0)
    asked = wire.question("cc", "0", MonitorProximity(avoidance=False))
    wire.run(4.0)
    assert watched(wire) == {(a, b): "fresh" for a in UNITS for b in UNITS if a != b}
    return asked.conversation


def watched(wire: Box) -> dict[tuple[str, str], str]:
    """The state of the inputs of everybody's `proximity`, by pair."""
    return {
        (unit, member): instance.monitor.inputs
        for unit in UNITS
        for named in [wire.platform(unit).built.monitors.named.get("proximity")]
        if named is not None
        for member, instance in named.instances.items()
    }


def alike(state: str) -> dict[tuple[str, str], str]:
    return {(a, b): state for a in UNITS for b in UNITS if a != b}


def streams(wire: Box) -> dict[tuple[str, str, str], ImportStream]:
    """The imported streams, by (receiver, owner, label)."""
    return {
        (unit, owner, label): found.stream
        for unit in UNITS
        for (owner, label, _), found in wire.platform(unit).built.gateway.importer.imports.streams.items()
    }


def cut(wire: Box, one: str, others: tuple[str, ...], *, one_way: bool = False) -> None:
    for other in others:
        wire.wire.deaf.add((one, other))
        if not one_way:
            wire.wire.deaf.add((other, one))


def act_of(put: Put) -> str:
    """The head of the content of an act, or nothing."""
    if not put.key.startswith("acl/") or put.key.endswith("/receipt"):
        return ""
    content = decode_act(put.payload)[0].content
    return "" if content is None else content.head


def received(wire: Box) -> dict[tuple[str, str, str], int]:
    return {name: stream.account.received for name, stream in streams(wire).items()}


def assert_nothing_lost(wire: Box, before: dict[tuple[str, str, str], int], seconds: float) -> None:
    after = streams(wire)
    due = round(seconds * US_PER_S / PERIOD_US)
    assert before
    came = {name: after[name].account.received - count for name, count in before.items()}
    assert {name: count for name, count in came.items() if count < due - 3} == {}
    assert {name: s.account.lost for name, s in after.items() if s.account.lost or s.missing} == {}


@pytest.mark.parametrize("seconds", [2.0, 4.0, 15.0])
def test_a_cut_that_heals_costs_no_sample(wire: Box, task: str, seconds: float) -> None:
    before = received(wire)
    cut(wire, "2", ("0", "1", "3"))
    wire.run(seconds)
    wire.wire.deaf.clear()
    wire.run(10.0)
    assert_nothing_lost(wire, before, seconds + 10.0)
    assert watched(wire) == alike("fresh")


@pytest.mark.parametrize("away", UNITS[:2])
def test_a_platform_that_stood_still_is_watched_again_and_the_task_goes_on(wire: Box, task: str, away: str) -> None:
    node = wire.nodes[away]
    wire.freeze(away)
    wire.run(6.0)
    wire.thaw(away)
    wire.run(8.0)
    assert watched(wire) == alike("fresh")
    assert [t.name for u in UNITS for t in wire.platform(u).built.tasks.all() if not t.is_part] == ["monitor-proximity"]
    assert node.platform.ports.directory.is_present("0")


def test_a_question_that_is_lost_ends_no_stream_that_another_would_have_followed(wire: Box, task: str) -> None:
    """A receiver that hears nothing asks anew; its cancel of what stood must not arrive where the question did not."""
    before = received(wire)
    wire.wire.drop = lambda sender, receiver, put: (
        "2" in (sender, receiver) and (keys.parse_key(put.key) is None or not put.key.startswith("hb/"))
    )
    wire.run(2.3)
    wire.wire.drop = lambda _sender, _receiver, put: act_of(put) == "create-multicast"
    wire.run(0.6)
    wire.wire.drop = lambda _sender, _receiver, _put: False
    wire.run(6.0)
    assert_nothing_lost(wire, before, 8.9)


def test_what_was_asked_for_before_a_cut_ends_with_the_task_after_it(wire: Box, task: str) -> None:
    cut(wire, "2", ("0", "1", "3"))
    wire.run(6.0)
    wire.wire.deaf.clear()
    wire.run(8.0)
    (leader,) = [u for u in UNITS for t in wire.platform(u).built.tasks.all() if not t.is_part]
    wire.cancel_task("cc", leader, task)
    wire.run(10.0)
    assert watched(wire) == {}
    for unit in UNITS:
        platform: Platform = wire.platform(unit)
        assert platform.built.gateway.exporter.exports.streams() == []
        assert platform.built.tasks.all() == []


def test_a_task_cancelled_during_a_cut_ends_behind_it_after_it(wire: Box, task: str) -> None:
    cut(wire, "2", ("0", "1", "3", "cc"))
    wire.run(6.0)
    wire.cancel("cc", "0", task)
    wire.run(4.0)
    assert {unit for unit, _ in watched(wire)} == {"2"}
    wire.wire.deaf.clear()
    wire.run(20.0)
    assert watched(wire) == {}
    assert [t.name for u in UNITS for t in wire.platform(u).built.tasks.all()] == []


@pytest.mark.parametrize(("pair", "seconds"), [(("0", "1"), 8.0), (("0", "1"), 25.0), (("1", "2"), 15.0)])
def test_a_pair_that_cannot_hear_each_other_for_a_while_misses_no_sample(
    wire: Box, task: str, pair: tuple[str, str], seconds: float
) -> None:
    before = received(wire)
    cut(wire, pair[0], (pair[1],))
    wire.run(seconds)
    wire.wire.deaf.clear()
    wire.run(15.0)
    assert_nothing_lost(wire, before, seconds + 15.0)
    assert watched(wire) == alike("fresh")


@pytest.mark.parametrize("seed", [0, *(pytest.param(n, marks=pytest.mark.full) for n in range(1, 100))])
def test_whatever_cuts_come_one_after_the_other_no_sample_is_missed(wire: Box, task: str, seed: int) -> None:
    rng = Random(seed)
    before, lasted = received(wire), 0.0
    pairs = [(a, b) for a in UNITS for b in UNITS if a < b]
    for _ in range(3):
        for one, other in rng.sample(pairs, rng.choice([1, 1, 2, 3])):
            cut(wire, one, (other,))
        broken, mended = rng.choice([2.0, 3.0, 5.0, 8.0, 15.0]), rng.choice([3.0, 6.0, 10.0])
        wire.run(broken)
        wire.wire.deaf.clear()
        wire.run(mended)
        lasted += broken + mended
    wire.run(10.0)
    assert_nothing_lost(wire, before, lasted + 10.0)
    assert watched(wire) == alike("fresh")


def test_who_stays_silent_is_asked_less_and_less_often_and_at_once_after_it_was_heard(wire: Box, task: str) -> None:
    def asked(since_us: int) -> list[int]:
        """When platform 1 asked platform 2 for streams."""
        return [
            crossed.at_us
            for crossed in wire.wire.log
            if crossed.at_us >= since_us
            and crossed.put.key.startswith("acl/2/1/")
            and act_of(crossed.put) == "create-multicast"
        ]

    def silence(seconds: float) -> list[int]:
        since_us = wire.now_us
        wire.wire.drop = lambda sender, _receiver, put: sender == "2" and put.key.startswith("x/")
        wire.run(seconds)
        wire.wire.drop = lambda _sender, _receiver, _put: False
        return asked(since_us)

    times = silence(30.0)
    pauses = [later - sooner for sooner, later in pairwise(times)]
    assert len(times) <= 8
    assert pauses == sorted(pauses)
    assert pauses[-1] >= 5_500_000
    wire.run(8.0)
    assert watched(wire) == alike("fresh")
    assert len(silence(4.0)) == 2, "after 1.2 s, and 1.5 s later"
