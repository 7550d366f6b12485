"""A valid member that means harm: it speaks for itself only, within bounds, and what it does is counted and reported."""

import math

import numpy as np
import pytest

from bench.overtakes.recognition import chronicles
from dyknow.anchoring.cooperation.manoeuvres import LATE_US, MOST_WAITING, PairRelation, SpanningManoeuvres
from dyknow.anchoring.cooperation.memory import MOST_OF_ONE
from dyknow.anchoring.cooperation.picture import GlobalPicture
from dyknow.anchoring.cooperation.reports import MOST_REPORTS_S, MOST_TRACKS, IdentityClaim, TrackReport, fault_of
from dyknow.anchoring.links.states import ObjectState, diagonal
from tests.anchoring.cooperation.skies import START_US, Sky, along, state

CAR, NEXT, LAST = along(0.0), along(25.0, 3.5), along(60.0)


def honest(t):
    return {"0": {"a": CAR(t), "b": NEXT(t)}, "1": {"c": CAR(t), "d": NEXT(t), "e": LAST(t)}}


def claim_all(sky, names, tracks):
    """The hostile member claims names for its tracks, since long before."""
    for picture in (sky.pictures["0"], sky.pictures["1"]):
        for symbol, name in zip(tracks, names, strict=False):
            picture.claim(IdentityClaim("9", symbol, name, 1, 2), sky.now_us)


@pytest.mark.parametrize(
    "cars", [(CAR, NEXT, LAST), (NEXT, LAST, CAR), (along(500.0),) * 3], ids=["on", "swapped", "far"]
)
@pytest.mark.parametrize("early", [True, False])
def test_a_member_that_claims_all_cars_gets_none(cars, early) -> None:
    sky = Sky()
    if early:
        for picture in sky.pictures.values():
            picture.arrive("9", sky.now_us)
    sky.run(5, honest)
    before = {key: sky.name(*key) for key in (("a", "0"), ("b", "0"), ("c", "1"), ("d", "1"), ("e", "1"))}
    names = [sky.name("a", "0"), sky.name("b", "0"), sky.name("e", "1")]
    fakes = [f"f{n}" for n in range(3)]
    for _ in range(60):
        sky.run(0.2, honest)
        t = (sky.now_us - START_US) / 1e6
        for picture in sky.pictures.values():
            for fake, car in zip(fakes, cars, strict=True):
                picture.report(TrackReport("9", fake, state(car(t), sky.now_us, 0.2)), sky.now_us)
        claim_all(sky, names, fakes)
    assert {key: sky.name(*key) for key in before} == before
    rows = {each.name: each for each in sky.pictures["0"].rows(sky.now_us)}
    assert abs(rows[names[0]].state.x_m - CAR(17)[0]) < 5.0


def test_a_member_that_was_there_all_the_time_cannot_rename_what_one_member_sees() -> None:
    sky = Sky()
    for picture in sky.pictures.values():
        picture.arrive("9", sky.now_us)
    sky.run(12, honest)
    name = sky.name("e", "1")
    for _ in range(40):
        sky.run(0.2, honest)
        t = (sky.now_us - START_US) / 1e6
        for picture in sky.pictures.values():
            picture.report(TrackReport("9", "f", state(LAST(t), sky.now_us)), sky.now_us)
            picture.claim(IdentityClaim("9", "f", "mine", 1, 2), sky.now_us)
    assert sky.names("e", "1") == {name}
    assert sky.pictures["1"].gate.refused["9", "backdated"] == 1
    assert any(event.kind == "refused" and event.name == "9" for event in sky.pictures["1"].recent)


@pytest.mark.parametrize(
    ("reason", "wrong"),
    [
        ("not a number", ObjectState(0, math.nan, 0.0, 0.0, 0.0, diagonal(1.0, 1.0))),
        ("not a number", ObjectState(0, 0.0, 0.0, 0.0, 0.0, np.full((4, 4), math.nan))),
        ("not a number", ObjectState(0, 0.0, 0.0, 0.0, 0.0, np.eye(3))),
        ("too far or too fast", ObjectState(0, 1e9, 0.0, 0.0, 0.0, diagonal(1.0, 1.0))),
        ("too far or too fast", ObjectState(0, 0.0, 0.0, 1e4, 0.0, diagonal(1.0, 1.0))),
        ("no covariance", ObjectState(0, 0.0, 0.0, 0.0, 0.0, -np.eye(4))),
        ("no covariance", ObjectState(0, 0.0, 0.0, 0.0, 0.0, np.triu(np.ones((4, 4))))),
        ("too vague", ObjectState(0, 0.0, 0.0, 0.0, 0.0, diagonal(1000.0, 1.0))),
    ],
)
def test_a_state_that_cannot_be_is_refused_and_counted(reason, wrong) -> None:
    assert fault_of(wrong) == reason
    picture = GlobalPicture("0")
    picture.report(TrackReport("9", "f", wrong._replace(valid_us=START_US)), START_US)
    assert picture.gate.refused == {("9", reason): 1}
    picture.on_time(START_US + 1_000_000)
    assert not picture.rows(START_US)


