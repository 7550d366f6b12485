"""An area is divided among platforms by ask and tell, and again when one leaves (thesis 9.2.3)."""

import math

import pytest
import shapely

from dyknow.agents.capabilities.areas.assignment import MOST_FOR_ONE, AreaAssignment
from dyknow.agents.capabilities.areas.division import MOST, MOST_OF_ONE, AreaDivision
from dyknow.agents.effects import Fed
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.codec import encode_act
from dyknow.federation.messages.contents import AreaRing, AssignArea, DivideArea, Progress, Query, Samples
from tests.agents.rosters import trust
from tests.box import Box, Question

P = Performative
AREA = ("58.000 15.000", "58.000 15.030", "58.010 15.030", "58.006 15.010", "58.010 15.000")
SPEED = "source greatest-speed plate\nstrmgen top[self] = plate\nexport top-speed = top[self]\n"


def fleet(wire: Box, *batteries: float) -> Question:
    for unit, battery in enumerate(batteries):
        wire.fly(str(unit), 0.0, 500.0 * unit)
        wire.vehicle(str(unit)).battery = battery
    wire.centre()
    wire.run(1.5)
    return wire.question("cc", "0", DivideArea(area=AREA))


def pieces(wire: Box) -> dict[str, AssignArea]:
    """What each platform that runs takes as its piece."""
    found = {
        unit: [each.content for each in platform.part(AreaAssignment).pieces.values()]
        for unit, platform in wire.platforms.items()
    }
    return {unit: contents[-1] for unit, contents in found.items() if contents}


def shape(corners: tuple[str, ...]) -> shapely.Polygon:
    return shapely.Polygon([tuple(map(float, reversed(corner.split()))) for corner in corners])


def check_complete(assigned: dict[str, AssignArea]) -> None:
    """Together the area, none twice."""
    whole = shape(AREA)
    shapes = [shapely.union_all([shape(ring.corners) for ring in each.rings]) for each in assigned.values()]
    assert whole.difference(shapely.union_all(shapes)).area < 1e-5 * whole.area
    assert math.isclose(sum(each.area for each in shapes), whole.area, rel_tol=1e-5)
    assert math.isclose(sum(each.share for each in assigned.values()), 1.0, rel_tol=1e-6)


def test_the_leader_asks_divides_by_what_each_can_do_and_informs(wire):
    asked = fleet(wire, 0.8, 0.4, 0.4)
    wire.run(1)
    assigned = pieces(wire)
    assert {unit: round(each.share, 4) for unit, each in assigned.items()} == {"0": 0.5, "1": 0.25, "2": 0.25}
    check_complete(assigned)
    labels = {act.content.arguments["semantic-label"] for act in wire.acts("0", "1", Query.head)}
    assert labels == {"battery", "heli-position"}, "top-speed is not offered, so it is not asked for"
    assert asked.performatives[0] is P.AGREE
    [report] = [each for each in asked.contents if isinstance(each, Progress)]
    assert "0 50%, 1 25%, 2 25%" in report.step
    assert "2 does not say its top-speed" in report.step


def test_a_platform_that_says_how_fast_it_is_gets_more(wire):
    asked = fleet(wire, 0.8, 0.8)
    wire.specify("1", SPEED)
    wire.happens("1", Fed(wire.now_us, "plate", wire.now_us, (30.0,)))
    wire.run(3)
    assert {unit: round(each.share, 4) for unit, each in pieces(wire).items()} == {"0": 0.25, "1": 0.75}
    assert asked.failed is None


def test_who_states_more_than_a_vehicle_has_gets_what_one_has_and_is_named_to_the_delegator(wire):
    asked = fleet(wire, 1.0, 3.0)
    wire.specify("1", SPEED)
    wire.happens("1", Fed(wire.now_us, "plate", wire.now_us, (30_000.0,)))
    wire.run(3)
    assert {unit: round(each.share, 3) for unit, each in pieces(wire).items()} == {"0": 0.143, "1": 0.857}
    report = [each.step for each in asked.contents if isinstance(each, Progress)][-1]
    assert "1 states a top speed of 30000 m/s, counted as 60; 1 states a battery of 300%, counted as 100%" in report
    assert "0 states" not in report
    assert any("1 states a top speed" in note for note in wire.nodes["0"].notes)


