"""Other vehicles as traffic: heard, silent and growing, leaping, claiming too much room, forgotten."""

import numpy as np
import pytest

from dyknow.agents.capabilities.separation.neighbours import (
    FORGOTTEN_US,
    GROWS_MOST_M,
    MOST,
    MOST_OWN_M,
    SILENT_US,
    Neighbours,
)
from dyknow.agents.places import Fix
from dyknow.navigation.intents.intent import IntendedPlace, Intent, IntentEnding, IntentSource, RightOfWay
from dyknow.navigation.intents.meeting import MINIMA
from dyknow.navigation.intents.path import STEP_S, STEPS, FlatOrigin, resumed

S = 1_000_000
M = 1 / 111_320.0
ORIGIN = FlatOrigin.at(58.0, 15.0)


def said(at_s: float, north_m: float = 0.0, up_m: float = 60.0, **changed: object) -> Intent:
    intent = Intent(
        round(at_s * S), 58.0 + north_m * M, 15.0, up_m, 5.0, 0.0, 0.0, IntentSource.ROUTE, RightOfWay.NAMED,
        (IntendedPlace(58.01, 15.0, up_m),),
    )  # fmt: skip
    return intent._replace(**changed)  # type: ignore[arg-type]


def at(seconds: float) -> int:
    return round(seconds * S)


def test_one_that_is_heard_is_where_it_says_and_ranks_as_it_says() -> None:
    others = Neighbours()
    others.take("1", said(0), at(0.1))
    (one,) = others.airborne()
    assert one.rank(at(1)) is RightOfWay.NAMED
    ((tube, _),) = one.tubes(ORIGIN, at(2), STEPS)
    assert tube[0, 0] == pytest.approx(10.0, abs=0.5)
    assert tube[4, -1] == 1.0


def test_one_that_is_silent_flies_on_cannot_be_asked_and_grows_up_to_a_bound() -> None:
    others = Neighbours()
    others.take("1", said(0), at(0))
    (one,) = others.airborne()
    assert not one.is_silent(SILENT_US)
    assert one.rank(at(2.1)) is RightOfWay.CANNOT
    ((tube, _),) = one.tubes(ORIGIN, at(12), STEPS)
    assert tube[0, 0] == pytest.approx(60.0, abs=1.0)
    assert tube[4, 0] == pytest.approx(1.0 + 5.0, abs=0.1)
    ((tube, _),) = one.tubes(ORIGIN, at(600), STEPS)
    assert tube[4].max() == 1.0 + GROWS_MOST_M
    assert tube[0, 0] == pytest.approx(1112.0, abs=5.0), "it stands where its legs end"


@pytest.mark.parametrize("resumes_s", [3.0, 7.5, 14.0, 22.0])
def test_one_that_falls_silent_while_it_makes_room_may_fly_its_own_way_again_at_any_time(resumes_s: float) -> None:
    others = Neighbours()
    others.take("1", said(0), at(0))
    aside = IntendedPlace(*ORIGIN.degrees(5.0, 60.0), 60.0)
    making_room = said(1, 5.0, source=IntentSource.MANOEUVRE, legs=(aside,))
    others.take("1", making_room, at(1))
    (one,) = others.airborne()
    assert len(one.tubes(ORIGIN, at(2.9), STEPS)) == 1, "while it is heard it says itself when it flies on"
    own_way = said(0).legs
    for seconds in (4.0, 12.0, 20.0, 30.0):
        now_s = 1.0 + seconds
        flown = resumed(making_room, said(0), ORIGIN, resumes_s, 200)[:, round(seconds / STEP_S)]
        assert own_way
        tubes = [tube[:, 0] for tube, counts in one.tubes(ORIGIN, at(now_s), STEPS) if counts]
        away_m = [np.hypot(tube[0] - flown[0], tube[1] - flown[1]) - tube[4] for tube in tubes]
        assert min(away_m) < MINIMA.level_m, "somebody who keeps clear of all of them keeps clear of it"


def test_one_that_is_heard_again_is_as_narrow_as_before() -> None:
    others = Neighbours()
    others.take("1", said(0), at(0))
    others.take("1", said(30, 150.0), at(30))
    (one,) = others.airborne()
    ((tube, _),) = one.tubes(ORIGIN, at(30.2), STEPS)
    assert tube[4].max() == 1.0


@pytest.mark.parametrize(("north_m", "is_doubted"), [(25.0, False), (45.0, False), (70.0, True), (250.0, True)])
def test_one_that_is_back_from_silence_where_it_cannot_have_flown_is_traffic_at_both_places_for_a_while(
    north_m: float, is_doubted: bool
) -> None:
    others, own = Neighbours(), Fix(0, 58.0, 15.0, 60.0, 0.0, 0.0, 0.0)
    others.take("1", said(0), at(0))
    others.take("1", said(5, north_m), at(5))
    others.take("1", said(12, north_m + 35.0), at(12))
    traffic = others.near(ORIGIN, own, 5.0, at(12), STEPS)
    assert traffic.units == ("1",) * (2 if is_doubted else 1)
    assert all(traffic.counts)
    if is_doubted:
        assert traffic.tubes[:, 0, 0] == pytest.approx([north_m + 35.0, 60.0], abs=1.0)
        assert traffic.tubes[1, 4, 0] == pytest.approx(1.0 + 5.0, abs=0.1)
    assert len(others.near(ORIGIN, own, 5.0, at(25.1), STEPS).units) == 1


