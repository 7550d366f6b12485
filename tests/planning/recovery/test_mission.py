"""A mission driven by hand: what it sends after which event, and what it makes of events that come at the wrong time."""

from math import nan
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.model.values import NO_VALUE
from dyknow.planning.execution import events
from dyknow.planning.execution.beliefs import Beliefs
from tests.planning.recovery.driven import COURIERS, GOALS, OBJECTS, SECOND, Driven

ALONE = "#objects courier = {k1} #objects letter = {l1} #init place(l1) := 1\n#goal one: done(l1)"


def started(drive: Driven) -> list[str]:
    return [one.action.shown for one in drive.begin()]


def held(drive: Driven) -> dict[str, str]:
    return {one.unit: one.how for one in drive.taken if isinstance(one, events.HoldUnit)}


def notes(drive: Driven, kind: str) -> list[str]:
    return [one.text for one in drive.taken if isinstance(one, events.MissionNote) and one.kind == kind]


def test_several_units_act_at_once_and_what_depends_on_an_action_waits_until_its_effect_was_seen() -> None:
    drive = Driven()
    assert started(drive) == ["fetch(k1, l1)", "fetch(k2, l2)"]
    drive.end(1)
    assert drive.take(events.StartAction) == [], "no state has shown the effect"
    assert started(drive) == ["bring(k1, l1)"]
    drive.end(3)
    drive.end(2)
    assert started(drive) == ["bring(k2, l2)"]
    drive.end(4)
    drive.state()
    (ended,) = drive.take(events.MissionEnded)
    assert (ended.outcome, ended.unreached) == ("reached", ())


SEEN = COURIERS.replace(
    "[end] done(letter), [end] !has(courier, letter)\n",
    """[end] done(letter), [end] !has(courier, letter), [end] place(letter) := 9
  :monitor EXEC until (!EXEC & place(letter) >= 8) :recovery elsewhere
  :locate place(letter)
#recovery elsewhere(letter) :assume !done(letter)
""",
)


@pytest.mark.parametrize(
    ("seen", "phase"), [({}, "ended"), ({"place[l1]": 8.4}, "ended"), ({"place[l1]": 3.5}, "executing")]
)
def test_where_a_thing_was_seen_counts_and_not_what_the_effects_say(seen: dict[str, float], phase: str) -> None:
    drive = Driven(ALONE, SEEN)
    (fetch,) = drive.begin()
    drive.end(fetch.step)
    (bring,) = drive.begin()
    assert (fetch.located, bring.located) == ((), ("place[l1]",)) and bring.values["place[l1]"] == 1
    drive.send(events.ActionEnded(bring.step, succeeded=True, seen=seen))
    drive.state(**{"has[k1, l1]": False})
    assert drive.mission.status.phase == phase
    if phase == "executing":
        assert [one for one in notes(drive, "fault") if "elsewhere" in one]


def test_flags_are_set_while_an_action_is_executed() -> None:
    drive = Driven(ALONE)
    assert drive.mission.flags.now() == ("executing-fetch[k1, l1]",)
    (start,) = drive.begin()
    begun_us = drive.now_us
    drive.end(start.step)
    assert drive.mission.flags.now() == ()
    flags = drive.mission.flags
    assert flags.value("executing-fetch[k1]", begun_us) and flags.value("executing-fetch[k1, l1, 1]", begun_us)
    assert not flags.value("executing-fetch[k1, l1]", drive.now_us)
    assert not flags.value("executing-fetch[k2]", begun_us)


def test_a_command_is_not_given_if_its_precondition_does_not_hold() -> None:
    drive = Driven(ALONE)
    drive.state(**{"strength[k1]": 0.5})
    assert [one for one in drive.taken if isinstance(one, events.StartAction | events.AbortAction)] == []
    assert any("precondition of fetch(k1, l1) is violated" in one for one in notes(drive, "fault"))


