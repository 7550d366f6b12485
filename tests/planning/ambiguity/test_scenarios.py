"""The five scenarios of "Have another look", section 5, and their variants, in simulation."""

from dataclasses import replace

import pytest

from dyknow.anchoring.matching.candidates import CandidateMatch
from dyknow.anchoring.matching.descriptions import AllowedPlace
from dyknow.anchoring.matching.situations import MatchingOptions
from dyknow.kpl.syntax.grammar import parse_tree
from dyknow.planning.ambiguity.anchoring_recovery import AnchoringRecovery, RecoveryLimits
from dyknow.planning.ambiguity.hypotheses import LookingKnowledge
from dyknow.planning.ambiguity.recovery_messages import (
    FeatureObserved,
    FindRequested,
    PerceptsSeen,
    RecoveryFailed,
    SensingActionEnded,
    SymbolAnchored,
    TopPlanHalted,
    TopPlanResumed,
)
from tests.planning.ambiguity.robot import MARK_FROM, ROOM, WAYS, Bottle, Robot, described

FIND, REACQUIRE = MatchingOptions(), MatchingOptions("reacquire")
RED_MARKED = described(colour="red", mark=True)
SEEDS = range(10)


def looks(robot: Robot) -> int:
    return sum(each.startswith("(look-at") for each in robot.log)


def test_scenario_1_without_ambiguity_the_top_plan_is_never_halted() -> None:
    robot = Robot([Bottle("po-1", (2.0, 2.0), colour="green")])
    assert robot.anchor("b1", described(colour="green"), FIND)
    assert robot.log == ["anchored po-1"]


@pytest.mark.parametrize("seen_from", ROOM[1:])
def test_scenario_2_searches_the_room_until_the_first_sighting(seen_from: str) -> None:
    robot = Robot([Bottle("po-1", (2.0, 2.0), visible_from=(seen_from,))])
    assert robot.anchor("b1", described(colour="red"), FIND)
    assert robot.log[:2] == ["halted", "case 1 plan 6 4"]
    assert robot.log[-2:] == ["anchored po-1", "resumed"]
    assert looks(robot) == ROOM.index(seen_from)
    assert robot.place == seen_from


def test_scenario_2_without_a_bottle_ends_in_not_present() -> None:
    robot = Robot([])
    assert not robot.anchor("b1", described(colour="red"), FIND)
    assert robot.log[-1] == "failed absent: not present"
    assert looks(robot) == 3
    assert "resumed" not in robot.log


@pytest.mark.parametrize("side", ROOM[1:])
def test_scenario_3_looks_for_the_mark_from_each_viewpoint(side: str) -> None:
    robot = Robot([Bottle("po-1", (2.0, 2.0), mark_from=side)])
    assert robot.anchor("b1", RED_MARKED, FIND)
    assert robot.log[:2] == ["halted", "case 2 plan 7 4"]
    assert robot.log[-2:] == ["anchored po-1", "resumed"]
    assert looks(robot) == ROOM.index(side)


def test_scenario_3_without_a_mark_nothing_is_anchored() -> None:
    robot = Robot([Bottle("po-1", (2.0, 2.0))])
    assert not robot.anchor("b1", RED_MARKED, FIND)
    assert robot.log[-1] == "failed: none of the candidates is as described"
    assert "(anchor b1 f) :success" in robot.printed()[0]


@pytest.mark.parametrize("seed", SEEDS)
def test_scenario_3_of_two_bottles_the_marked_one_is_found(seed: int) -> None:
    marked, side = seed % 2, ROOM[1 + seed % 3]
    bottles = [Bottle(f"po-{n}", (float(n), 2.0), mark_from=side if n == marked else "") for n in range(2)]
    robot = Robot(bottles, seed=seed)
    assert robot.anchor("b1", RED_MARKED, FIND)
    assert robot.log[1] == "case 2 plan 10 7"
    assert robot.anchors == {"b1": f"po-{marked}"}


def reacquired(robot: Robot, *later: Bottle) -> None:
    """Scenario 4: find a marked bottle, leave, come back to what may have changed, and reacquire it."""
    assert robot.anchor("b1", described(mark=True, is_definite=False), FIND)
    assert robot.log == ["anchored po-1"]
    found = next(each for each in robot.bottles if each.name == "po-1")
    for place in ("r1_4", "corridor", "r1_4", "r1_1"):
        robot.move(place)
    if later:
        robot.bottles = list(later)
    for each in robot.bottles:  # from the door the mark is not seen
        each.mark_from = {"r1_1": "r1_3"}.get(each.mark_from, each.mark_from)
    near = described(mark=True, position_m=AllowedPlace(found.at_m, 0.5))
    assert robot.anchor("b1", near, REACQUIRE)
    assert robot.log[1] == "halted"
    assert robot.log[-1] == "resumed"


