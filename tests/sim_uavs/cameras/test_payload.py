"""From what is on the road to percepts: who is seen, how well, under which symbol, and what hides behind a bridge."""

from collections import Counter, defaultdict
from math import hypot, pi, radians

import numpy as np
import pytest

from dyknow.navigation.cameras.pinhole import Attitude, CameraPose, PanTilt, aimed
from dyknow.sim_uavs.cameras.detectors import (
    COLOUR,
    COLOUR_CAMERA,
    THERMAL,
    THERMAL_CAMERA,
    CameraModel,
    Obstacle,
    detect,
    in_view,
)
from dyknow.sim_uavs.cameras.mount import Mount, MountLimits
from dyknow.sim_uavs.cameras.payload import CameraPayload
from dyknow.sim_uavs.roads.drivers import Driver, RoadState
from dyknow.sim_uavs.roads.layouts import cross, straight
from tests.sim_uavs.cameras.flights import FRAME, Image, hover

TURNING = Driver("a", ("west", "middle", "north"), start_m=190.0, cruise_m_s=10.0, colour="red")
CROSSING = Driver("b", ("south", "middle", "east"), start_m=180.0, cruise_m_s=9.0, colour="blue", kind="truck")


def car(x_m: float, y_m: float, kind: str = "car") -> RoadState:
    return RoadState("c", kind, "red", x_m, y_m, 0.0, 0.0, "l", 1, None, None)  # type: ignore[arg-type]


def down_from(height_m: float) -> CameraPose:
    return CameraPose(0, np.array([0.0, 0.0, -height_m]), Attitude(0.0, 0.0, 0.0), PanTilt(0.0, pi / 2))


def nearest(image: Image, x_m: float, y_m: float) -> tuple[RoadState, float]:
    state = min(image.truth, key=lambda each: hypot(each.x_m - x_m, each.y_m - y_m))
    return state, hypot(state.x_m - x_m, state.y_m - y_m)


@pytest.fixture(scope="module")
def images() -> list[Image]:
    return hover(cross(), [TURNING, CROSSING], 12.0)


def test_each_vehicle_in_view_is_one_percept_with_its_colour_and_within_what_is_stated(images: list[Image]) -> None:
    of: dict[str, Counter[str]] = defaultdict(Counter)
    colours: dict[str, Counter[object]] = defaultdict(Counter)
    misses, ratios = [], []
    for image in images:
        for symbol, _, state in image.percepts:
            if state is not None:
                truth, off_m = nearest(image, state.x_m, state.y_m)
                of[symbol][truth.name] += 1
                colours[truth.name][state.attributes.get("colour")] += 1
                misses.append(off_m)
                off = np.array([state.x_m - truth.x_m, state.y_m - truth.y_m])
                ratios.append(off @ np.linalg.solve(state.covariance[:2, :2], off))
    assert sorted(name for counts in of.values() for name in counts) == ["a", "b"]
    assert {name: counts.most_common(1)[0][0] for name, counts in colours.items()} == {"a": "red", "b": "blue"}
    assert np.quantile(misses, 0.95) < 2.0
    assert np.mean(ratios) < 3.0


def test_percepts_come_ten_times_a_second_and_false_detections_are_none(images: list[Image]) -> None:
    times: dict[str, list[int]] = defaultdict(list)
    for image in images:
        for symbol, _, state in image.percepts:
            if state is not None:
                times[symbol].append(image.now_us)
                assert nearest(image, state.x_m, state.y_m)[1] < 4.0
    for each in times.values():
        assert (each[-1] - each[0]) / 1e5 == pytest.approx(len(each) - 1, abs=0.15 * len(each))


def test_the_same_seed_gives_the_same_percepts() -> None:
    one, again, other = (hover(cross(), [TURNING, CROSSING], 4.0, seed=seed) for seed in (3, 3, 4))
    assert [repr(image.percepts) for image in one] == [repr(image.percepts) for image in again]
    assert [repr(image.percepts) for image in one] != [repr(image.percepts) for image in other]


def test_below_a_bridge_a_percept_ends_and_behind_it_another_begins() -> None:
    bridge = Obstacle(20.0, -50.0, 45.0, 50.0, 8.0, 6.0)
    driver = Driver("a", ("west", "east"), start_m=0.0, cruise_m_s=10.0)
    images = hover(straight(300.0), [driver], 8.0, at_m=(0.0, 30.0, -60.0), obstacles=[bridge])
    seen = [(image.truth[0].x_m, percept) for image in images for percept in image.percepts]
    first, second = dict.fromkeys(percept.symbol for _, percept in seen)
    order = [percept.symbol for _, percept in seen if percept.symbol == second or percept.state is None]
    assert order[:2] == [first, second]
    hidden = [x for x, percept in seen if percept.state is not None and 22.0 < x < 42.0]
    assert not hidden


