"""The mission of an autopilot, read item by item: places above the sea, and what is not known of it."""

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.mission_plans import MOST_MISSION_ITEMS, MissionItem, MissionPlanReport, MissionStep
from dyknow.navigation.vehicle import Report
from dyknow.proxies.mavlink.lists.item_list import ListItem
from dyknow.proxies.mavlink.lists.mission_list import read_mission
from dyknow.proxies.mavlink.lists.vehicle_lists import VehicleLists
from dyknow.proxies.mavlink.reports import VehicleReports
from dyknow.proxies.mavlink.ways import OURSELVES, Target

VEHICLE, MISSION, FENCE = Target(1, 1), mavlink.MAV_MISSION_TYPE_MISSION, mavlink.MAV_MISSION_TYPE_FENCE
ABOVE_SEA, ABOVE_HOME, ABOVE_TERRAIN = 0, 6, 11
WAYPOINT, UNLIMITED, RETURN, LAND, TAKE_OFF, SPLINE, DELAY, JUMP, SPEED = 16, 17, 20, 21, 22, 82, 93, 177, 178
S, HOME_M, NAN = 1_000_000, 50.0, float("nan")


def item(command: int = WAYPOINT, z_m: float = 30.0, frame: int = ABOVE_HOME, x: int = 550_000_000) -> ListItem:
    return ListItem(command, frame, 0.0, x, 130_000_000 if x else 0, z_m)


def flies(at: int, altitude_m: float, step: MissionStep = MissionStep.FLY_TO) -> MissionItem:
    return MissionItem(at, step, 55.0, 13.0, altitude_m)


def test_items_are_places_above_the_sea_with_their_numbers() -> None:
    items = [
        item(TAKE_OFF, 20.0), item(), item(SPEED), item(z_m=90.0, frame=ABOVE_SEA), item(19), item(DELAY),
        item(UNLIMITED), item(LAND, 0.0), item(LAND, 0.0, x=0), item(RETURN, NAN),
    ]  # fmt: skip
    read, problems = read_mission(items, HOME_M)
    assert problems == []
    assert read == (
        MissionItem(0, MissionStep.TAKE_OFF, altitude_m=70.0), flies(1, 80.0), flies(3, 90.0), flies(4, 80.0),
        flies(6, 80.0, MissionStep.STAY), MissionItem(7, MissionStep.LAND, 55.0, 13.0),
        MissionItem(8, MissionStep.LAND), MissionItem(9, MissionStep.RETURN),
    )  # fmt: skip


def test_a_home_that_is_the_first_item_is_not_flown() -> None:
    read, _ = read_mission([item(z_m=0.0, frame=ABOVE_SEA), item()], HOME_M, first=1)
    assert read == (flies(1, 80.0),)


def test_before_home_is_known_only_what_is_above_the_sea_is() -> None:
    read, problems = read_mission([item(), item(z_m=90.0, frame=ABOVE_SEA)], None)
    assert read == (MissionItem(0, MissionStep.UNKNOWN), flies(1, 90.0))
    assert problems == []


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (item(SPLINE), "command 82 is not known here"),
        (item(JUMP), "command 177 is not known here"),
        (item(x=910_000_000), "expected a place on Earth, got none"),
        (item(z_m=NAN), "expected an altitude of up to 12000 m, got nan"),
        (item(z_m=2e7), "expected an altitude of up to 12000 m, got 2e+07"),
        (item(frame=ABOVE_TERRAIN), "heights in frame 11 are not known here"),
        (item(frame=1), "heights in frame 1 are not known here"),
    ],
)
def test_an_item_that_is_not_known_is_reported_and_the_others_are_kept(wrong: ListItem, words: str) -> None:
    read, problems = read_mission([item(), wrong, item()], HOME_M)
    assert read == (flies(0, 80.0), MissionItem(1, MissionStep.UNKNOWN), flies(2, 80.0))
    assert problems == [f"mission item 2 of 3: {words}; what follows it is in no intent"]


# -- the list on the wire ---------------------------------------------------------------------------------------------


