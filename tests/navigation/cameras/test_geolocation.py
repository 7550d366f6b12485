"""Pinhole, mount, ground and geolocation: properties of the geometry, and the error at 80 m by simulation."""

from math import cos, pi, radians, sin

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dyknow.model.errors import DyknowError
from dyknow.navigation.cameras.geolocation import USUAL_ERRORS, GroundPoint, PoseErrors, geolocate
from dyknow.navigation.cameras.ground import ElevationGrid, FlatGround, GroundModel
from dyknow.navigation.cameras.pinhole import Attitude, CameraPose, Intrinsics, PanTilt, Pixel, aimed

CAMERA = Intrinsics.of_view(640, 480, radians(60.0))
angles = st.floats(-0.4, 0.4)
attitudes = st.builds(Attitude, angles, angles, st.floats(-pi, pi))
mounts = st.builds(PanTilt, st.floats(-pi, pi), st.floats(0.0, pi / 2))
places = st.tuples(st.floats(-300, 300), st.floats(-300, 300), st.floats(-150, -20)).map(np.array)
pixels = st.builds(Pixel, st.floats(1, 639), st.floats(1, 479))
SLOPE = ElevationGrid(
    np.array([[0.02 * row * 25.0 + 2.0 * sin(column / 3.0) for column in range(81)] for row in range(81)]),
    -1000.0,
    -1000.0,
    25.0,
)


def hand_turned(attitude: Attitude) -> np.ndarray:
    """Yaw, pitch and roll as three turns, written out."""
    r, p, y = attitude
    yaw = np.array([[cos(y), -sin(y), 0], [sin(y), cos(y), 0], [0, 0, 1]])
    pitch = np.array([[cos(p), 0, sin(p)], [0, 1, 0], [-sin(p), 0, cos(p)]])
    roll = np.array([[1, 0, 0], [0, cos(r), -sin(r)], [0, sin(r), cos(r)]])
    return yaw @ pitch @ roll


@given(attitudes, mounts)
def test_rotations_are_right_handed_and_those_of_three_turns(attitude: Attitude, mount: PanTilt) -> None:
    for rotation in (attitude.rotation(), mount.rotation(), CameraPose(0, np.zeros(3), attitude, mount).rotation()):
        assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert attitude.rotation() == pytest.approx(hand_turned(attitude), abs=1e-12)


def test_at_rest_the_camera_looks_forward_and_pans_right_and_tilts_down() -> None:
    ahead = np.array([0.0, 0.0, 1.0])
    assert PanTilt().rotation() @ ahead == pytest.approx(np.array([1.0, 0.0, 0.0]))
    assert PanTilt(pan_rad=pi / 2).rotation() @ ahead == pytest.approx(np.array([0.0, 1.0, 0.0]), abs=1e-12)
    assert PanTilt(tilt_rad=pi / 2).rotation() @ ahead == pytest.approx(np.array([0.0, 0.0, 1.0]), abs=1e-12)


@given(pixels)
def test_a_pixel_s_ray_is_seen_in_that_pixel(pixel: Pixel) -> None:
    assert CAMERA.pixel(7.0 * CAMERA.ray(pixel)) == pytest.approx(pixel, abs=1e-6)
    assert CAMERA.pixel(-CAMERA.ray(pixel)) is None


def test_the_edges_of_the_image_are_the_angle_of_view_apart() -> None:
    left, right = (CAMERA.ray(Pixel(u, 240.0)) for u in (0.0, 640.0))
    cosine = left @ right / np.linalg.norm(left) / np.linalg.norm(right)
    assert np.arccos(cosine) == pytest.approx(radians(60.0))
    assert CAMERA.pixel(np.array([np.tan(radians(30.1)), 0.0, 1.0])) is None


@given(attitudes, places, st.floats(-200, 200), st.floats(-200, 200))
def test_what_the_mount_is_aimed_at_is_in_the_middle_of_the_image(
    attitude: Attitude, place: np.ndarray, north: float, east: float
) -> None:
    target = np.array([north, east, 0.0])
    pose = CameraPose(0, place, attitude, aimed(attitude, place, target))
    assert pose.pixel(CAMERA, target) == pytest.approx((320.0, 240.0), abs=1e-5)


@pytest.mark.parametrize("ground", [FlatGround(3.0), SLOPE], ids=["flat", "grid"])
@given(attitudes, mounts, places, pixels)
def test_what_a_pixel_shows_is_on_the_ground_and_projects_back_to_the_pixel(
    ground: GroundModel, attitude: Attitude, mount: PanTilt, place: np.ndarray, pixel: Pixel
) -> None:
    pose = CameraPose(0, place, attitude, mount)
    seen = geolocate(CAMERA, pose, pixel, ground)
    assume(seen is not None)
    assert isinstance(seen, GroundPoint)
    assume(seen.range_m < 1500.0)
    assert seen.down_m == pytest.approx(ground.down_m(seen.north_m, seen.east_m), abs=1e-3)
    back = pose.pixel(CAMERA, np.array(seen[:3]))
    assert back == pytest.approx(pixel, abs=1e-3)
    assert seen.range_m == pytest.approx(np.linalg.norm(np.array(seen[:3]) - place))