def test_each_piece_is_a_stream_of_its_platform(wire):
    fleet(wire, 0.8, 0.8)
    wire.run(3)
    found = wire.asked("cc", "1", Query(semantic_label="assigned-area"), P.QUERY_REF)
    [samples] = [each for each in found.contents if isinstance(each, Samples)]
    value = samples.samples[-1].value
    assert math.isclose(value["share"], 0.5, rel_tol=1e-6)
    middle = shapely.Point(value["longitude_deg"], value["latitude_deg"])
    assert shape(tuple(value["border"].split(", "))).contains(middle)


@pytest.mark.parametrize("way", ["kill", "end"])
def test_when_one_leaves_the_area_is_divided_again_within_five_seconds(wire, way):
    fleet(wire, 0.8, 0.8, 0.8)
    wire.run(2)
    getattr(wire, way)("2")
    wire.run(5)
    assigned = pieces(wire)
    assert {unit: round(each.share, 4) for unit, each in assigned.items()} == {"0": 0.5, "1": 0.5}
    check_complete(assigned)


def test_one_that_comes_gets_its_part(wire):
    fleet(wire, 0.8, 0.8)
    wire.run(2)
    wire.fly("2", 0.0, 1000.0)
    wire.run(5)
    check_complete(pieces(wire))
    assert set(pieces(wire)) == {"0", "1", "2"}


def test_a_platform_whose_battery_is_low_gets_none_and_that_is_reported(wire):
    asked = fleet(wire, 0.8, 0.05)
    wire.run(1)
    assert set(pieces(wire)) == {"0"}
    assert "1 gets none: its battery is low" in asked.contents[-1].step


def test_only_those_with_the_sensor_take_part(wire):
    fleet(wire, 0.8, 0.8)
    wire.specify(
        "1", 'label gas-level : gas in ppm "gas"\nsource gas s\nstrmgen g[self] = s\nexport gas-level = g[self]'
    )
    wire.run(1)
    wire.question("cc", "0", DivideArea(area=AREA, sensor="gas-level"))
    wire.run(2)
    by_task = [each for each in wire.platform("0").part(AreaDivision).areas.values() if each.content.sensor]
    assert list(by_task[0].pieces) == ["1"]


def test_cancelled_it_is_taken_back_everywhere(wire):
    asked = fleet(wire, 0.8, 0.8)
    wire.run(2)
    ended = wire.cancel_task("cc", "0", asked.conversation)
    wire.run(1)
    assert ended.trouble is None
    assert pieces(wire) == {}
    assert [entry.label for entry in wire.platform("1").ports.labels() if entry.label == "assigned-area"] == []
    wire.kill("1")
    wire.run(4)
    assert pieces(wire) == {}


def test_neighbours_lie_in_the_order_in_which_the_platforms_do(wire):
    for unit, east_m in (("0", 1500.0), ("1", 0.0), ("2", 700.0)):
        wire.fly(unit, 0.0, east_m)
    wire.centre()
    wire.run(1.5)
    wire.question("cc", "0", DivideArea(area=AREA))
    wire.run(1)
    east = {unit: float(each.middle.split()[1]) for unit, each in pieces(wire).items()}
    assert east["1"] < east["2"] < east["0"]


def leaders(wire: Box) -> set[str]:
    """Who leads a division, of the platforms that run."""
    return {unit for unit, platform in wire.platforms.items() if platform.part(AreaDivision).areas}