def test_scenario_4_reacquires_the_marked_bottle_although_odometry_has_drifted() -> None:
    robot = Robot([Bottle("po-1", (1.0, 2.0), mark_from="r1_1"), Bottle("po-2", (2.0, 2.0))])
    reacquired(robot)
    assert robot.log[2] == "case 2 plan 10 7"
    assert robot.anchors == {"b1": "po-1"}
    assert robot.place == "r1_3"


def test_scenario_4_moved_bottles_and_a_new_one_are_ambiguous_and_resolved_by_looking() -> None:
    both = [Bottle("po-1", (1.0, 2.0), mark_from="r1_1"), Bottle("po-2", (2.0, 2.0))]
    moved = [Bottle("po-3", (2.0, 2.0)), Bottle("po-4", (1.0, 2.0), mark_from="r1_2")]
    robot = Robot(both)
    reacquired(robot, *moved)
    assert robot.anchors == {"b1": "po-4"}
    more = [*moved, Bottle("po-5", (3.0, 2.0))]
    robot = Robot(both[:1])
    both[0].mark_from = "r1_1"
    reacquired(robot, *more)
    assert robot.anchors == {"b1": "po-4"}
    assert robot.plans[0].hypotheses == 10


def test_scenario_4_bottles_that_overlapped_while_they_were_moved_have_new_percepts() -> None:
    robot = Robot([Bottle("po-1", (1.0, 2.0), mark_from="r1_1"), Bottle("po-2", (2.0, 2.0))])
    overlapped = [Bottle("po-6", (1.5, 2.0), mark_from="r1_4"), Bottle("po-7", (1.6, 2.0))]
    reacquired(robot, *overlapped)
    assert robot.anchors == {"b1": "po-6"}


@pytest.mark.parametrize("wanted", [0, 1])
def test_scenario_5_localises_to_know_which_of_two_identical_bottles_it_is(wanted: int) -> None:
    bottles = [Bottle("po-1", (1.0, 2.0)), Bottle("po-2", (3.0, 2.0))]
    ways = {**{place: [*others, "home"] for place, others in WAYS.items()}, "home": list(ROOM)}
    knowledge = LookingKnowledge(ways, "r1_1", {"position_m": ["home"]}, is_present=True)
    robot = Robot(bottles, knowledge, sd_m=2.0)
    near = described(position_m=AllowedPlace(bottles[wanted].at_m, 0.5))
    assert robot.anchor("b1", near, REACQUIRE)
    assert robot.log[:4] == ["halted", "case 2 plan 3 2", "(move home)", "(look-at po-1)"]
    assert robot.anchors == {"b1": bottles[wanted].name}


def test_case_5_asks_for_a_property_that_discriminates_and_names_it() -> None:
    robot = Robot([Bottle("po-1", (1.0, 2.0), colour="red"), Bottle("po-2", (1.0, 2.0), colour="green")])
    assert not robot.anchor("b1", described(), FIND)
    assert robot.log == [
        "halted",
        "which colour does it have: green (po-2), red (po-1)?",
        "failed: the description is insufficient",
    ]


def test_what_a_search_finds_may_be_ambiguous_again() -> None:
    robot = Robot([Bottle("po-1", (2.0, 2.0), mark_from="r1_4", visible_from=("r1_2", "r1_3", "r1_4"))])
    assert robot.anchor("b1", RED_MARKED, FIND)
    assert [(each.level, each.case) for each in robot.plans] == [(1, 1), (2, 2)]
    assert robot.log[-2:] == ["anchored po-1", "resumed"]
    assert robot.log.count("halted") == 1


def test_a_search_continues_when_what_it_saw_is_not_the_object() -> None:
    unmarked = Bottle("po-1", (2.0, 2.0), visible_from=("r1_2",))
    marked = Bottle("po-2", (3.0, 2.0), mark_from="r1_4", visible_from=("r1_4",))
    robot = Robot([unmarked, marked])
    assert robot.anchor("b1", RED_MARKED, FIND)
    assert [(each.level, each.case) for each in robot.plans][:3] == [(1, 1), (2, 2), (1, 1)]
    assert robot.anchors == {"b1": "po-2"}
    robot = Robot([unmarked])
    assert not robot.anchor("b1", RED_MARKED, FIND)
    assert robot.log[-1] == "failed absent: not present"


