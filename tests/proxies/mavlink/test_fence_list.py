"""The fence of an autopilot, read item by item; lists that are wrong cost only what is wrong with them."""

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.fences import FenceArea, FenceKind
from dyknow.proxies.mavlink.lists.fence_list import MOST_CORNERS, FenceItem, FenceList, read_areas
from dyknow.proxies.mavlink.ways import OURSELVES, Target

VEHICLE, FENCE = Target(1, 1), mavlink.MAV_MISSION_TYPE_FENCE
IN, OUT, CIRCLE_IN, CIRCLE_OUT = 5001, 5002, 5003, 5004
S = 1_000_000
NAN = float("nan")


def ring(command: int, count: int, said: float | None = None) -> list[FenceItem]:
    """A polygon of `count` corners that says it has `said`."""
    places = [(55.0 + 0.001 * n, 13.0 + 0.001 * (n * n % 7)) for n in range(count)]
    parameter = float(count if said is None else said)
    return [FenceItem(command, parameter, round(x * 1e7), round(y * 1e7)) for x, y in places]


def circle(command: int, radius_m: float, x: int = 550_000_000) -> FenceItem:
    return FenceItem(command, radius_m, x, 130_000_000)


def test_polygons_and_circles_are_read_in_their_order() -> None:
    items = [
        *ring(IN, 4),
        *ring(IN, 3),
        circle(CIRCLE_OUT, 30.0),
        *ring(OUT, 5),
        circle(CIRCLE_IN, 500.0),
        FenceItem(5000, 0.0, 1, 1),
    ]
    areas, problems = read_areas(items)
    assert problems == []
    assert [(area.kind, len(area.corners), area.radius_m) for area in areas] == [
        (FenceKind.INCLUSION, 4, 0.0), (FenceKind.INCLUSION, 3, 0.0), (FenceKind.EXCLUSION, 0, 30.0), (FenceKind.EXCLUSION, 5, 0.0), (FenceKind.INCLUSION, 0, 500.0),
    ]  # fmt: skip
    assert areas[2].centre == (55.0, 13.0)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (ring(IN, 3, 5.0), "expected 5 corners, got 3: the polygon is not closed"),
        (ring(IN, 2), "expected a polygon of 3 to 128 corners, got 2"),
        (ring(OUT, MOST_CORNERS + 1), "expected a polygon of 3 to 128 corners, got 129"),
        (ring(IN, 1, NAN), "expected a number of corners, got nan"),
        (ring(IN, 1, 2.5), "expected a number of corners, got 2.5"),
        (ring(IN, 1, -3.0), "expected a polygon of 3 to 128 corners, got -3"),
        ([*ring(IN, 2, 3.0), FenceItem(IN, 3.0, 910_000_000, 0)], "expected corners on Earth"),
        ([FenceItem(IN, 3.0, 7, 7)] * 3, "expected 3 different corners, got fewer"),
        ([circle(CIRCLE_IN, NAN)], "expected a radius of up to 100000 m, got nan"),
        ([circle(CIRCLE_OUT, 0.0)], "expected a radius of up to 100000 m, got 0"),
        ([circle(CIRCLE_OUT, 5.0, -(2**31))], "expected a centre on Earth"),
        ([FenceItem(16, 0.0, 0, 0)], "expected a polygon or a circle, got command 16"),
    ],
)
def test_an_area_that_is_none_is_reported_and_the_others_are_kept(wrong: list[FenceItem], words: str) -> None:
    areas, problems = read_areas([circle(CIRCLE_OUT, 30.0), *wrong, *ring(OUT, 4)])
    assert [area.kind for area in areas] == [FenceKind.EXCLUSION, FenceKind.EXCLUSION]
    assert len(problems) == 1
    assert problems[0].startswith("fence item 2 of ")
    assert words in problems[0]
    assert "upload a fence that is right" in problems[0]


# -- the list on the wire ---------------------------------------------------------------------------------------------