@pytest.mark.parametrize("way", ["kill", "end"])
def test_when_the_leader_is_gone_the_next_tells_so_within_two_seconds_and_has_divided_again_within_five(wire, way):
    fleet(wire, 0.8, 0.8, 0.8)
    wire.run(2)
    getattr(wire, way)("0")
    wire.run(2)
    assert any("leads" in note and "since 0 is gone" in note for note in wire.nodes["1"].notes)
    wire.run(3)
    assert leaders(wire) == {"1"}
    assigned = pieces(wire)
    assert {unit: round(each.share, 4) for unit, each in assigned.items()} == {"1": 0.5, "2": 0.5}
    check_complete(assigned)
    assert any("1 50%, 2 50%" in note for note in wire.nodes["1"].notes)
    assert not wire.platform("2").part(AreaAssignment).conditions()
    wire.kill("1")
    wire.run(5)
    assert {unit: each.share for unit, each in pieces(wire).items()} == {"2": 1.0}, "and so on, to the last"


def test_a_successor_is_ended_as_its_leader_was(wire):
    asked = fleet(wire, 0.8, 0.8, 0.8)
    wire.run(2)
    wire.kill("0")
    wire.run(4)
    assert wire.cancel_task("cc", "1", asked.conversation).trouble is None
    wire.run(1)
    assert pieces(wire) == {}
    assert leaders(wire) == set()


def test_a_leader_that_is_restarted_and_one_that_comes_are_given_pieces_by_the_successor(wire):
    fleet(wire, 0.8, 0.8, 0.8)
    wire.run(2)
    wire.kill("0")
    wire.run(4)
    wire.restart("0")
    wire.fly("3", 0.0, 2000.0)
    wire.run(6)
    assert leaders(wire) == {"1"}
    assert set(pieces(wire)) == {"0", "1", "2", "3"}
    check_complete(pieces(wire))


def test_a_leader_that_was_cut_off_leads_again_when_it_is_back(wire):
    fleet(wire, 0.8, 0.8, 0.8)
    wire.run(2)
    wire.cut(["0"], ["1", "2", "cc"])
    wire.run(6)
    assert leaders(wire) == {"0", "1"}
    check_complete({unit: each for unit, each in pieces(wire).items() if unit != "0"})
    check_complete({"0": pieces(wire)["0"]})
    wire.wire.mend_all()
    wire.run(12)
    assert leaders(wire) == {"0"}
    check_complete(pieces(wire))


def test_of_two_successors_the_one_that_sorts_first_stays(wire):
    fleet(wire, 0.8, 0.8, 0.8)
    wire.run(2)
    wire.cut(["0"], ["1", "2", "cc"])
    wire.cut(["1"], ["2", "cc"])
    wire.run(8)
    assert leaders(wire) == {"0", "1", "2"}
    wire.kill("0")
    wire.wire.mend_all()
    wire.run(14)
    assert leaders(wire) == {"1"}
    check_complete(pieces(wire))


# Hostile


def assigned_by(wire: Box, sender: str, to: str, task: str, evidence: bytes, generation: int = 99) -> None:
    ring = AreaRing(corners=("1 1", "1 2", "2 2"))
    forged = AssignArea(task=task, generation=generation, rings=(ring,), share=1.0)
    wire.speak(sender, lambda member, now_us: member.acts.tell(to, forged, now_us, evidence=evidence))
    wire.run(0.2)


def test_an_assignment_by_another_than_the_leader_is_refused_and_counted(wire):
    asked = fleet(wire, 0.8, 0.8, 0.8)
    wire.run(2)
    before, evidence = pieces(wire), wire.evidence(asked.conversation)
    assigned_by(wire, "cc", "1", asked.conversation, b"")
    assigned_by(wire, "2", "1", asked.conversation, b"")
    assert wire.platform("1").part(AreaAssignment).refused == {"unproven": 2}
    assigned_by(wire, "2", "1", asked.conversation, evidence)
    assert pieces(wire) == before, "nor by one that would be its successor, while others are there"
    assert wire.platform("1").part(AreaAssignment).refused == {"unproven": 2, "succession": 1}


