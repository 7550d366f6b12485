"""Who opens a new session when heartbeats, tokens and a halt say that links are not what they seem."""

from collections.abc import Iterable
from itertools import pairwise, product

import pytest

from dyknow.federation.members.deafness import DeafnessWatchdog
from dyknow.federation.members.liveness import Peer
from tests.federation.directories import Directories, three

US = 1_000_000


def reopened(box: Directories) -> dict[str, int]:
    return {unit: len(box.reopened(unit)) for unit in box.nodes if box.reopened(unit)}


def deafen(box: Directories, one: Iterable[str], other: Iterable[str]) -> None:
    """Neither of the two groups hears the other, until new sessions are opened."""
    for a, b in product(one, other):
        box.wire.deafen(a, b)
        box.wire.deafen(b, a)


def test_a_pair_that_others_hear_is_reopened_by_one_side_within_eight_seconds() -> None:
    box = three()
    start_us = box.now_us
    deafen(box, ["0"], ["1"])
    box.run(8)
    assert reopened(box) == {"1": 1}, "the greater unit of the pair"
    assert box.reopened("1")[0] - start_us < 7 * US
    assert box.present("0") == {"1", "2"}
    assert box.present("1") == {"0", "2"}


def test_a_session_that_is_deaf_to_most_is_reopened_and_nobody_else_is() -> None:
    box = Directories()
    units = [str(number) for number in range(8)]
    for unit in units:
        box.enter(unit)
    box.run(2)
    deafen(box, ["3"], [unit for unit in units if unit not in ("3", "5")])
    box.run(8)
    assert reopened(box) == {"3": 1}
    assert all(len(box.present(unit)) == 7 for unit in units)


@pytest.mark.parametrize("speaker", ["0", "1"])
def test_a_one_way_cut_is_mended_within_eight_seconds_by_one_side(speaker: str) -> None:
    for others in ((), ("2", "3")):
        box = Directories()
        for unit in ("0", "1", *others):
            box.enter(unit)
        box.run(2)
        listener = "1" if speaker == "0" else "0"
        box.wire.deafen(speaker, listener)
        box.run(8)
        assert sum(reopened(box).values()) == 1
        assert listener in box.present(speaker)
        assert speaker in box.present(listener)


def test_who_hears_nobody_any_more_reopens() -> None:
    for box in (two_alone := Directories(), three()):
        if box is two_alone:
            box.enter("0")
            box.enter("1")
            box.run(2)
        deafen(box, ["0"], [unit for unit in box.nodes if unit != "0"])
        box.run(8)
        assert reopened(box).get("0") == 1
        assert all(box.present(unit) == box.nodes.keys() - {unit} for unit in box.nodes)


def test_reopening_that_does_not_help_is_repeated_ever_more_rarely() -> None:
    box = three()
    box.wire.deaf |= {("0", "1"), ("1", "0")}
    box.run(300)
    for unit in box.nodes:
        gaps = [b - a for a, b in pairwise(box.reopened(unit))]
        assert all(gap >= 6 * US for gap in gaps)
        assert all(gap >= 59 * US for gap in gaps[7:])
        assert len(box.reopened(unit)) <= 12
    assert not box.reopened("2"), "who hears both has no reason"


@pytest.mark.parametrize("silent_s", [0.0, 4.0])
def test_who_hears_a_platform_whose_token_is_not_told_again_reopens(silent_s: float) -> None:
    """As when a link is new to one side, and to the other one more of those it had: only one side declares anew."""
    box = three()
    token = box.token("2")
    if silent_s:
        box.wire.deaf |= {("2", "0"), ("0", "2")}
    box.directory("0").on_token(token, False, box.now_us)
    box.run(silent_s)
    box.wire.deaf.clear()
    heard_us = box.now_us
    box.run(4)
    assert reopened(box) == {"0": 1}
    assert box.reopened("0")[0] - heard_us < 3 * US
    box.directory("0").on_token(token, True, box.now_us)
    box.run(30)
    assert reopened(box) == {"0": 1}


def test_a_token_that_is_told_again_is_no_reason_to_reopen() -> None:
    box = three()
    directory, token = box.directory("0"), box.token("2")
    directory.on_token(token, False, box.now_us)
    box.run(1.5)
    directory.on_token(token, True, box.now_us)
    box.run(10)
    assert reopened(box) == {}


def test_a_process_that_stood_still_and_whose_links_have_not_come_back_reopens() -> None:
    box = three()
    box.freeze("2")
    box.run(2.5)
    deafen(box, ["2"], ["0", "1"])
    thawed_us = box.now_us
    box.thaw("2")
    box.run(10)
    assert reopened(box) == {"2": 1}
    assert 3 * US <= box.reopened("2")[0] - thawed_us < 4 * US
    assert box.present("2") == {"0", "1"}


def test_a_process_that_stood_still_and_is_linked_again_goes_on_with_its_session() -> None:
    box = three()
    box.freeze("2")
    box.run(2.5)
    box.thaw("2")
    box.run(10)
    assert reopened(box) == {}
    assert box.present("2") == {"0", "1"}


def test_who_is_late_itself_judges_nobody_until_it_has_been_on_time() -> None:
    peer = Peer("1", 0)
    peer.seq, peer.heard_us, peer.tokens = 1, 20 * US, {"z": 0}
    watchdog, now_us = DeafnessWatchdog("0", 0), 0
    for _ in range(100):  # a minute and more on a machine that is too busy
        now_us = watchdog.deadline_us + 400_000
        assert watchdog.on_time({"1": peer}, now_us) is None
    calm_us = now_us
    while (why := watchdog.on_time({"1": peer}, now_us)) is None:
        now_us = watchdog.deadline_us
    assert why == "no peer is heard"
    assert 3 * US <= now_us - calm_us < 4 * US


def test_a_short_halt_or_one_alone_is_no_reason_to_reopen() -> None:
    for box, halt_s in ((three(), 1.0), (alone := Directories(), 10.0)):
        if box is alone:
            box.enter("2")
            box.run(2)
        box.freeze("2")
        box.run(halt_s)
        box.thaw("2")
        box.run(10)
        assert reopened(box) == {}


def test_a_partition_is_no_deafness_of_sessions() -> None:
    box = Directories()
    for unit in ("0", "1", "2", "3"):
        box.enter(unit)
    box.run(2)
    box.partition(["0", "1"], ["2", "3"])
    box.run(15)
    assert reopened(box) == {}
    assert box.present("0") == {"1"}
    box.heal(["0", "1"], ["2", "3"])
    box.run(2)
    assert all(len(box.present(unit)) == 3 for unit in box.nodes)


def test_a_killed_or_left_or_new_platform_is_no_deafness() -> None:
    box = three()
    box.vanish("2")
    box.run(30)
    box.enter("2")
    box.run(10)
    box.kill("2")
    box.run(10)
    assert reopened(box) == {}
