"""After the scan a box is brought to each person; a UAV that is lost in mid-delivery leaves its work to the other."""

from collections.abc import Sequence
from math import hypot
from pathlib import Path

import pytest

from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import FlyMission, SaliencyRow, SaliencyRows
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.runtime.library.pictures.saliency import FoundPerson, person_of
from dyknow.runtime.library.pictures.supplies import supply_goals
from tests.agents.capabilities.missions.flown import is_over, told
from tests.agents.capabilities.saliency.rescuing import Rescue

pytestmark = pytest.mark.full
EXAMPLES = Path(__file__).parents[4] / "examples"
DOMAIN = (EXAMPLES / "logistics" / "logistics.dom").read_text("utf-8")
DEPOT = (EXAMPLES / "emergency" / "depot.prob").read_text("utf-8")
BROUGHT_M = 6.0
"""A box that lies so near has reached a person: 3 m of standoff, the wind, and what it slides."""


class Delivery:
    """A box is brought to each of these persons, as platform `leader` plans it."""

    def __init__(self, rescue: Rescue, persons: Sequence[FoundPerson], leader: str = "0") -> None:
        self.rescue, self.world = rescue, rescue.world
        goals = supply_goals(persons, DEPOT).text
        content = FlyMission(mission="boxes", domain=DOMAIN, problem=DEPOT, constraints=goals, timeout_s=30.0)
        self.mission: Dialogue = self.world.ask("cc", leader, content)

    @property
    def brought(self) -> int:
        """Persons with a box that lies near them."""
        boxes = [each for each in self.rescue.boxes.at(self.world.now_us) if each.thing.name.startswith("b")]
        return sum(
            any(
                each.holder is None and hypot(each.place[0] - lies.x_m, each.place[1] - lies.y_m) < BROUGHT_M
                for each in boxes
            )
            for lies in self.rescue.persons
        )

    def notes(self, unit: str) -> list[str]:
        return [each for each in self.rescue.notes(unit) if each.startswith("mission ")]

    @property
    def told(self) -> list[str]:
        return told(self.mission)

    def until(self, text: str = "", within_s: int = 1500, dialogue: Dialogue | None = None) -> None:
        for _ in range(within_s):
            if any(text in each for each in self.told) if text else is_over(dialogue or self.mission):
                return
            self.world.run_for(1.0)
        raise AssertionError(f"not within {within_s} s: {self.told[-20:]}")


def scanned() -> Delivery:
    """To all persons of the map, which both platforms made by a scan."""
    rescue = Rescue(5, image_us=200_000)
    rescue.world.run_for(2.0)
    scan = rescue.scan()
    rescue.until_scanned()
    rescue.world.run_for(45.0)
    rescue.world.cancel("cc", "0", scan.conversation)
    rescue.world.run_for(2.0)
    asked = rescue.world.ask("cc", "0", SaliencyRows(), Performative.QUERY_REF)
    rescue.world.run_for(1.0)
    persons = [person_of(row) for said in asked.results for row in said.rows or ()]
    assert len(persons) == 11
    return Delivery(rescue, persons)


def to_the_nearest(count: int) -> Delivery:
    """The delivery of a box to each of as many persons, at known places."""
    rescue = Rescue(5, image_us=200_000)
    rescue.world.run_for(2.0)
    lie = sorted(rescue.persons, key=lambda each: each.y_m)[:count]
    rows = [
        SaliencyRow(
            symbol=f"0:s{at}",
            by=("0",),
            entries=(f"0:s{at}",),
            attributes={"x_m": each.x_m, "y_m": each.y_m, "observed_s": 9.0},
        )
        for at, each in enumerate(lie)
    ]
    return Delivery(rescue, [person_of(row) for row in rows])


def test_each_person_gets_a_box_also_one_whose_box_falls_on_its_way() -> None:
    delivery = scanned()
    delivery.until("started: fly-box-to-goal(uav1")
    delivery.world.run_for(2.0)
    delivery.world.inject("1", "dropped-box", 1_000_000)
    delivery.until("found: ")
    delivery.until()
    assert delivery.told[-1] == "inform: reached: the plan is done", delivery.told[-10:]
    assert delivery.brought == 11


def test_the_work_of_one_that_is_killed_in_mid_delivery_goes_to_the_other() -> None:
    delivery = to_the_nearest(5)
    delivery.until("started: fly-box-to-goal(uav1")
    delivery.world.run_for(2.0)
    delivery.world.kill("1")
    delivery.until()
    assert any(each.startswith("unit lost: uav1 is lost: platform 1") for each in delivery.told)
    (left,) = [each for each in delivery.told if each.startswith("unreached: ")]
    name = left.removeprefix("unreached: the plan does not reach ")
    assert delivery.told[-1] == f"inform: partly reached: the plan is done; not reached: {name}"
    assert delivery.brought == 4


def test_the_mission_of_a_leader_that_is_killed_is_led_by_the_other() -> None:
    delivery = to_the_nearest(5)
    delivery.until("started: fly-box-to-goal(uav0")
    delivery.world.run_for(2.0)
    delivery.world.kill("0")
    for _ in range(900):
        delivery.world.run_for(1.0)
        if any("reached: the plan is done" in each for each in delivery.notes("1")):
            break
    notes = delivery.notes("1")
    assert "mission boxes: leads: platform 1: its leader, platform 0, is gone" in notes, notes
    name = next(each for each in notes if "unreached: the plan does not reach brought-" in each).rpartition(" ")[2]
    assert notes[-1] == f"mission boxes: partly reached: the plan is done; not reached: {name}", notes
    assert delivery.brought == 4