@pytest.mark.parametrize("leap", [{"north_m": 3000.0}, {"up_m": 110.0}])
def test_one_that_leaps_stays_where_it_was_until_it_was_credible_for_three_seconds(leap: dict[str, float]) -> None:
    others = Neighbours()
    others.take("1", said(0), at(0))
    assert "leapt" in (others.take("1", said(0.5, **leap), at(0.5)) or "")
    assert others.take("1", said(1.0, **leap), at(1.0)) is None
    one = others.by_unit["1"]
    assert one.intent.at_us == 0
    assert one.rank(at(1)) is RightOfWay.CANNOT
    for half in range(3, 9):
        others.take("1", said(half / 2, **leap), at(half / 2))
    assert one.intent.at_us == at(4)
    assert one.rank(at(4)) is RightOfWay.NAMED


def test_one_that_leaps_to_and_fro_stays_where_it_was() -> None:
    others = Neighbours()
    others.take("1", said(0), at(0))
    told = [others.take("1", said(half / 2, 3000.0 * (half % 2)), at(half / 2)) for half in range(1, 40)]
    assert sum(each is not None for each in told) == 1, "it is told once"
    assert others.by_unit["1"].intent.at_us == 0
    assert others.left_out["leap"] > 30


def test_none_claims_more_room_than_a_vehicle_has() -> None:
    others = Neighbours()
    others.take("1", said(0, radius_m=100.0, half_height_m=100.0), at(0))
    (one,) = others.airborne()
    assert (one.intent.radius_m, one.intent.half_height_m) == (MOST_OWN_M, MOST_OWN_M)


def test_an_older_word_does_not_replace_a_newer_one() -> None:
    others = Neighbours()
    others.take("1", said(5), at(5))
    others.take("1", said(4, 700.0), at(5.1))
    assert others.by_unit["1"].intent.at_us == at(5)


def test_one_on_the_ground_is_no_traffic_and_one_in_the_air_is_until_its_battery_is_empty() -> None:
    others = Neighbours()
    others.take("1", said(0), at(0))
    others.take("2", said(0, source=IntentSource.GROUND), at(0))
    assert [each.unit for each in others.airborne()] == ["1"]
    others.expire(at(10))
    assert set(others.by_unit) == {"1"}
    others.expire(FORGOTTEN_US + 1)
    assert not others.by_unit


def test_one_that_says_no_intent_is_taken_by_its_motion() -> None:
    others = Neighbours()
    others.see("1", Fix(0, 58.0, 15.0, 60.0, 4.0), at(0))
    (one,) = others.airborne()
    assert one.rank(at(0)) is RightOfWay.CANNOT
    ((tube, _),) = one.tubes(ORIGIN, at(0), STEPS)
    assert tube[0, 10] == pytest.approx(20.0, abs=0.1)
    assert tube[4, 10] > tube[4, 0]
    others.take("1", said(1), at(1))
    others.see("1", Fix(at(2), 58.1, 15.0, 60.0), at(2))
    assert others.by_unit["1"].has_intent


def test_of_too_many_the_one_that_was_heard_first_is_left_out() -> None:
    others = Neighbours()
    for number in range(MOST + 5):
        others.take(str(number), said(number / 100), at(number / 100))
    assert len(others.by_unit) == MOST
    assert "0" not in others.by_unit


def test_those_that_are_too_far_to_come_near_are_not_flown_ahead() -> None:
    others = Neighbours()
    others.take("1", said(0, 9000.0), at(0))
    others.take("2", said(0, 100.0), at(0))
    near = others.near(ORIGIN, Fix(0, 58.0, 15.0, 60.0), 5.0, at(0), STEPS)
    assert near.units == ("2",)


def test_a_landing_one_is_all_the_way_down() -> None:
    others = Neighbours()
    others.take("1", said(0, legs=(IntendedPlace(58.0, 15.0, 0.0),), ending=IntentEnding.LAND, north_m_s=0.0), at(0))
    near = others.near(ORIGIN, Fix(0, 58.0, 15.0, 20.0), 0.0, at(0), STEPS)
    assert near.tubes[0, 2].min() < 21.0
    assert near.tubes[0, 3, -1] > 40.0


def test_one_that_has_leapt_is_kept_away_from_where_it_would_be_without_the_leap_as_well() -> None:
    """Its GPS is off by 150 m for a while: it has been credible there, and is nevertheless where it was before."""
    all_others = Neighbours()
    all_others.take("1", said(0), at(0))
    for half in range(1, 11):
        all_others.take("1", said(half / 2, 150.0), at(half / 2))
    one = all_others.by_unit["1"]
    assert one.leapt_us is None
    assert one.intent.latitude_deg == said(5, 150.0).latitude_deg, "it is believed"
    now = at(6)
    starts = [float(tube[0, 0]) for tube, counts in one.tubes(ORIGIN, now, STEPS) if counts]
    assert len(starts) == 2
    assert abs(abs(starts[1] - starts[0]) - 150.0) < 30.0
    assert len(one.tubes(ORIGIN, one.former_until_us + 1, STEPS)) == 1
