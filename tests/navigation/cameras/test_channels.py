"""Detections of two cameras: what belongs together is one, what does not stays apart, and pose errors are counted once."""

from math import pi, radians

import numpy as np
import pytest

from dyknow.navigation.cameras.channels import Detection, GroundDetection, fused, located
from dyknow.navigation.cameras.geolocation import USUAL_ERRORS
from dyknow.navigation.cameras.ground import FlatGround
from dyknow.navigation.cameras.pinhole import Attitude, CameraPose, Intrinsics, PanTilt, Pixel
from dyknow.navigation.cameras.state import CameraState

CAMERAS = {
    "colour": Intrinsics.of_view(768, 576, radians(48.0)),
    "thermal": Intrinsics.of_view(384, 288, radians(48.0)),
}
POSE = CameraPose(0, np.array([0.0, 0.0, -50.0]), Attitude(0.0, 0.0, 0.0), PanTilt(0.0, pi / 2))
STATE = CameraState(POSE, USUAL_ERRORS)


def seen(channel: str, north_m: float, east_m: float, **attributes: str) -> list[GroundDetection]:
    pixel = POSE.pixel(CAMERAS[channel], np.array([north_m, east_m, 0.0]))
    assert pixel is not None
    return located([Detection(channel, pixel, attributes)], CAMERAS, STATE, FlatGround())


def test_a_detection_is_put_where_it_is() -> None:
    (found,) = seen("colour", 3.0, -4.0)
    assert found[:2] == pytest.approx((3.0, -4.0))
    assert np.linalg.eigvalsh(found.covariance - found.pixel_covariance).min() > 0.0
    assert not located([Detection("colour", Pixel(1.0, 1.0), {})], CAMERAS, STATE, FlatGround(-60.0))


def test_two_of_one_thing_become_one_with_both_channels_and_attributes() -> None:
    one, other = seen("colour", 3.0, -4.0, colour="red"), seen("thermal", 3.1, -4.0, heat="warm")
    (found,) = fused(one, other)
    assert found.channels == ("colour", "thermal")
    assert found.attributes == {"colour": "red", "heat": "warm"}
    assert 3.0 < found.north_m < 3.05
    for each in (*one, *other):
        assert np.linalg.eigvalsh(each.pixel_covariance - found.pixel_covariance).min() > 0.0


def test_errors_of_the_pose_do_not_shrink_by_fusing() -> None:
    one, other = seen("colour", 3.0, -4.0), seen("thermal", 3.0, -4.0)
    (found,) = fused(one, other)
    pose = one[0].covariance - one[0].pixel_covariance
    assert found.covariance - found.pixel_covariance == pytest.approx(pose, rel=1e-6)
    assert np.trace(found.covariance) > np.trace(pose)


def test_what_is_apart_or_seen_by_one_only_stays_apart() -> None:
    one = seen("colour", 3.0, -4.0) + seen("colour", 10.0, 10.0)
    other = seen("thermal", 9.0, -4.0) + seen("thermal", 10.1, 10.0)
    found = fused(one, other)
    assert sorted(each.channels for each in found) == [("colour",), ("colour", "thermal"), ("thermal",)]
    assert fused(one, []) == one
    assert fused([], other) == other


def test_of_two_that_are_near_each_gets_its_own() -> None:
    places = ((0.0, 0.0), (0.0, 0.9))
    one = [each for north, east in places for each in seen("colour", north, east)]
    other = [each for north, east in reversed(places) for each in seen("thermal", north, east)]
    found = fused(one, other)
    assert sorted(round(each.east_m, 3) for each in found) == [0.0, 0.9]
    assert {each.channels for each in found} == {("colour", "thermal")}