def test_nothing_begins_without_states_and_the_mission_says_what_it_lacks() -> None:
    drive = Driven(ALONE, patience_us=2 * SECOND)
    drive.wait(3 * SECOND)
    assert any("no value of has[k1, l1], strength[k1] for 2 s" in one for one in notes(drive, "fault"))
    assert not any(isinstance(one, events.StartAction) for one in drive.taken)


def test_a_sensor_that_falls_silent_is_reported_once() -> None:
    drive = Driven(ALONE, patience_us=SECOND)
    drive.state(**{"has[k1, l1]": False})
    drive.state()
    drive.values.clear()
    for _ in range(20):
        drive.state(200_000)
    told = [one for one in notes(drive, "blind") if "effect" in one]
    assert len(told) == 1 and "no value of has[k1, l1]" in told[0]


def test_what_fails_ends_the_plan_its_units_hold_and_assumptions_are_in_the_new_problem() -> None:
    drive = Driven()
    drive.begin()
    drive.end(1, succeeded=False, reason="the letter slipped")
    assert held(drive) == {"k1": "brake", "k2": "brake"}
    assert [one.unit for one in drive.taken if isinstance(one, events.AbortAction)] == ["k2"]
    assert drive.initial()["strength[k1]"] == 2 and drive.initial()["at-work[k1]"] is False
    assert notes(drive, "assumed") == ["strength[k1] := 2", "at-work[k1] := False, at-work[k2] := False"]
    assert drive.begin()[0].step == 5, "numbers go on"


