"""Percepts of simulated cameras and of simulated trackers become beliefs about the cars that there are."""

from dataclasses import replace
from math import hypot, pi

import numpy as np
import pytest

from dyknow.anchoring.belief.cameras import CameraSensor, camera_view
from dyknow.anchoring.belief.description import Confusion, LifeThresholds, ObjectTypes, WorldModel, WorldSensor, uniform
from dyknow.anchoring.belief.environment import EnvironmentModel
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import Percept
from dyknow.navigation.cameras.ground import FlatGround
from dyknow.navigation.cameras.pinhole import Attitude, CameraPose, Intrinsics, PanTilt
from dyknow.sim_uavs.cameras.detectors import COLOUR_CAMERA
from dyknow.sim_uavs.roads.drivers import COLOURS, Driver
from dyknow.sim_uavs.roads.layouts import cross
from dyknow.sim_uavs.roads.scenes import recorded
from tests.anchoring.belief.worlds import position
from tests.sim_uavs.cameras.flights import IMAGE_US, hover


def streets(side_m: float, **about: float) -> WorldModel:
    count = len(COLOURS)
    right = 0.85 * np.eye(count) + 0.15 / (count - 1) * (1 - np.eye(count))
    camera = WorldSensor(
        "camera", noise={"position_m": np.eye(2)}, confusion={"colour": Confusion(tuple(COLOURS), right)},
        is_frame=True, **about,
    )  # fmt: skip
    return WorldModel(
        ObjectTypes(uniform("type", ("car",))), [position(2, 2.0, side_m)], [uniform("colour", tuple(COLOURS))], (),
        {"camera": camera}, thresholds=LifeThresholds(0.05, 0.95, 0.01), lifetime_s=20.0,
    )  # fmt: skip


def test_cars_below_a_hovering_camera_are_each_one_confirmed_instance_of_the_right_colour() -> None:
    drivers = [
        Driver("a", ("west", "middle", "north"), start_m=190.0, cruise_m_s=10.0, colour="red"),
        Driver("b", ("south", "middle", "east"), start_m=180.0, cruise_m_s=9.0, colour="blue", kind="truck"),
    ]
    model = streets(400.0, detects=0.9, births=0.02, clutter=0.05)
    environment, camera = EnvironmentModel(model), CameraSensor(model, "camera")
    pose = CameraPose(0, np.array([0.0, 0.0, -50.0]), Attitude(0.0, 0.0, 0.5), PanTilt(0.0, pi / 2))
    looks = replace(model.sensors["camera"], view_m=camera_view(COLOUR_CAMERA.intrinsics, pose, FlatGround()))
    found = []
    for image in hover(cross(), drivers, 6.0):
        if image.now_us % (5 * IMAGE_US) == 0:
            seen = camera.of_percepts(image.now_us, image.percepts)
            environment.observe_scan(seen, valid_us=image.now_us, sensor=looks)
            for each in environment.query(min_existence=0.95):
                mean = each.gaussian["position_m"].mean
                of = min(image.truth, key=lambda car, at=mean: hypot(car.x_m - at[0], car.y_m - at[1]))
                off_m = hypot(of.x_m - mean[0], of.y_m - mean[1])
                colour = max(each.categorical["colour"], key=each.categorical["colour"].__getitem__)
                found.append((each.name, of.name, colour, off_m))
    assert {name for _, name, _, _ in found} == {"a", "b"}
    assert len({instance for instance, *_ in found}) == 2
    assert {(name, colour) for _, name, colour, _ in found[-2:]} == {("a", "red"), ("b", "blue")}
    assert np.quantile([off_m for *_, off_m in found], 0.9) < 2.5


@pytest.mark.parametrize("name", ["six", "clutter"])
def test_cars_that_are_hidden_for_seconds_stay_in_belief_and_clutter_is_not_confirmed(name: str) -> None:
    recording = recorded(name, 1)
    xs = [(state.x_m, state.y_m) for look in recording.looks for state in look.truth]
    model = streets(2.2 * max(map(max, (map(abs, each) for each in xs))), detects=0.6, births=0.1, clutter=0.5)
    environment, camera = EnvironmentModel(model), CameraSensor(model, "camera")
    right, wrong = 0, 0
    for look in recording.looks[:150]:
        percepts = [
            Percept(each.percept, "p", ObjectState(look.t_us, each.x_m, each.y_m, 0.0, 0.0, diagonal(each.sd_m)))
            for each in look.percepts
            if not each.end
        ]
        environment.observe_scan(
            camera.of_percepts(look.t_us, percepts), valid_us=look.t_us, sensor=model.sensors["camera"]
        )
        shown = {each.of for each in look.percepts if not each.end and each.of}
        places = [each.gaussian["position_m"].mean for each in environment.query(min_existence=0.95)]
        for car in look.truth:
            if car.name in shown and look.t_us > 2_000_000:
                near = any(hypot(car.x_m - at[0], car.y_m - at[1]) < 3.0 for at in places)
                right, wrong = right + near, wrong + (not near)
    assert right > 0.9 * (right + wrong)


def test_what_the_model_does_not_know_of_a_percept_is_left_out_and_ends_are_no_observations() -> None:
    camera = CameraSensor(streets(100.0), "camera")
    state = ObjectState(0, 1.0, 2.0, 0.0, 0.0, diagonal(0.5), {"colour": "mauve", "speed": 3.0})
    assert camera.of_percepts(0, [Percept("p", "t", None)]) == []
    seen = camera.of_percepts(0, [Percept("p", "t", state)])[0]
    assert set(seen.values) == {"position_m"}
    red = ObjectState(0, 1.0, 2.0, 0.0, 0.0, diagonal(0.5), {"colour": "red"})
    found = camera.of_percepts(0, [Percept("p", "t", red)])[0]
    assert found.values["position_m"] == pytest.approx([1.0, 2.0])
    assert found.values["colour"] == "red"
    assert found.covariance == pytest.approx(red.covariance[:2, :2])


def test_the_field_of_view_of_a_camera_is_below_it_up_to_a_distance_and_none_of_one_that_looks_up() -> None:
    camera = Intrinsics.of_view(100, 100, pi / 2)
    down = CameraPose(0, np.array([10.0, 20.0, -50.0]), Attitude(0.0, 0.0, 0.0), PanTilt(0.0, pi / 2))
    view = camera_view(camera, down, FlatGround())
    assert view is not None
    assert sorted(view.round(6).tolist()) == [[-30.0, -40.0], [-30.0, 60.0], [70.0, -40.0], [70.0, 60.0]]
    ahead = camera_view(camera, down._replace(mount=PanTilt(0.0, 0.0)), FlatGround(), 250.0)
    assert ahead is not None
    assert np.hypot(*(ahead - [20.0, 10.0]).T) == pytest.approx([250.0, 250.0, hypot(50, 50), hypot(50, 50)])
    assert (ahead[:, 1] > 10.0).all()
    assert camera_view(camera, down._replace(mount=PanTilt(0.0, -pi / 3)), FlatGround()) is None
