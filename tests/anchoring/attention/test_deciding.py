"""Where a camera looks next: what is lost is searched, all are revisited, and the reason is said."""

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from math import inf, nan, pi, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.anchoring.attention.deciding import MOST_OBJECTS, Attention, Gaze
from dyknow.anchoring.attention.ground import MOST_PLACES, SearchedGround, around, roads_near
from dyknow.anchoring.attention.view import TurnableCamera, TurnLimits
from dyknow.anchoring.attention.watched import Interest, WatchedObject, WatchedPlace
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.navigation import LocalFrame
from dyknow.navigation.cameras.pinhole import Attitude, CameraPose, Intrinsics, PanTilt
from dyknow.sim_uavs.roads.layouts import cross, network_of

CAMERA = Intrinsics.of_view(640, 480, radians(60.0))
STEP_US = 200_000


def camera(mount: PanTilt = PanTilt(0.0, pi / 2.0), up_m: float = 60.0) -> TurnableCamera:  # noqa: B008  (immutable)
    pose = CameraPose(0, np.array([0.0, 0.0, -up_m]), Attitude(0.0, 0.0, 0.0), mount)
    return TurnableCamera(CAMERA, pose, TurnLimits())


def one(
    symbol: str,
    *places: tuple[float, float, float],
    seen_us: int = 0,
    anchored: bool = False,
    interest: Interest = "known",
    sd_m: float = 8.0,
) -> WatchedObject:
    """Places as east, north and weight."""
    at = tuple(WatchedPlace(x_m, y_m, sd_m=sd_m, weight=weight) for x_m, y_m, weight in places)
    return WatchedObject(symbol, at, seen_us, anchored, interest)


def turned(attention: Attention, objects: Sequence[WatchedObject], seconds: float) -> list[Gaze | None]:
    """The gazes of a run in which the mount turns to each of them at its full rate."""
    mount, gazes = PanTilt(0.0, pi / 2.0), []
    for now_us in range(0, round(seconds * 1e6), STEP_US):
        here = camera(mount)
        gaze = attention.decide(now_us, here, objects)
        gazes.append(gaze)
        if gaze is not None:
            mount = here.aim(gaze.x_m, gaze.y_m)
    return gazes


def test_what_is_lost_is_looked_for_where_it_is_expected_and_the_likelier_place_first() -> None:
    lost = one("car1", (0.0, 200.0, 0.7), (150.0, 0.0, 0.3), seen_us=-3_000_000)
    gazes = turned(Attention(), [one("car2", (5.0, 5.0, 1.0), anchored=True), lost], 4.0)
    first = gazes[0]
    assert first is not None
    assert (first.symbol, first.x_m, first.y_m) == ("car1", 0.0, 200.0)
    assert first.because == "looks for car1, not seen for 3.0 s, place 1 of 2, weight 0.70"
    assert any(each is not None and each.x_m == 150.0 for each in gazes[1:])


def test_every_object_is_revisited() -> None:
    cars = [one(f"car{n}", (90.0 * x, 90.0 * y, 1.0)) for n, (x, y) in enumerate([(1, 1), (-1, 1), (1, -1), (-1, -1)])]
    seen = Counter(gaze.symbol for gaze in turned(Attention(), cars, 30.0) if gaze is not None)
    assert {each.symbol for each in cars} <= seen.keys()


def test_it_stays_until_it_has_settled_and_does_not_waver_between_equals() -> None:
    cars = [one("a", (80.0, 0.0, 1.0), anchored=True), one("b", (-80.0, 0.0, 1.0), anchored=True)]
    gazes = turned(Attention(), cars, 10.0)
    changes = sum(before != after for before, after in pairwise(gazes))
    assert changes <= 1


@pytest.mark.parametrize(
    ("interest", "said"),
    [
        ("wanted", "looks for it, which is wanted"),
        ("followed", "follows it"),
        ("undecided", "looks at it, which is of no type yet"),
        ("new", "looks at it, which is no object yet"),
    ],
)
def test_what_is_of_interest_is_looked_at_before_what_is_only_known(interest: Interest, said: str) -> None:
    known = [one(f"car{n}", (-80.0, 10.0 * n, 1.0), anchored=True) for n in range(3)]
    special = one("it", (80.0, 0.0, 1.0), anchored=interest != "wanted", interest=interest)
    gaze = Attention().decide(0, camera(), [*known, special])
    assert gaze is not None
    assert (gaze.symbol, gaze.because) == ("it", said)


def test_a_followed_object_is_kept_in_view_while_others_are_lost() -> None:
    lost = [one(f"car{n}", (-150.0, 20.0 * n, 1.0)) for n in range(3)]
    followed = one("it", (60.0, 0.0, 1.0), anchored=True, interest="followed")
    gazes = turned(Attention(), [*lost, followed], 10.0)
    assert sum(gaze is not None and gaze.symbol == "it" for gaze in gazes) > 0.8 * len(gazes)


def test_what_is_wanted_and_may_be_anywhere_has_the_ground_searched() -> None:
    attention = Attention(around(0.0, 0.0, 120.0))
    gazes = turned(attention, [one("it", interest="wanted"), one("car", (0.0, 0.0, 1.0), anchored=True)], 20.0)
    looked = {(gaze.x_m, gaze.y_m) for gaze in gazes if gaze is not None and not gaze.symbol}
    assert len(looked) >= 5
    assert {gaze.because for gaze in gazes if gaze is not None and not gaze.symbol} == {
        "searches ground that was not seen for long"
    }


