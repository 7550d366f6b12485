"""Files of roads that lie somewhere else than what the cameras of a platform see."""

from pathlib import Path

import pytest

from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.model.errors import WrongCall
from dyknow.navigation.cameras.rig import CameraRig
from dyknow.navigation.geodesy import LocalFrame
from dyknow.runtime.configuration.road_files import check_place

RIG = CameraRig({}, LocalFrame(58.4, 15.6, 0.0))


def test_roads_about_another_place_than_the_cameras_are_refused_with_the_origin_that_they_want() -> None:
    roads = RoadNetwork((), (), frame=LocalFrame(58.41, 15.6, 0.0))
    with pytest.raises(WrongCall, match=r"town.json are 0 at a place 1114 m .* \"origin\": \[15.6000000, 58.4000000\]"):
        check_place(Path("town.json"), roads, RIG)
    check_place(Path("town.json"), roads, None)
    check_place(None, RoadNetwork((), (), frame=LocalFrame(58.4, 15.6, 50.0)), RIG)
    check_place(None, RoadNetwork((), ()), RIG)