def test_a_deadline_comes_nearer_with_every_plan() -> None:
    drive = Driven()
    drive.begin()
    passed_us = drive.now_us + 60 * SECOND - 100 * SECOND
    drive.send(events.MissionSuspended("lunch"))
    drive.send(events.MissionResumed(), 60 * SECOND)
    assert [one.deadline_ms for one in drive.searches[-1].problem.goals] == [300_000 - passed_us // 1000, None]


def test_the_same_fault_again_and_again_drops_the_lightest_goal_and_ends_when_none_is_left() -> None:
    drive = Driven(OBJECTS + "#goal one: done(l1) :weight 5\n#goal two: done(l2) :weight 1", patience_us=10**9)
    for _ in range(3):
        drive.state(**{"strength[k1]": 3, "strength[k2]": 3})
        (step,) = [one.step for one in drive.taken if isinstance(one, events.StartAction) and one.unit == "k1"]
        drive.take()
        drive.end(step, succeeded=False)
    assert notes(drive, "dropped")[0].startswith("the goal two is dropped")
    assert [one.name for one in drive.searches[-1].problem.goals] == ["one"]
    assert drive.mission.status.dropped == ("two",)


def test_what_was_lost_is_located_before_there_is_a_new_plan() -> None:
    drive = Driven(ALONE)
    drive.begin()
    drive.end(1)
    drive.begin()
    drive.state(**{"has[k1, l1]": False})
    (locate,) = drive.take(events.Locate)
    assert (locate.objects, locate.labels) == (("l1",), ("place[l1]",))
    assert drive.phase == "locating" and "place[l1]" in drive.mission.labels
    drive.state(**{"place[l1]": NO_VALUE})
    drive.state(**{"place[l1]": nan})
    assert len(drive.searches) == 1
    drive.state(**{"place[l1]": 7.5})
    assert drive.initial()["place[l1]"] == 7.5
    assert drive.phase == "executing"


def test_what_is_not_found_becomes_a_question_that_can_be_answered_with_another_look() -> None:
    drive = Driven(ALONE, locate_us=30 * SECOND, question_us=20 * SECOND)
    drive.begin()
    drive.end(1)
    drive.begin()
    drive.state(**{"has[k1, l1]": False})
    drive.wait(31 * SECOND)
    (asked,) = drive.take(events.AskHuman)
    assert "place[l1]" in asked.text and asked.options == ("try again", "give up")
    drive.send(events.QuestionAnswered(asked.question, "perhaps"))
    assert "'perhaps' is no answer" in notes(drive, "answer")[0]
    drive.send(events.QuestionAnswered(asked.question + 7, "give up"))
    assert drive.mission.ended is None
    drive.send(events.QuestionAnswered(asked.question, "try again", "ann"))
    assert len(drive.take(events.Locate)) == 1 and drive.phase == "locating"
    drive.wait(31 * SECOND)
    drive.wait(21 * SECOND)
    assert drive.mission.ended is not None and drive.mission.ended.outcome == "gave up"
    assert drive.mission.ended.unreached == ("one",)


def test_a_search_in_vain_becomes_a_question_at_once_that_says_why() -> None:
    drive = Driven(ALONE)
    drive.send(events.NotLocated("nothing is looked for"))
    assert not drive.take(events.AskHuman)
    drive.begin()
    drive.end(1)
    drive.begin()
    drive.state(**{"has[k1, l1]": False})
    drive.send(events.NotLocated("l1 was not found from 9 places"))
    (asked,) = drive.take(events.AskHuman)
    assert asked.text == "l1 was not found from 9 places" and drive.phase == "asking"


def test_what_is_lost_when_a_pilot_takes_over_is_looked_for_again_afterwards() -> None:
    drive = Driven(ALONE)
    drive.begin()
    drive.end(1)
    drive.begin()
    drive.state(**{"has[k1, l1]": False})
    (before,) = drive.take(events.Locate)
    drive.send(events.PilotTookOver("k1"))
    assert drive.phase == "waiting for the pilot"
    drive.send(events.PilotGaveBack("k1"))
    (after,) = drive.take(events.Locate)
    assert after.labels == before.labels and len(drive.searches) == 1
    drive.state(**{"place[l1]": 7.5})
    assert drive.initial()["place[l1]"] == 7.5


def test_a_place_that_was_seen_once_holds_while_states_no_longer_show_it() -> None:
    beliefs = Beliefs({"x[b]": 0.0}, 0, SECOND, lambda _label: 0.0)
    beliefs.on_state(5 * SECOND, {"x[b]": 7.5})
    assert beliefs.shown("x[b]", 60 * SECOND) is NO_VALUE
    beliefs.settle(["x[b]", "y[b]"])
    assert beliefs.shown("x[b]", 60 * SECOND) == 7.5
    beliefs.change(70 * SECOND, [("x[b]", 9.0)])
    assert beliefs.values() == {"x[b]": 9.0}


def test_without_a_plan_the_mission_asks_and_the_default_is_taken_in_time() -> None:
    drive = Driven(ALONE.replace("done(l1)", "done(l1) :deadline 1s"), question_us=10 * SECOND)
    (asked,) = [one for one in drive.taken if isinstance(one, events.AskHuman)]
    assert asked.text.startswith("no plan") and asked.default == "give up"
    drive.wait(9 * SECOND)
    assert drive.phase == "asking"
    drive.wait(2 * SECOND)
    assert drive.mission.ended is not None


def test_a_search_that_does_not_answer_is_cancelled_and_a_late_answer_is_ignored() -> None:
    drive = Driven()
    drive.answers = False
    drive.send(events.MissionSuspended())
    drive.send(events.MissionResumed())
    search = drive.searches[-1].search
    drive.take()
    drive.wait(16 * SECOND)
    assert events.CancelSearch(search) in drive.taken
    assert drive.phase == "asking"
    drive.answer_search()
    assert drive.phase == "asking"


def test_a_pilot_who_takes_over_is_sent_nothing_and_the_mission_waits_and_says_so() -> None:
    drive = Driven()
    drive.begin()
    drive.send(events.PilotTookOver("k1", "mode LOITER"))
    assert [one.unit for one in drive.taken if isinstance(one, events.AbortAction | events.HoldUnit)] == ["k2", "k2"]
    assert notes(drive, "waits") == ["waiting for the pilot: k1 is flown by hand: mode LOITER"]
    assert drive.phase == "waiting for the pilot"
    searches = len(drive.searches)
    drive.state()
    drive.wait(600 * SECOND)
    drive.end(1, succeeded=False)
    drive.send(events.MissionResumed())
    assert len(drive.searches) == searches and drive.phase == "waiting for the pilot"
    drive.send(events.PilotGaveBack("k1"))
    assert len(drive.searches) == searches + 1


def test_a_pause_is_not_ended_by_a_pilot_and_a_resumed_mission_still_waits_for_one() -> None:
    drive = Driven()
    drive.begin()
    drive.send(events.MissionSuspended("weather"))
    drive.send(events.PilotTookOver("k2"))
    drive.send(events.MissionResumed())
    assert drive.phase == "waiting for the pilot"
    drive.send(events.PilotGaveBack("k2"))
    assert drive.phase == "executing"


def test_a_unit_that_is_back_ends_the_question_that_its_loss_has_led_to() -> None:
    drive = Driven(ALONE)
    drive.begin()
    drive.send(events.UnitLost("k1", "no heartbeat"))
    assert drive.phase == "asking"
    drive.send(events.UnitBack("k1"))
    assert drive.phase == "executing"
    drive.begin()
    assert drive.mission.status.question is None
    searches = len(drive.searches)
    drive.send(events.UnitBack("k1"))
    assert len(drive.searches) == searches, "it was not away"


def test_a_unit_that_is_back_changes_no_plan_that_reaches_all_goals() -> None:
    drive = Driven()
    drive.begin()
    drive.send(events.UnitLost("k1", "no heartbeat"))
    searches = len(drive.searches)
    drive.send(events.UnitBack("k1"))
    assert drive.phase == "executing" and len(drive.searches) == searches


def test_plans_do_without_a_unit_that_is_lost_until_it_is_back() -> None:
    drive = Driven()
    drive.begin()
    drive.send(events.UnitLost("k1", "no heartbeat"))
    assert drive.searches[-1].units == ("k2",)
    assert "k1" not in held(drive)
    assert {one.unit for one in drive.begin()} == {"k2"}
    drive.send(events.UnitBack("k1"))
    drive.send(events.MissionSuspended())
    drive.send(events.MissionResumed())
    assert drive.searches[-1].units is None


def test_a_recovery_may_leave_a_unit_out_but_not_the_last_one() -> None:
    drive = Driven()
    drive.begin()
    drive.state(**{"strength[k1]": -1})
    assert held(drive) == {"k1": "land", "k2": "land"}
    assert drive.searches[-1].units == ("k2",) and drive.mission.status.left_out == ("k1",)
    drive.begin()
    drive.state(**{"strength[k1]": 3, "strength[k2]": -1})
    assert notes(drive, "left out")[-1] == "k2 stays: no other unit can act"


def test_an_aborted_mission_ends_and_takes_nothing_more() -> None:
    drive = Driven()
    drive.begin()
    drive.send(events.MissionAborted("storm"))
    ended = drive.take()[-1]
    assert ended == events.MissionEnded("aborted", "storm", ("one", "two"))
    drive.state(**{"strength[k1]": -1})
    drive.send(events.PilotTookOver("k1"))
    drive.wait(10**9)
    assert drive.take() == []


def test_a_plan_that_ends_without_its_goals_is_a_fault() -> None:
    drive = Driven(ALONE)
    for _ in range(2):
        (one,) = drive.begin()
        drive.end(one.step)
    drive.state(**{"done[l1]": False})
    assert any("the plan is done, and one does not hold" in one for one in notes(drive, "fault"))
    assert len(drive.searches) == 2


def test_what_comes_about_by_itself_is_in_the_state_of_a_later_plan() -> None:
    drive = Driven(OBJECTS + "#init [30s] !open, [600s] open\n" + GOALS)
    drive.begin()
    drive.send(events.MissionSuspended())
    drive.send(events.MissionResumed(), 60 * SECOND)
    assert drive.initial()["open"] is True, "the later one, which is still to come"
    at = {one.at_ms: one.value.value for one in drive.searches[-1].problem.init if one.target.name == "open"}  # type: ignore[attr-defined]
    passed_ms = (drive.now_us - 100 * SECOND) // 1000
    assert at == {0: False, 600_000 - passed_ms: True}


def test_the_status_is_one_json_object() -> None:
    drive = Driven()
    drive.begin()
    status = drive.mission.status.as_json()
    assert (status["phase"], status["goals"], status["flags"][0]) == (
        "executing",
        ["one", "two"],
        "executing-fetch[k1, l1]",
    )
    assert status["steps"][0] | {"since_us": 0} == {
        "step": 1,
        "unit": "k1",
        "action": "fetch(k1, l1)",
        "phase": "running",
        "since_us": 0,
    }


UNITS = st.sampled_from(["k1", "k2", "k3", ""])
VALUES: Any = st.one_of(st.booleans(), st.floats(), st.integers(-5, 5), st.just("text"), st.just(NO_VALUE))
LABELS = st.sampled_from(["has[k1, l1]", "has[k2, l2]", "strength[k1]", "done[l1]", "place[l1]", "at-work[k1]", "x]["])
EVENTS = st.one_of(
    st.builds(events.StateSampled, st.integers(99 * SECOND, 400 * SECOND), st.dictionaries(LABELS, VALUES, max_size=4)),
    st.builds(
        events.ActionEnded,
        *(st.integers(-1, 12), st.booleans(), st.just("why")),
        seen=st.dictionaries(LABELS, VALUES, max_size=2),
    ),
    st.builds(events.PilotTookOver, UNITS),
    st.builds(events.PilotGaveBack, UNITS),
    st.builds(events.UnitLost, UNITS),
    st.builds(events.UnitBack, UNITS),
    st.just(events.MissionSuspended()),
    st.just(events.MissionResumed()),
    st.builds(events.PlanSearched, st.integers(-1, 6), st.none(), st.just("none"), st.booleans()),
    st.builds(
        events.QuestionAnswered,
        st.integers(0, 4),
        st.sampled_from(["try again", "give up", "drop one", "drop two", "x"]),
    ),
    st.sampled_from(["state", "end", "wait"]),
)


@settings(max_examples=25)
@given(st.lists(EVENTS, max_size=25))
def test_whatever_comes_no_command_goes_to_a_pilots_unit_and_each_step_starts_once(given_events: list[Any]) -> None:
    drive = Driven(patience_us=2 * SECOND, locate_us=3 * SECOND, question_us=3 * SECOND)
    steps: set[int] = set()
    pilots: set[str] = set()
    for event in given_events:
        running = [one for one in drive.mission.status.steps if one[3] == "running"]
        if event == "state":
            drive.state()
        elif event == "wait":
            drive.wait(4 * SECOND)
        elif event == "end":
            drive.end(running[0][0] if running else 1)
        else:
            pilots |= {event.unit} if isinstance(event, events.PilotTookOver) else set()
            drive.send(event, 100_000)
        for effect in drive.take():
            if isinstance(effect, events.StartAction):
                assert effect.step not in steps
                steps.add(effect.step)
            if isinstance(effect, events.StartAction | events.AbortAction | events.HoldUnit):
                assert effect.unit not in pilots
        pilots -= {event.unit} if isinstance(event, events.PilotGaveBack) else set()
        assert drive.mission.ended is not None or drive.mission.status.phase != "ended"


@pytest.mark.parametrize("hostile", ["text", NO_VALUE, nan, True])
def test_values_of_another_kind_are_no_values(hostile: Any) -> None:
    """A number that is a text decides nothing; the mission lives on."""
    drive = Driven(ALONE)
    for _ in range(5):
        drive.state(**{"strength[k1]": hostile})
    assert drive.mission.ended is None
