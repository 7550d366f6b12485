"""From images to percepts on a platform: where cars are, what the streams say, and what becomes of nonsense."""

from itertools import pairwise
from math import atan2, degrees, hypot, inf, nan, radians

import numpy as np
import pytest

from dyknow.agents.capabilities.cameras.cameras import Cameras
from dyknow.agents.effects import Pressed
from dyknow.agents.shedding import Shedding
from dyknow.anchoring.belief.sensing import inside
from dyknow.navigation.vehicle import AttitudeReport, ImageDetection, ImageReport, LookAtOrder, MountReport
from tests.agents.capabilities.cameras.watching import Watching

PERCEPTS, STATE, VIEW = "vision-percepts[0]", "camera-state[0]", "camera-view[0]"


@pytest.fixture(scope="module")
def watching() -> Watching:
    watching = Watching(seed=3)
    watching.look_at(PERCEPTS, STATE, VIEW)
    watching.run(15.0)
    return watching


def test_percepts_are_where_cars_are_and_say_how_wrong_they_may_be(watching: Watching) -> None:
    errors, stated = [], []
    for sample in watching.samples[PERCEPTS]:
        symbol, x_m, y_m, sd_m, _, end = sample.value
        assert symbol.startswith("vp0_")
        if not end:
            errors.append(min(hypot(x_m - car.x_m, y_m - car.y_m) for car in watching.truth[sample.valid_us]))
            stated.append(sd_m)
    errors.sort()
    assert len(errors) > 100
    assert errors[int(0.95 * len(errors))] < 3.0
    assert 0.2 < sum(stated) / len(stated) < 2.0


def test_percepts_end_once_and_come_at_the_declared_rate(watching: Watching) -> None:
    ended, last_us = set(), dict[str, int]()
    for sample in watching.samples[PERCEPTS]:
        symbol, end = sample.value[0], sample.value[-1]
        assert symbol not in ended
        if end:
            ended.add(symbol)
        else:
            assert sample.valid_us - last_us.get(symbol, 0) >= 60_000
            last_us[symbol] = sample.valid_us
    assert ended


def test_percepts_of_one_image_are_one_instant(watching: Watching) -> None:
    times = [sample.valid_us for sample in watching.samples[PERCEPTS]]
    assert times == sorted(times)
    assert all(sample.available_us - sample.valid_us <= 260_000 for sample in watching.samples[PERCEPTS])


def test_percepts_are_within_the_view_of_their_time_and_there_are_views_without_percepts(watching: Watching) -> None:
    views = {sample.valid_us: np.array(sample.value).reshape(4, 2) for sample in watching.samples[VIEW]}
    seen = [sample for sample in watching.samples[PERCEPTS] if not sample.value[-1]]
    within = [inside(views[each.valid_us], np.array([each.value[1:3]]))[0] for each in seen]
    assert sum(within) > 0.95 * len(within)
    assert len(views) > len({each.valid_us for each in seen})


def test_the_state_of_the_camera_is_on_the_grid_and_follows_what_the_mount_is_told() -> None:
    watching = Watching()
    watching.look_at(STATE)
    watching.run(1.0)
    place = watching.vehicle.truth(watching.now_us)
    ahead = LookAtOrder(place.latitude_deg + 4e-4, place.longitude_deg, 20.0)
    watching.order(ahead)
    watching.run(3.0)
    states = watching.samples[STATE]
    assert {after.valid_us - before.valid_us for before, after in pairwise(states)} == {100_000}
    latitude_deg, longitude_deg, altitude_m, bearing_deg, tilt_deg = states[-1].value
    assert latitude_deg == pytest.approx(place.latitude_deg, abs=2e-5)
    assert longitude_deg == pytest.approx(place.longitude_deg, abs=3e-5)
    assert altitude_m == pytest.approx(85.0, abs=2.0)
    assert min(bearing_deg, 360.0 - bearing_deg) < 3.0
    assert tilt_deg == pytest.approx(degrees(atan2(65.0, 44.5)), abs=2.0)


def test_it_offers_its_streams_and_a_platform_without_cameras_neither(watching: Watching) -> None:
    offered = {entry.label: entry.period_us for entry in watching.platform.part(Cameras).labels()}
    assert offered == {"camera-state": 100_000, "camera-view": 0, "vision-percepts": 0}
    assert Cameras not in {type(part) for part in Watching.without_cameras().parts}


def test_with_too_much_to_do_it_looks_at_fewer_images() -> None:
    watching = Watching(seed=3)
    watching.look_at(PERCEPTS)
    watching.run(4.0)
    watching.platform.on_event(Pressed(watching.now_us, 0.9), watching.now_us)
    assert watching.platform.part(Shedding).level == 1
    looked_at = watching.platform.part(Cameras).perception.looked_at
    watching.run(2.0)
    assert watching.platform.part(Cameras).perception.looked_at - looked_at == pytest.approx(25, abs=3)