@pytest.mark.parametrize(
    ("obstacle", "hides"),
    [
        (Obstacle(10.0, -5.0, 20.0, 5.0, 30.0), True),
        (Obstacle(10.0, -5.0, 20.0, 5.0, 10.0), False),
        (Obstacle(10.0, 6.0, 20.0, 9.0, 90.0), False),
        (Obstacle(35.0, -5.0, 45.0, 5.0, 8.0, 5.0), True),
        (Obstacle(50.0, -5.0, 60.0, 5.0, 90.0), False),
    ],
    ids=["a tower between", "a low wall", "next to the line", "a bridge above it", "a tower behind it"],
)
def test_an_obstacle_hides_what_is_behind_or_below_it(obstacle: Obstacle, hides: bool) -> None:
    assert obstacle.hides(np.array([0.0, 0.0, -50.0]), np.array([0.0, 40.0, -0.7])) is hides


def test_what_is_far_away_is_found_less_often() -> None:
    rng = np.random.default_rng(1)
    quiet = CameraModel(COLOUR_CAMERA.intrinsics, COLOUR_CAMERA.noise._replace(false_per_image=0.0))
    shares = [
        sum(len(detect(COLOUR, quiet, down_from(height), [car(0.0, 0.0)], (), rng)) for _ in range(400)) / 400
        for height in (50.0, 400.0, 1200.0)
    ]
    assert shares[0] > 0.88
    assert shares[0] > shares[1] + 0.05
    assert shares[1] > shares[2] + 0.3


def test_false_detections_come_at_the_stated_rate_and_everywhere() -> None:
    rng = np.random.default_rng(2)
    images = [detect(THERMAL, THERMAL_CAMERA, down_from(50.0), (), (), rng) for _ in range(3000)]
    false = [detection.pixel for image in images for detection in image]
    assert len(false) / 3000 == pytest.approx(THERMAL_CAMERA.noise.false_per_image, rel=0.2)
    assert np.mean(false, axis=0) == pytest.approx([192.0, 144.0], rel=0.15)


def test_the_view_ends_where_the_angle_of_view_does() -> None:
    reach_m = 50.0 * np.tan(radians(24.0))
    for off_m, seen in ((reach_m - 0.1, True), (reach_m + 0.1, False)):
        states = [car(off_m, 0.0)]
        assert bool(in_view(COLOUR_CAMERA.intrinsics, down_from(50.0), states, ())) is seen


def test_the_mount_turns_no_faster_than_it_can_and_keeps_looking_at_a_place() -> None:
    mount = Mount(MountLimits(), np.random.default_rng(1))
    level, place = Attitude(0.0, 0.0, 0.0), np.array([0.0, 0.0, -50.0])
    mount.look_at(50.0, -50.0)
    before = mount.angles
    mount.advance(0.1, level, place)
    assert abs(mount.angles.pan_rad - before.pan_rad) <= radians(9.0) + 1e-9
    for _ in range(40):
        mount.advance(0.1, level, place)
    assert mount.angles == pytest.approx(aimed(level, place, np.array([50.0, -50.0, 0.0])))
    turned = Attitude(0.1, -0.2, 1.0)
    for _ in range(40):
        mount.advance(0.1, turned, place)
    pose = CameraPose(0, place, turned, mount.angles)
    assert pose.pixel(COLOUR_CAMERA.intrinsics, np.array([50.0, -50.0, 0.0])) == pytest.approx((384.0, 288.0))
    mount.turn(PanTilt(0.0, 3.0))
    for _ in range(40):
        mount.advance(0.1, level, place)
    assert mount.angles.tilt_rad == MountLimits().most_tilt_rad


def test_a_camera_that_follows_a_car_sees_it_where_one_that_looks_down_does_not() -> None:
    def follow(payload: CameraPayload, states: list[RoadState]) -> None:
        for state in states:
            payload.mount.look_at(state.y_m, state.x_m)

    driver = Driver("a", ("west", "east"), start_m=60.0, cruise_m_s=12.0)
    looking_down, following = (
        hover(straight(400.0), [driver], 8.0, at_m=(0.0, 70.0, -50.0), **more) for more in ({}, {"aim": follow})
    )
    seen = [sum(bool(image.percepts) for image in images) for images in (looking_down, following)]
    assert seen[1] > 1.5 * seen[0]


def test_without_a_pose_there_are_no_percepts() -> None:
    payload = CameraPayload(FRAME, np.random.default_rng(1))
    place, level = np.array([0.0, 0.0, -50.0]), Attitude(0.0, 0.0, 0.0)
    assert all(not payload.see(step * 40_000, place, level, [car(0.0, 0.0)]) for step in range(20))