@given(attitudes, mounts, places, pixels)
def test_a_level_grid_is_a_flat_ground(attitude: Attitude, mount: PanTilt, place: np.ndarray, pixel: Pixel) -> None:
    pose = CameraPose(0, place, attitude, mount)
    flat = geolocate(CAMERA, pose, pixel, FlatGround(1.0))
    assume(flat is not None)
    assert flat is not None
    assume(flat.range_m < 1500.0)
    grid = geolocate(CAMERA, pose, pixel, ElevationGrid(np.ones((2, 2)), 0.0, 0.0, 10.0))
    assert grid is not None
    assert grid[:3] == pytest.approx(flat[:3], abs=1e-3)
    assert grid.covariance == pytest.approx(flat.covariance, rel=1e-3)


def test_a_ray_to_the_sky_or_from_below_meets_no_ground() -> None:
    up = CameraPose(0, np.array([0.0, 0.0, -50.0]), Attitude(0.0, 0.5, 0.0), PanTilt())
    below = CameraPose(0, np.array([0.0, 0.0, 50.0]), Attitude(0.0, 0.0, 0.0), PanTilt(tilt_rad=1.0))
    for pose in (up, below):
        for ground in (FlatGround(), ElevationGrid(np.zeros((2, 2)), 0.0, 0.0, 10.0)):
            assert geolocate(CAMERA, pose, Pixel(320.0, 240.0), ground) is None


def shifted(
    camera: Intrinsics, pose: CameraPose, pixel: Pixel, down_m: float, move: np.ndarray
) -> tuple[float, float] | None:
    """The place that is found if place, angles, pixel and ground are off by `move`, (11,)."""
    moved = CameraPose(
        0,
        pose.position_m + move[:3],
        Attitude(*np.add(pose.attitude, move[3:6])),
        PanTilt(*np.add(pose.mount, move[6:8])),
    )
    seen = geolocate(camera, moved, Pixel(*np.add(pixel, move[8:10])), FlatGround(down_m + move[10]))
    return None if seen is None else (seen.north_m, seen.east_m)


def spreads(errors: PoseErrors) -> np.ndarray:
    return np.array(
        [errors.level_m, errors.level_m, errors.vertical_m, errors.lean_rad, errors.lean_rad, errors.yaw_rad]
        + [errors.mount_rad] * 2 + [errors.pixel_px] * 2 + [errors.ground_m]
    )  # fmt: skip


@given(attitudes, mounts, places, pixels)
def test_the_covariance_is_that_of_differences_of_every_error(
    attitude: Attitude, mount: PanTilt, place: np.ndarray, pixel: Pixel
) -> None:
    pose = CameraPose(0, place, attitude, mount)
    seen = geolocate(CAMERA, pose, pixel, FlatGround())
    assume(seen is not None)
    assert seen is not None
    assume(seen.range_m < 400.0)
    columns = []
    for index, sd in enumerate(spreads(USUAL_ERRORS)):
        step = np.zeros(11)
        step[index] = 1e-4 * sd
        ahead, behind = shifted(CAMERA, pose, pixel, 0.0, step), shifted(CAMERA, pose, pixel, 0.0, -step)
        assume(ahead is not None and behind is not None)
        columns.append(np.subtract(ahead, behind) / 2e-4)  # type: ignore[arg-type]
    jacobian = np.array(columns)
    assert seen.covariance == pytest.approx(jacobian.T @ jacobian, rel=1e-3, abs=1e-4)


def errors_at(range_m: float, height_m: float, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Errors in metres, (count,), of places at this range, and their Mahalanobis distances, with the usual errors."""
    rng = np.random.default_rng(seed)
    reach = (range_m**2 - height_m**2) ** 0.5
    misses, ratios = [], []
    while len(misses) < count:
        bearing = rng.uniform(-pi, pi)
        target = np.array([reach * cos(bearing), reach * sin(bearing), 0.0])
        place = np.array([0.0, 0.0, -height_m])
        attitude = Attitude(*rng.normal(0.0, 0.08, 2), rng.uniform(-pi, pi))
        truth = CameraPose(
            0, place, attitude, aimed(attitude, place, target + np.array([*rng.normal(0.0, 10.0, 2), 0.0]))
        )
        pixel = truth.pixel(CAMERA, target)
        if pixel is None:
            continue
        draw = rng.normal(size=11) * spreads(USUAL_ERRORS)
        believed = CameraPose(
            0, place + draw[:3], Attitude(*np.add(attitude, draw[3:6])), PanTilt(*np.add(truth.mount, draw[6:8]))
        )
        seen = geolocate(CAMERA, believed, Pixel(*np.add(pixel, draw[8:10])), FlatGround(draw[10]))
        assert seen is not None
        off = np.array([seen.north_m, seen.east_m]) - target[:2]
        misses.append(float(np.hypot(*off)))
        ratios.append(float(off @ np.linalg.solve(seen.covariance, off)))
    return np.array(misses), np.array(ratios)


@pytest.mark.parametrize("height_m", [30.0, 40.0, 50.0, 60.0])
def test_at_80_m_the_error_is_below_5_m_in_95_of_100_and_the_covariance_says_so(height_m: float) -> None:
    misses, ratios = errors_at(80.0, height_m, 1000, 7)
    assert np.quantile(misses, 0.95) < 5.0
    assert np.mean(ratios) == pytest.approx(2.0, abs=0.3)
    assert np.mean(ratios < 5.99) == pytest.approx(0.95, abs=0.03)


def test_impossible_cameras_and_grounds_are_refused() -> None:
    with pytest.raises(DyknowError, match="give at least one pixel"):
        Intrinsics.of_view(640, 480, 4.0)
    with pytest.raises(DyknowError, match="finite elevations"):
        ElevationGrid(np.array([[0.0, np.nan], [0.0, 0.0]]), 0.0, 0.0, 10.0)