def test_a_division_that_nobody_else_asked_for_is_refused(wire):
    fleet(wire, 0.8, 0.8, 0.8)
    wire.run(2)
    before = pieces(wire)
    name = wire.question("2", "0", DivideArea(area=AREA)).conversation.rpartition(".")[0]
    wire.run(2)
    own = Act(
        P.REQUEST, AgentName("interface", "2"), AgentName("interface", "2"), DivideArea(area=AREA).expr(),
        f"{name}9.2", created_us=wire.now_us,
    )  # fmt: skip
    for task, evidence in ((f"{name}9.2", encode_act(own)), (f"{name}9.2", b""), (f"{name}9.0", encode_act(own))):
        assigned_by(wire, "2", "1", task, evidence)
    assert f"{name}9.2" not in wire.platform("1").part(AreaAssignment).known
    assert wire.platform("1").part(AreaAssignment).refused == {"unproven": 3}
    assert len(wire.platform("1").part(AreaAssignment).pieces) == 1 + len(before) // len(before)


def test_what_is_over_is_not_begun_again_by_its_evidence(wire):
    asked = fleet(wire, 0.8, 0.8, 0.8)
    wire.run(2)
    evidence = wire.evidence(asked.conversation)
    wire.cancel("cc", "0", asked.conversation)
    wire.run(1)
    assert pieces(wire) == {}
    assigned_by(wire, "0", "1", asked.conversation, evidence)
    assert pieces(wire) == {}
    assert wire.platform("1").part(AreaAssignment).refused == {"cancelled": 1}


def test_an_earlier_division_does_not_take_the_place_of_a_later_one(wire):
    fleet(wire, 0.8, 0.8)
    wire.run(2)
    assignment = wire.platform("1").part(AreaAssignment)
    [(task, piece)] = assignment.pieces.items()
    assignment.assign("0", 1, AssignArea(task=task, generation=0), piece.evidence, wire.now_us)
    assert assignment.pieces[task] is piece
    assert assignment.refused == {"superseded": 1}


def test_an_absurd_speed_is_believed_up_to_a_limit(wire):
    fleet(wire, 0.8, 0.8)
    wire.specify("1", SPEED)
    wire.happens("1", Fed(wire.now_us, "plate", wire.now_us, (1e9,)))
    wire.run(3)
    assert round(pieces(wire)["0"].share, 3) == round(10 / 70, 3)


def test_a_member_leaves_room_for_the_divisions_of_others_with_leaders_and_receivers(wire):
    for unit in "012":
        wire.join(unit, trust=trust(unit))
    wire.centre("cc", trust=trust("cc"))
    wire.run(1.5)
    for leader in "01":
        asked = [wire.asked("2", leader, DivideArea(area=AREA)) for _ in range(MOST)]
        assert [each.performatives[0] for each in asked] == [P.AGREE] * MOST_OF_ONE + [P.REFUSE] * (MOST - MOST_OF_ONE)
        assert asked[-1].contents[-1].code == "too-many-tasks"
    wire.run(2)
    assert len(wire.platform("1").part(AreaAssignment).known) == 2 * MOST_FOR_ONE, "of its own leading as many again"
    assert wire.platform("2").part(AreaAssignment).refused == {"too-many-pieces": MOST_FOR_ONE}
    wire.end("2")
    wire.run(6)
    for leader in "01":
        asked = [wire.asked("cc", leader, DivideArea(area=AREA)) for _ in range(MOST - MOST_OF_ONE)]
        assert {each.performatives[0] for each in asked} == {P.AGREE}
    wire.run(3)
    for unit in "01":
        delegators = [each.evidence.delegator for each in wire.platform(unit).part(AreaAssignment).known.values()]
        assert delegators.count("cc") == 2 * (MOST - MOST_OF_ONE)


@pytest.mark.parametrize(
    "corners", [("58 15", "58.1 15.1", "58.1 15", "58 15.1"), ("0 0", "0 9", "9 9")], ids=["crossing", "too large"]
)
def test_what_is_no_area_is_refused(wire, corners):
    wire.join("0")
    wire.centre()
    wire.run(1)
    forged = DivideArea.model_construct(area=corners)
    assert wire.asked("cc", "0", forged).performatives == [P.NOT_UNDERSTOOD]