def test_a_look_without_observation_is_replanned_from_elsewhere() -> None:
    robot = Robot([Bottle("po-1", (2.0, 2.0), mark_from="r1_3"), Bottle("po-2", (3.0, 2.0))], lost_looks=1)
    assert robot.anchor("b1", RED_MARKED, FIND)
    assert robot.log.count("timeout") == 1
    assert robot.anchors == {"b1": "po-1"}
    deaf = Robot([Bottle("po-1", (2.0, 2.0), mark_from="r1_3")], lost_looks=99)
    assert not deaf.anchor("b1", RED_MARKED, FIND)
    assert deaf.log.count("timeout") == 4
    assert deaf.log[-1] == "failed: nothing was observed in time, and 3 plans were made again"


def test_a_way_that_is_blocked_is_planned_around() -> None:
    robot = Robot([Bottle("po-1", (2.0, 2.0), mark_from="r1_2")], blocked=frozenset({("r1_1", "r1_2")}))
    assert robot.anchor("b1", RED_MARKED, FIND)
    assert robot.log[2:4] == ["(move r1_2)", "case 2 plan 7 4"]
    assert robot.place == "r1_2"


def test_an_observation_that_no_hypothesis_explains_is_found_again() -> None:
    robot = Robot([Bottle("po-1", (2.0, 2.0), mark_from="r1_4")])
    recovery = AnchoringRecovery("b1", RED_MARKED, FIND, robot.knowledge)
    assert isinstance(recovery.on_event(PerceptsSeen(robot.percepts()), 0)[0], TopPlanHalted)
    recovery.on_event(SensingActionEnded(1, True), 0)
    assert recovery.on_event(FeatureObserved(2, "blue"), 0) == [FindRequested("b1")]
    robot.move("r1_4")
    found = recovery.on_event(PerceptsSeen(robot.percepts()), 0)
    assert found == [SymbolAnchored("b1", "po-1"), TopPlanResumed("b1")]


def test_events_that_answer_nothing_under_way_are_ignored() -> None:
    robot = Robot([Bottle("po-1", (2.0, 2.0))])
    recovery = AnchoringRecovery("b1", RED_MARKED, FIND, robot.knowledge)
    recovery.on_event(PerceptsSeen(robot.percepts()), 0)
    for early in (PerceptsSeen({}), FeatureObserved(1, "t"), SensingActionEnded(7, True)):
        assert recovery.on_event(early, 0) == []
    assert recovery.on_time(0) == []
    robot.anchor("b1", RED_MARKED, FIND)
    for late in (PerceptsSeen({}), FeatureObserved(1, "t"), SensingActionEnded(1, True)):
        assert robot.recovery.on_event(late, 0) == []


def test_recovery_within_recovery_is_limited() -> None:
    robot = Robot([Bottle("po-1", (2.0, 2.0), mark_from="r1_4", visible_from=("r1_2",))])
    recovery = AnchoringRecovery("b1", RED_MARKED, FIND, robot.knowledge, RecoveryLimits(levels=1))
    recovery.on_event(PerceptsSeen({}), 0)
    recovery.on_event(SensingActionEnded(1, True), 0)
    robot.move("r1_2")
    failed = recovery.on_event(PerceptsSeen(robot.percepts()), 0)
    assert failed == [RecoveryFailed("b1", "recovery within recovery is limited to 1")]


def test_the_action_of_each_step_has_a_monitor_that_can_be_read() -> None:
    robot = Robot([Bottle("po-1", (2.0, 2.0), mark_from="r1_4")])
    robot.anchor("b1", RED_MARKED, FIND)
    assert robot.monitors[0] == "eventually[0, 60000ms] at[observer] = r1_2"
    assert all(parse_tree(each, "formula_only") for each in robot.monitors)


def test_cautiously_a_second_match_is_ruled_out() -> None:
    bottles = [Bottle("po-1", (1.0, 2.0), mark_from="r1_1"), Bottle("po-2", (2.0, 2.0))]
    robot = Robot(bottles)
    assert robot.anchor("b1", RED_MARKED, replace(FIND, is_cautious=True))
    assert robot.log[1] == "case 4 plan 7 4"
    assert robot.anchors == {"b1": "po-1"}
    bottles[1].mark_from = "r1_3"
    robot = Robot(bottles)
    assert not robot.anchor("b1", RED_MARKED, replace(FIND, is_cautious=True))
    assert robot.log[-1] == "failed: none of the candidates is as described"


def test_the_properties_of_a_temporary_anchor_are_kept() -> None:
    robot = Robot([Bottle("po-1", (1.0, 2.0))])
    robot.anchor("b1", RED_MARKED, FIND)
    assert robot.recovery.situation is not None
    (anchor,) = robot.recovery.situation.anchors
    assert isinstance(anchor.match, CandidateMatch)
    assert set(anchor.properties) == {"kind", "colour", "position_m"}
    assert MARK_FROM["mark"] == ROOM[1:]