class Served:
    """An autopilot that serves these items, or does as it is told."""

    def __init__(self, items: list[FenceItem]) -> None:
        self.items, self.reader, self.now_us = items, FenceList(), 0
        self.asked: list[Any] = []

    def step(self, *, answers: bool = True, count: int | None = None) -> bool:
        """Let what is due be sent and answered; whether the areas changed."""
        changed = False
        for message in self.reader.due(VEHICLE, self.now_us):
            self.asked.append(message)
            reply = self.reply(message, len(self.items) if count is None else count) if answers else None
            if reply is not None:
                changed |= self.reader.on_message(reply)
        return changed

    def reply(self, message: Any, count: int) -> Any:
        if message.get_type() == "MISSION_REQUEST_LIST":
            return mavlink.MAVLink_mission_count_message(*OURSELVES, count, FENCE)
        if message.get_type() == "MISSION_REQUEST_INT":
            return self.item(message.seq)
        return None

    def item(self, seq: int, kind: int = FENCE, target: Target = OURSELVES) -> Any:
        one = self.items[seq]
        return mavlink.MAVLink_mission_item_int_message(
            *target, seq, 0, one.command, 0, 1, one.parameter, 0.0, 0.0, 0.0, one.x, one.y, 0.0, kind
        )

    def run(self, seconds: int, **how: Any) -> None:
        for _ in range(seconds):
            for _ in range(2 * len(self.items) + 3):
                self.step(**how)
            self.now_us += S


def test_a_list_is_read_in_one_go_and_acknowledged() -> None:
    served = Served([*ring(IN, 4), circle(CIRCLE_OUT, 30.0)])
    changes = [served.step() for _ in range(8)]
    assert changes.count(True) == 1
    assert len(served.reader.areas) == 2
    assert served.asked[-1].get_type() == "MISSION_ACK"
    assert served.asked[-1].type == mavlink.MAV_MISSION_ACCEPTED
    served.run(59)
    assert len(served.asked) == 7, "once a minute"
    served.run(3)
    assert len(served.asked) == 14


def test_items_out_of_sequence_and_of_others_are_not_taken() -> None:
    served = Served([*ring(IN, 4)])
    served.step()
    served.step(answers=False)
    for message in (
        served.item(1), served.item(3), served.item(0, kind=0), served.item(0, target=Target(255, 190)),
        mavlink.MAVLink_mission_count_message(*OURSELVES, 9, FENCE),
    ):  # fmt: skip
        assert not served.reader.on_message(message)
    served.now_us += S
    served.step(answers=False)
    assert served.asked[-1].seq == 0, "the one that has not come is requested again"
    served.run(3)
    assert len(served.reader.areas[0].corners) == 4


def test_a_list_that_does_not_come_whole_changes_nothing_and_is_reported_once() -> None:
    served = Served([circle(CIRCLE_OUT, 30.0)])
    served.run(2)
    before = served.reader.areas
    served.items = [*ring(IN, 4)]
    served.now_us += 60 * S
    served.step()
    served.step()
    served.run(10, answers=False)
    assert served.reader.areas == before
    assert served.reader.take_problems() == [
        "the autopilot's fence was not read: item 2 of 4 did not come; what was read before counts"
    ]
    served.run(70)
    assert len(served.reader.areas[0].corners) == 4, "it is tried again"
    assert served.reader.take_problems() == []


def test_a_list_that_is_too_long_is_not_read() -> None:
    served = Served([circle(CIRCLE_OUT, 30.0)])
    served.run(2)
    served.now_us += 60 * S
    served.step(count=60_000)
    assert served.reader.take_problems()[0].startswith("the autopilot's fence has 60000 items, 512 are read")
    assert len(served.reader.areas) == 1


def test_an_autopilot_without_lists_is_asked_rarely_and_one_that_says_so_no_more() -> None:
    served = Served([])
    served.run(60, answers=False)
    assert len(served.asked) == 5
    served.now_us += 10 * S
    served.step(answers=False)
    served.reader.on_message(mavlink.MAVLink_mission_ack_message(*OURSELVES, mavlink.MAV_MISSION_UNSUPPORTED, FENCE))
    count = len(served.asked)
    served.run(200, answers=False)
    assert len(served.asked) == count
    served.reader.restart()
    served.step()
    assert len(served.asked) == count + 1


def test_a_fence_that_another_station_uploads_is_read_at_once() -> None:
    served = Served([])
    served.run(2)
    assert served.reader.areas == ()
    served.items = [circle(CIRCLE_OUT, 30.0)]
    served.reader.on_message(mavlink.MAVLink_mission_ack_message(255, 190, mavlink.MAV_MISSION_ACCEPTED, FENCE))
    served.run(1)
    assert served.reader.areas == (FenceArea(FenceKind.EXCLUSION, centre=(55.0, 13.0), radius_m=30.0),)


def test_a_fence_that_is_taken_away_is_gone() -> None:
    served = Served([circle(CIRCLE_OUT, 30.0)])
    served.run(2)
    served.items = []
    served.now_us += 60 * S
    assert any(served.step() for _ in range(4))
    assert served.reader.areas == ()