# -- nonsense ---------------------------------------------------------------------------------------------------------


def image(valid_us: int, *detections: ImageDetection) -> ImageReport:
    return ImageReport(valid_us, detections)


@pytest.mark.parametrize(
    "detection",
    [
        ImageDetection("colour", nan, 10.0),
        ImageDetection("colour", inf, 10.0),
        ImageDetection("colour", -1.0, 10.0),
        ImageDetection("colour", 10.0, 1e6),
        ImageDetection("no such camera", 10.0, 10.0),
    ],
)
def test_what_is_in_no_image_is_counted_and_nothing_else(detection: ImageDetection) -> None:
    watching = Watching()
    watching.look_at(PERCEPTS)
    watching.run(1.0, sees=False)
    for _ in range(30):
        watching.report(image(watching.now_us, detection))
        watching.run(0.04, sees=False)
    watching.run(0.5, sees=False)
    assert watching.samples[PERCEPTS] == []
    assert watching.platform.part(Cameras).perception.left_out["detection outside of every image"] == 30


def test_ten_thousand_detections_cost_no_more_than_the_most_that_are_taken() -> None:
    watching = Watching()
    watching.run(1.0, sees=False)
    many = [ImageDetection("colour", float(n % 700), float(n % 500)) for n in range(10_000)]
    watching.report(image(watching.now_us, *many))
    watching.run(0.3, sees=False)
    assert watching.platform.part(Cameras).perception.left_out["too many detections"] == 9_800


def test_images_that_come_twice_late_or_in_a_flood_are_left_out_and_counted() -> None:
    watching = Watching()
    perception = watching.platform.part(Cameras).perception
    at_us = watching.now_us
    for valid_us in (at_us, at_us, at_us - 40_000):
        watching.report(image(valid_us))
    assert perception.left_out["image out of order"] == 2
    for number in range(1, 100):
        watching.report(image(at_us + number))
    assert perception.left_out["too many images"] == 84


def test_a_mount_that_reports_no_angles_leaves_the_camera_blind_and_that_is_shown_until_it_sees_again() -> None:
    watching = Watching()
    watching.look_at(PERCEPTS)
    cameras = watching.platform.part(Cameras)
    for _ in range(70):
        watching.now_us += 100_000
        watching.report(AttitudeReport(watching.now_us, "x", 0.0, 0.0, 0.0))
        watching.report(MountReport(watching.now_us, "x", nan, radians(90.0)))
        watching.report(image(watching.now_us, ImageDetection("colour", 300.0, 200.0)))
        watching.platform.on_time(watching.now_us)
    assert watching.samples[PERCEPTS] == []
    (condition,) = cameras.conditions()
    assert condition.text.startswith("cameras: no percepts: ")
    assert "mount without angles" in condition.text
    later = Watching(seed=3)
    later.run(20.0)
    assert tuple(later.platform.part(Cameras).conditions()) == ()


def test_what_is_left_out_is_a_condition_at_once_with_its_count_until_nothing_more_is() -> None:
    watching = Watching(seed=3)
    cameras = watching.platform.part(Cameras)
    watching.run(3.0)
    watching.report(image(watching.now_us - 5_000_000))
    watching.run(0.2)
    (condition,) = cameras.conditions()
    assert condition.text == "cameras: left out: 1 image out of order"
    watching.report(image(watching.now_us - 5_000_000))
    watching.run(10.0)
    (condition,) = cameras.conditions()
    assert condition.text == "cameras: left out: 2 image out of order"
    watching.run(11.0)
    assert list(cameras.conditions()) == []


@pytest.mark.parametrize(
    "attributes",
    [
        (("colour", "r" * 10_000),),
        (("colour", "]; export x"),),
        (("symbol", "vp0_1"), ("end", True), ("x_m", 1e9)),
        (("colour", 7.0), ("colour", nan)),
    ],
)
def test_what_a_detector_calls_its_attributes_changes_nothing_but_the_colour(
    attributes: tuple[tuple[str, str | float | bool], ...],
) -> None:
    watching = Watching()
    watching.look_at(PERCEPTS)
    watching.run(1.0, sees=False)
    for _ in range(30):
        watching.report(image(watching.now_us, ImageDetection("colour", 400.0, 300.0, attributes)))
        watching.run(0.04, sees=False)
    records = [sample.value for sample in watching.samples[PERCEPTS]]
    assert records
    assert {record[0] for record in records} == {"vp0_1"}
    sort = watching.platform.ports.network.generator(PERCEPTS).sort
    for record in records:
        sort.check(record)
        assert abs(record[1] - records[0][1]) < 5.0
        assert not isinstance(record[4], str) or len(record[4]) <= 32