def test_a_flood_is_bounded_for_the_member_that_sends_it_and_harms_no_other() -> None:
    sky = Sky()
    sky.run(3, honest)
    before = sky.name("a", "0")
    picture = sky.pictures["0"]
    for number in range(5 * MOST_REPORTS_S):
        place = (float(number), 0.0, 0.0, 0.0)
        picture.report(TrackReport("9", f"f{number}", state(place, sky.now_us)), sky.now_us)
    sky.run(1, honest)
    refused = picture.gate.refused
    assert refused["9", "too many tracks"] + refused["9", "too many reports"] == 5 * MOST_REPORTS_S - MOST_TRACKS
    assert sky.name("a", "0") == before
    assert not any(unit != "9" for unit, _ in refused)


def test_reports_of_another_time_and_leaps_are_refused() -> None:
    picture = GlobalPicture("0")
    for valid_us in (START_US - 60_000_000, START_US + 60_000_000):
        picture.report(TrackReport("9", "f", state((0, 0, 0, 0), valid_us)), START_US)
    assert picture.gate.refused == {("9", "another time"): 2}
    picture.report(TrackReport("9", "f", state((0, 0, 0, 0), START_US)), START_US)
    picture.report(TrackReport("9", "f", state((500, 0, 0, 0), START_US + 100_000)), START_US + 100_000)
    assert picture.gate.refused["9", "a leap"] == 1


def test_names_that_change_and_tracks_that_come_and_go_fill_nothing_up() -> None:
    sky = Sky()
    sky.run(3, honest)
    picture, before = sky.pictures["0"], sky.name("a", "0")
    for step in range(60):
        sky.run(0.2, honest)
        for track in range(60):
            symbol = f"f{track}-{step // 10}"
            place = (1000.0 + 20.0 * track, 0.0, 0.0, 0.0)
            picture.report(TrackReport("9", symbol, state(place, sky.now_us)), sky.now_us)
            at_us = sky.now_us
            picture.claim(IdentityClaim("9", symbol, f"name{step}-{track}", at_us, at_us), sky.now_us)
    assert sky.name("a", "0") == before
    assert picture.gate.refused["9", "renames too often"] > 1000
    assert sum(name.startswith("name") for name in (row.name for row in picture.rows(sky.now_us))) <= MOST_OF_ONE


def test_relations_of_another_time_and_floods_of_them_are_not_taken() -> None:
    spans = SpanningManoeuvres(chronicles(), "passes")
    relation = PairRelation(START_US, ("a", "b"), (False,) * 7)
    assert not spans.take_from(relation._replace(valid_us=START_US + 10**9), START_US)
    assert not spans.take_from(relation._replace(valid_us=START_US - 10**9), START_US)
    taken = sum(spans.take_from(relation, START_US) for _ in range(2 * MOST_WAITING))
    assert taken == MOST_WAITING
    assert not spans.on_time(START_US + LATE_US)
    assert spans.take_from(relation, START_US)


def test_of_two_names_that_of_the_member_that_is_trusted_more_stands_and_one_that_is_not_trusted_counts_for_nothing() -> (
    None
):
    from dyknow.anchoring.cooperation.identities import Held, named
    from dyknow.anchoring.cooperation.reports import TrackKey

    one, other, third = TrackKey("1", "a"), TrackKey("2", "b"), TrackKey("3", "c")
    held = {one: Held("old", 1, 1), other: Held("young", 5, 5), third: Held("young", 5, 5)}
    trust = {"1": 1.0, "2": 0.3, "3": 0.3}
    group = [frozenset(held)]
    assert named(group, held, lambda _key: 1.0)[0].name == "young"
    assert named(group, held, lambda key: trust[key.unit])[0].name == "old"
    picture = GlobalPicture("0", trusted={"9": 0.0})
    picture.report(TrackReport("9", "f", state((0.0, 0.0, 0.0, 0.0), START_US)), START_US)
    assert picture.gate.refused == {("9", "not trusted"): 1}
