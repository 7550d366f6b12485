"""The map of persons: entries of one person are one place, and what a member makes up takes nothing from others."""

from math import nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.anchoring.saliency.entries import MOST_ENTRIES, PersonEntry
from dyknow.anchoring.saliency.map import SaliencyMap
from dyknow.anchoring.saliency.watching import PersonLook, PersonSearch

NOW_US = 1_700_000_000_000_000
SOUND = PersonEntry(
    "0", "s1", 10.0, 20.0, (0.3, 0.0, 0.3), NOW_US - 9_000_000, NOW_US, 6.0, 0.8, 0.7,
    "0/thermal/1@1,2", "0/colour/1@2,4",
)  # fmt: skip


def mapped(*entries: PersonEntry) -> SaliencyMap:
    saliency = SaliencyMap()
    for entry in entries:
        saliency.take(entry, NOW_US)
    return saliency


def test_entries_of_two_members_of_one_person_are_one_place_between_them():
    other = SOUND._replace(unit="1", symbol="s7", x_m=11.0, since_us=NOW_US - 5_000_000, observed_s=5.0)
    (place,) = mapped(SOUND, other).places()
    assert (place.name, place.by) == ("0:s1", ("0", "1"))
    assert 10.0 < place.x_m < 11.0
    assert place.best is SOUND
    trace = place.covariance[0] + place.covariance[2]
    assert trace <= float(np.trace(SOUND.spread)) + 1e-9


def test_two_persons_that_one_member_sees_at_once_stay_two_however_near_they_are():
    near = SOUND._replace(symbol="s2", x_m=10.5)
    assert len(mapped(SOUND, near, SOUND._replace(unit="1", symbol="s1")).places()) == 2


def test_what_a_member_found_before_it_was_restarted_and_finds_again_is_one_person():
    again = SOUND._replace(symbol="s1001", since_us=NOW_US - 1_000_000, seen_us=NOW_US, observed_s=1.0)
    before = SOUND._replace(since_us=NOW_US - 90_000_000, seen_us=NOW_US - 80_000_000)
    (place,) = mapped(before, again).places()
    assert place.by == ("0",)


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"x_m": nan}, "not a number"),
        ({"y_m": 1e9}, "too far"),
        ({"covariance": (0.3, 9.0, 0.3)}, "no covariance"),
        ({"covariance": (-0.1, 0.0, 0.3)}, "no covariance"),
        ({"covariance": (1e6, 0.0, 1e6)}, "too vague"),
        ({"thermal": 3.0}, "no score"),
        ({"colour": nan}, "not a number"),
        ({"seen_us": NOW_US + 10_000_000}, "another time"),
        ({"since_us": NOW_US + 1}, "another time"),
        ({"since_us": 0}, "another time"),
        ({"observed_s": 1e5}, "observed longer than it was there"),
        ({"symbol": ""}, "no symbol"),
        ({"thermal_image": "x" * 1000}, "no symbol"),
        ({"symbol": "a\x1b[2J"}, "no symbol"),
    ],
)
def test_what_cannot_be_is_refused_and_counted(wrong, reason):
    saliency = mapped(SOUND, SOUND._replace(unit="2", **wrong))
    assert [place.by for place in saliency.places()] == [("0",)]
    assert saliency.gate.refused == {("2", reason): 1}


def test_a_member_that_sends_too_much_is_cut_off_and_the_others_are_not():
    flood = [SOUND._replace(unit="2", symbol=f"f{number}", x_m=10.0 * number) for number in range(1500)]
    saliency = mapped(*flood, SOUND)
    assert saliency.gate.refused["2", "too many entries"] == 1000 - MOST_ENTRIES
    assert saliency.gate.refused["2", "too many reports"] == 500
    assert any("0" in place.by for place in saliency.places())


places = st.tuples(st.floats(-30, 30), st.floats(-30, 30), st.floats(0.0, 4.0), st.booleans())


@given(honest=st.lists(places, max_size=6), false=st.lists(places, max_size=12))
def test_no_entries_of_a_member_take_a_person_from_the_map_that_another_has_found(honest, false):
    def entries(unit, given_places):
        return [
            SOUND._replace(unit=unit, symbol=f"s{at}", x_m=x, y_m=y, covariance=(sd, 0.0, sd))
            for at, (x, y, sd, _) in enumerate(given_places)
        ]

    ours = entries("0", honest)
    shown = [entry.name for place in mapped(*ours, *entries("2", false)).places() for entry in place.entries]
    assert {entry.name for entry in ours} <= set(shown)
    assert len(shown) == len(set(shown))
    for place in mapped(*ours, *entries("2", false)).places():
        assert len([entry for entry in place.entries if entry.unit == "0"]) <= 1


@given(st.permutations(range(6)))
def test_the_order_in_which_entries_come_makes_no_difference(order):
    entries = [SOUND._replace(unit=str(at % 3), symbol=f"s{at}", x_m=10.0 + 1.1 * at) for at in range(6)]
    shown = [(each.name, each.by) for each in mapped(*entries).places()]
    assert [(each.name, each.by) for each in mapped(*(entries[at] for at in order)).places()] == shown


def watched(seconds: float, thermal: float = 0.8, colour: float | None = 0.7, pause_s: float = 0.1) -> PersonSearch:
    search = PersonSearch("0")
    for number in range(round(seconds / pause_s) + 1):
        valid_us = NOW_US + round(number * pause_s * 1e6)
        search.on_look(PersonLook(valid_us, 5.0, 6.0, (0.3, 0.0, 0.3), thermal, colour, "t", "c"))
    return search


def test_a_body_is_a_person_after_five_seconds_of_observation():
    assert not watched(4.9).entries()
    (entry,) = watched(5.0).entries()
    assert (entry.x_m, entry.y_m, entry.thermal) == pytest.approx((5.0, 6.0, 0.8))
    assert entry.observed_s == pytest.approx(5.0)


def test_gaps_are_no_observation_and_what_only_one_channel_sees_is_no_person():
    assert not watched(60.0, pause_s=1.0).entries()
    assert not watched(9.0, thermal=0.2).entries()
    assert not watched(9.0, colour=0.3).entries()
    assert not watched(9.0, colour=None).entries()


def test_looks_that_cannot_be_are_left_out():
    search = watched(5.0)
    for wrong in ({"x_m": nan}, {"covariance": (0.0, 0.0, 0.0)}, {"thermal": 7.0}, {"y_m": 1e300}):
        search.on_look(PersonLook(NOW_US, 5.0, 6.0, (0.3, 0.0, 0.3), 0.8, 0.8)._replace(**wrong))
    assert search.left_out == 4
    assert search.observed == 1