class Served:
    """An autopilot at home 50 m above the sea that serves this mission and an empty fence."""

    def __init__(self, *items: ListItem, autopilot: int = mavlink.MAV_AUTOPILOT_PX4) -> None:
        self.items, self.now_us = list(items), 0
        self.lists, self.known = VehicleLists(), VehicleReports()
        self.asked: list[Any] = []
        self.plans: list[tuple[MissionItem, ...]] = []
        self._codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self.send(mavlink.MAVLink_heartbeat_message(2, autopilot, 0, 0, 0, 3))
        self.send(
            mavlink.MAVLink_home_position_message(550_000_000, 130_000_000, 50_000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0)
        )

    def send(self, message: Any) -> None:
        """Have the platform hear it, from its bytes."""
        heard = mavlink.MAVLink(None).decode(bytearray(message.pack(self._codec)))
        self.known.reports(heard, self.now_us)
        found: list[Report] = list(self.lists.on_message(heard, self.known, self.now_us))
        self.plans += [report.items for report in found if isinstance(report, MissionPlanReport)]

    def run(self, seconds: int = 1, *, answers: bool = True) -> None:
        for _ in range(seconds):
            while due := self.lists.due(VEHICLE, self.now_us):
                self.asked += due
                for message in due if answers else ():
                    self.answer(message)
            self.now_us += S

    def answer(self, message: Any) -> None:
        is_mission = message.mission_type == MISSION
        if message.get_type() == "MISSION_REQUEST_LIST":
            count = len(self.items) if is_mission else 0
            self.send(mavlink.MAVLink_mission_count_message(*OURSELVES, count, message.mission_type))
        elif message.get_type() == "MISSION_REQUEST_INT" and message.seq < len(self.items):
            one = self.items[message.seq]
            self.send(
                mavlink.MAVLink_mission_item_int_message(
                    *OURSELVES, message.seq, one.frame, one.command, 0, 1, 0.0, 0.0, 0.0, 0.0, one.x, one.y, one.z_m, MISSION
                )
            )  # fmt: skip


def test_a_mission_is_read_after_the_fence_and_acknowledged() -> None:
    served = Served(item(), item(LAND, 0.0))
    served.run()
    assert served.plans == [(flies(0, 80.0), MissionItem(1, MissionStep.LAND, 55.0, 13.0))]
    assert [(each.get_type()[8:], each.mission_type) for each in served.asked] == [
        ("REQUEST_LIST", FENCE), ("ACK", FENCE), ("REQUEST_LIST", MISSION), ("REQUEST_INT", MISSION),
        ("REQUEST_INT", MISSION), ("ACK", MISSION),
    ]  # fmt: skip
    served.run(120)
    assert len(served.plans) == 1, "it is the same"


def test_of_an_ardupilot_the_first_item_is_home() -> None:
    served = Served(item(z_m=50.0, frame=ABOVE_SEA), item(), autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    served.run()
    assert served.plans == [(flies(1, 80.0),)]


def test_a_mission_that_changes_is_read_at_once_and_one_that_is_cleared_is_gone() -> None:
    served = Served(item())
    served.run()
    served.items = [item(), item(z_m=40.0)]
    served.send(mavlink.MAVLink_mission_ack_message(255, 190, mavlink.MAV_MISSION_ACCEPTED, MISSION))
    served.run()
    assert served.plans[1:] == [(flies(0, 80.0), flies(1, 90.0))]
    served.items = []
    served.send(mavlink.MAVLink_mission_current_message(0, 65_535))
    served.run()
    assert served.plans[2:] == [()]


def test_a_home_that_is_reported_later_or_moves_makes_other_altitudes() -> None:
    served = Served(item())
    served.run()
    served.send(mavlink.MAVLink_home_position_message(550_000_000, 130_000_000, 60_000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0))
    assert served.plans[1:] == [(flies(0, 90.0),)]


def test_a_mission_that_does_not_come_whole_changes_nothing_and_is_reported_once() -> None:
    served = Served(item())
    served.run()
    served.items.append(item())
    served.send(mavlink.MAVLink_mission_current_message(0, 2))
    (request,) = served.lists.due(VEHICLE, served.now_us)
    served.answer(request)
    served.run(10, answers=False)
    assert len(served.plans) == 1
    assert served.lists.take_problems() == [
        "the autopilot's mission was not read: item 1 of 2 did not come; what was read before counts"
    ]
    served.run(70)
    assert served.plans[1:] == [(flies(0, 80.0), flies(1, 80.0))]


def test_a_mission_that_is_too_long_is_none() -> None:
    served = Served(item())
    served.run()
    served.items *= MOST_MISSION_ITEMS + 1
    served.send(mavlink.MAVLink_mission_current_message(0, MOST_MISSION_ITEMS + 1))
    served.run()
    assert served.plans[1:] == [()]
    assert served.lists.take_problems()[0].startswith("the autopilot's mission has 257 items, 256 are read")


def test_what_is_not_known_is_reported_once() -> None:
    served = Served(item(), item(SPLINE))
    served.run(130)
    assert len(served.lists.take_problems()) == 1