def test_nothing_to_look_at_is_no_decision() -> None:
    assert Attention().decide(0, camera(), []) is None
    assert Attention().decide(0, camera(), [one("far", (5_000.0, 0.0, 1.0))]) is None


places = st.tuples(st.floats(-300.0, 300.0), st.floats(-300.0, 300.0), st.floats(0.01, 1.0))
objects = st.lists(
    st.builds(
        lambda n, at, anchored, interest: one(f"car{n}", *at, anchored=anchored, interest=interest),
        st.integers(0, 99), st.lists(places, min_size=1, max_size=4), st.booleans(),
        st.sampled_from(["known", "new", "undecided", "wanted", "followed"]),
    ),
    max_size=8, unique_by=lambda each: each.symbol,
)  # fmt: skip


@given(objects)
def test_the_same_objects_in_any_order_give_the_same_decision(given_objects: list[WatchedObject]) -> None:
    here = camera()
    assert Attention().decide(0, here, given_objects) == Attention().decide(0, here, given_objects[::-1])


@pytest.mark.parametrize("bad", [nan, inf, -inf, 1e300])
def test_places_that_are_none_draw_no_camera(bad: float) -> None:
    wrong = [one("x", (bad, 0.0, 1.0)), one("w", (20.0, 0.0, nan)), one("s", (0.0, 20.0, 1.0), sd_m=inf)]
    assert Attention().decide(0, camera(), wrong) is None
    gaze = Attention().decide(0, camera(), [*wrong, one("good", (50.0, 0.0, 1.0))])
    assert gaze is not None
    assert gaze.symbol == "good"


def test_of_too_many_objects_those_that_were_not_seen_for_longest_are_looked_at() -> None:
    many = [one(f"car{n}", (float(n % 100), float(n // 100), 1.0), seen_us=n) for n in range(10 * MOST_OBJECTS)]
    gaze = Attention().decide(10_000_000, camera(), many)
    assert gaze is not None
    assert int(gaze.symbol.removeprefix("car")) < MOST_OBJECTS


def test_a_large_map_is_thinned_and_what_was_seen_is_searched_last() -> None:
    ground = SearchedGround(around(0.0, 0.0, 4_000.0))
    assert 0 < len(ground.x_m) <= MOST_PLACES
    near = np.ones(len(ground.x_m))
    ground.on_view(0, (ground.x_m < 0.0).astype(float))
    assert all(x_m >= 0.0 for x_m, _ in ground.stalest(1, 5, near))


def test_a_place_is_in_the_image_as_a_pinhole_camera_shows_it() -> None:
    rng = np.random.default_rng(4)
    here = camera()
    angles = [here.aim(30.0, 40.0), here.aim(-80.0, 10.0), PanTilt(0.3, 0.9)]
    x_m, y_m = rng.uniform(-150.0, 150.0, (2, 200))
    seen = here.sees(angles, x_m, y_m)
    for row, mount in zip(seen, angles, strict=True):
        pose = here.pose._replace(mount=mount)
        for east, north, is_seen in zip(x_m, y_m, row, strict=True):
            direction = pose.rotation().T @ (np.array([north, east, 0.0]) - pose.position_m)
            assert (CAMERA.pixel(direction) is not None) == bool(is_seen)
    assert seen.sum() > 20


def test_turning_takes_as_long_as_the_slower_axis() -> None:
    here = camera(PanTilt(radians(170.0), radians(45.0)))
    assert here.turns_s(PanTilt(radians(-170.0), radians(45.0))) == pytest.approx(20.0 / 90.0)
    assert here.turns_s(PanTilt(radians(170.0), radians(90.0))) == pytest.approx(0.5)


def test_what_will_be_uncertain_soon_is_looked_at_before_what_is_as_uncertain_and_stays_so() -> None:
    for at_crossing in ("car1", "car2"):
        objects = [one("car1", (0.0, 150.0, 1.0)), one("car2", (150.0, 0.0, 1.0))]
        gaze = Attention().decide(
            0, camera(), [each._replace(ahead_m=40.0 if each.symbol == at_crossing else 0.0) for each in objects]
        )
        assert gaze is not None
        assert gaze.symbol == at_crossing


def test_roads_near_a_place_are_in_its_frame() -> None:
    network, frame = network_of(cross()), LocalFrame(58.4, 15.6, 0.0)
    shifted = RoadNetwork(network.crossings.values(), network.links.values(), frame=LocalFrame(58.41, 15.6, 0.0))
    north_m, _, _ = frame.to_ned(58.41, 15.6, 0.0)
    near = roads_near(shifted, frame, 0.0, north_m, 100.0)
    assert near
    assert all(min(abs(x_m), abs(y_m - north_m)) < 2.0 for x_m, y_m in near)
    assert all(np.hypot(x_m, y_m - north_m) <= 100.0 for x_m, y_m in near)
    assert roads_near(shifted, frame, 0.0, 0.0, 100.0) == []
    assert roads_near(network, frame, 0.0, 0.0, 100.0)


def test_of_other_ground_nothing_was_seen() -> None:
    attention = Attention(around(0.0, 0.0, 40.0))
    turned(attention, [], 5.0)
    attention.search([(200.0, 0.0)])
    (gaze, *_) = turned(attention, [], 0.2)
    assert gaze is not None
    assert (gaze.x_m, gaze.symbol) == (200.0, "")
