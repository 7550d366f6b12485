"""`(attend)`: the mount is turned to what is to be learnt, says why, and is turned back."""

from math import pi

import pytest

from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.federation.messages.contents import Attend, Follow, WantObject
from dyknow.navigation.vehicle import LookAtOrder, PointMountOrder
from dyknow.sim_uavs.roads.layouts import cross, network_of
from tests.agents.capabilities.attention.chase import FED, FRAME, Chase, said


def attending(**config: object) -> Chase:
    chase = Chase(**config)
    chase.drive(3.0, 8.0)
    assert said(chase.world.ask("cc", "0", Attend())) == []
    return chase


def test_a_car_that_is_lost_is_looked_for_where_it_is_expected() -> None:
    chase = attending()
    chase.drive(2.0, 8.0)
    chase.end("vp1")
    chase.drive(8.0, 8.0, percept=None)
    looked = [each for each in chase.gazes if each.value[3].startswith("looks for co1, not seen for ")]
    valid_us, (symbol, x_m, y_m, _) = looked[-1].valid_us, looked[-1].value
    car_m = chase.x_m - 8.0 * (chase.world.now_us - valid_us) / 1e6
    assert (symbol, x_m, y_m) == ("co1", pytest.approx(car_m, abs=12.0), pytest.approx(chase.y_m, abs=5.0))
    places = [FRAME.to_ned(*each) for each in chase.looks]
    assert min(abs(east_m - x_m) for _, east_m, _ in places) < 2.0
    assert chase.orders == []


def test_it_decides_five_times_a_second_and_orders_only_what_changes() -> None:
    chase = attending()
    gazes, looks = len(chase.gazes), len(chase.looks)
    chase.drive(10.0)
    assert 45 <= len(chase.gazes) - gazes <= 51
    assert len(chase.looks) - looks < 40


def test_cancelled_it_turns_the_camera_back_and_leaves_it() -> None:
    chase = Chase()
    chase.drive(3.0, 8.0)
    dialogue = chase.ask(Attend(), 1.0)
    assert said(dialogue)[0] == ("agree", "")
    chase.drive(4.0, 8.0)
    chase.world.speak("cc", lambda member, now_us: member.acts.cancel("0", dialogue.conversation, now_us))
    chase.drive(3.0, 8.0)
    order = chase.vehicle.commands[-1][1].order
    assert isinstance(order, PointMountOrder)
    assert order.tilt_rad == pytest.approx(pi / 2.0, abs=0.05)
    sent = len(chase.vehicle.commands)
    chase.drive(3.0, 8.0)
    assert len(chase.vehicle.commands) == sent


def test_while_a_mission_looks_the_camera_is_its_own_and_attention_continues_afterwards() -> None:
    chase = attending()
    claim = chase.platform.built[Pilot.of].mission
    claim.looks, looks = True, len(chase.looks)
    chase.drive(4.0, 8.0)
    assert len(chase.looks) == looks
    claim.looks = False
    chase.drive(2.0, 8.0)
    assert len(chase.looks) > looks


def test_untold_it_leaves_the_camera_alone() -> None:
    chase = Chase()
    chase.drive(5.0, 8.0)
    assert chase.vehicle.commands == []
    assert chase.gazes == []


def test_without_control_it_is_refused() -> None:
    chase = Chase(control=False)
    ((performative, text),) = said(chase.ask(Attend(), 1.0))
    assert performative == "refuse"
    assert "not given control" in text


def test_while_one_is_followed_the_camera_keeps_it_in_view_and_afterwards_attends_as_before() -> None:
    chase = attending()
    dialogue = chase.world.ask("cc", "0", Follow(object="co1"))
    chase.drive(5.0, 8.0)
    assert chase.gazes[-1].value[3] == "follows co1"
    chase.world.speak("cc", lambda member, now_us: member.acts.cancel("0", dialogue.conversation, now_us))
    chase.drive(2.0, 8.0)
    assert chase.gazes[-1].value[3] != "follows co1"
    assert isinstance(chase.vehicle.commands[-1][1].order, LookAtOrder)


def test_a_mount_that_does_not_obey_is_a_condition() -> None:
    chase = Chase()
    chase.vehicle.mount = None
    chase.drive(3.0, 8.0)
    chase.ask(Attend(), 1.0)
    chase.drive(3.0, 8.0)
    assert chase.conditions in ([], ["the camera's mount does not obey: unsupported"])


def test_objects_that_are_no_places_draw_no_camera() -> None:
    chase = Chase(FED)
    chase.ask(Attend(), 0.5)
    chase.feed("car1", float("nan"), 0.0, 1.0)
    chase.feed("car2", 1e12, 0.0, 1.0)
    assert {gaze.value[0] for gaze in chase.gazes} <= {""}
    assert chase.gazes


def test_where_roads_are_known_the_ground_that_is_searched_is_theirs_as_the_vehicle_moves() -> None:
    roads = network_of(cross())
    searching = attending(roads=roads)
    searching.drive(20.0, 0.0, percept=None)
    searched = [each.value for each in searching.gazes if each.value[0] == ""]
    assert searched
    assert all(min(abs(x_m), abs(y_m)) < 2.0 for _, x_m, y_m, _ in searched)


def test_a_wanted_object_that_no_percept_shows_has_the_ground_searched() -> None:
    chase = attending()
    before = sum(each.value[0] == "" for each in chase.gazes)
    chase.ask(WantObject(symbol="suspect", type="cars", description="y_m[suspect] > 500"), 1.0)
    gazes = len(chase.gazes)
    chase.drive(10.0)
    assert sum(each.value[0] == "" for each in chase.gazes[gazes:]) > max(before, 10)
