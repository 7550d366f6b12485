"""Goals and plans that are delegated: planned for, flown by several vehicles, watched, never against a pilot."""

import pytest

from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import (
    AnswerQuestion,
    CallForMission,
    Content,
    FlyMission,
    Goto,
    Hold,
    JoinMission,
    LeaveMission,
    MissionList,
    MissionProposal,
    MissionQuery,
    PerformCommands,
    Reason,
    Resume,
    TakeMission,
    TaskOver,
)
from dyknow.federation.messages.contents.missions import CommandEntry
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.navigation.vehicle import Arm, GoToOrder, HoldOrder, LandOrder, SetGuided, TakeOffOrder
from tests.agents.capabilities.missions.flown import DOMAIN, ONE, TWO, Flown, told


def test_two_vehicles_take_off_share_the_places_and_land() -> None:
    flown = Flown(2)
    mission = flown.begin(TWO)
    flown.until(mission)
    texts = told(mission)
    assert texts[-1] == "inform: reached: the plan is done"
    for action in ("take-off(uav0)", "take-off(uav1)", "fly-to(uav1, gate)", "land(uav0)", "land(uav1)"):
        assert texts.index(f"started: {action}") < texts.index(f"ended: {action}")
    assert flown.stands(0) and flown.stands(1)
    kinds = [type(order) for _, order in flown.vehicles[1].commands]
    assert kinds == [SetGuided, Arm, TakeOffOrder, GoToOrder, LandOrder]
    assert flown.entry().phase == "ended"
    assert [each.name for each in flown.world.platform("0").built.tasks.all()] == []


def test_a_change_of_mode_has_the_mission_wait_nothing_is_sent_until_a_user_resumes_it() -> None:
    flown = Flown(airborne=True)
    mission = flown.begin()
    flown.until(mission, "started: fly-to(uav0, pond)")
    flown.fault("takeover", seconds=15.0)
    flown.until(mission, "waits: waiting for the pilot")
    sent = len(flown.vehicles[0].commands)
    ((performative, _),) = flown.ask(Resume())
    assert performative == "refuse", "the mode is still the pilot's"
    flown.world.run_for(20.0)
    assert len(flown.vehicles[0].commands) == sent, "not even after the pilot has let go of it"
    assert flown.entry().phase == "waiting for the pilot"
    assert [performative for performative, _ in flown.ask(Resume())] == ["agree", "inform"]
    flown.until(mission)
    assert told(mission)[-1] == "inform: reached: the plan is done"
    assert flown.stands()


def test_a_users_goto_and_hold_have_a_mission_wait_until_it_is_resumed() -> None:
    flown = Flown(airborne=True)
    mission = flown.begin()
    flown.until(mission, "started: fly-to(uav0, barn)")
    assert flown.ask(Goto(latitude_deg=55.7241, longitude_deg=13.46, altitude_m=60.0))[0][0] == "agree"
    flown.until(mission, "waits: waiting for the pilot: uav0 is flown by hand: a user ordered goto")
    assert isinstance(flown.vehicles[0].commands[-1][1], GoToOrder)
    assert flown.ask(Hold())[0][0] == "agree"
    assert isinstance(flown.vehicles[0].commands[-1][1], HoldOrder)
    flown.ask(Resume())
    flown.until(mission)
    assert told(mission)[-1] == "inform: reached: the plan is done"


def test_a_vehicle_whose_platform_is_gone_leaves_its_places_to_the_other() -> None:
    flown = Flown(2, airborne=True)
    mission = flown.begin(TWO.replace("#goal home: forall uav: !flies(uav)", "#goal home: !flies(uav0)"))
    flown.until(mission, "started: fly-to(uav1, gate)")
    flown.world.kill("1")
    flown.until(mission, "started: fly-to(uav0, gate)")
    assert any(text.startswith("unit lost: uav1") for text in told(mission))
    flown.until(mission)
    assert told(mission)[-1] == "inform: reached: the plan is done"


def test_cancelled_or_aborted_its_vehicles_hold_and_are_free() -> None:
    flown = Flown(2, airborne=True)
    mission = flown.begin(TWO)
    flown.until(mission, "started: fly-to(uav1, gate)")
    flown.world.run_for(3.0)
    assert [flown.ask(TaskOver(task="m1"), unit)[0][0] for unit in "01"] == ["agree", "agree"]
    assert told(mission)[-1].startswith("failure: aborted: a command centre ended it")
    for vehicle in flown.vehicles:
        assert [isinstance(order, HoldOrder) for _, order in vehicle.commands].count(True) == 1, "once"
        assert isinstance(vehicle.commands[-1][1], HoldOrder)
    assert [flown.world.platform(unit).built[Pilot.of].mission.name for unit in "01"] == ["", ""]
    again = flown.begin(ONE, mission="m2")
    flown.until(again, "started: fly-to(uav0, barn)")
    flown.world.cancel("cc", "0", again.conversation)
    flown.world.run_for(1.0)
    assert flown.world.platform("0").built[Pilot.of].mission.name == ""


def test_one_that_is_ended_before_its_vehicles_have_joined_is_listed_as_ended() -> None:
    flown = Flown(2, airborne=True)
    flown.world.kill("1")
    mission = flown.begin(TWO)
    assert flown.entry().phase == "joining"
    flown.ask(TaskOver(task="m1"))
    assert told(mission)[-1].startswith("failure: aborted: a command centre ended it")
    assert (flown.entry().phase, flown.entry().why) == ("ended", "a command centre ended it")


def test_a_place_out_of_range_fails_with_the_rule_is_asked_about_and_given_up_as_answered() -> None:
    flown = Flown(airborne=True)
    mission = flown.begin(ONE.replace("x-of(pond) := 40", "x-of(pond) := 4000"), domain_of(times=1))
    flown.until(mission, "asks:")
    assert any("beyond the range of 1000 m" in text for text in told(mission))
    asked = flown.entry().question
    assert asked is not None
    ((performative, said),) = flown.ask(AnswerQuestion(mission="m1", number=asked.number, answer="perhaps"))
    assert (performative, said.code) == ("refuse", "no-answer")
    assert flown.ask(AnswerQuestion(mission="m1", number=asked.number, answer="give up"))[0][0] == "agree"
    assert told(mission)[-1].startswith("failure: gave up")


def domain_of(times: int) -> str:
    """The domain in which a flight that fails is tried that often."""
    recovery = f"#recovery again(uav, place, x, y)\n  :times {times} ask\n"
    return (
        DOMAIN.replace("  :commands goto(x, y, HEIGHT)", "  :recovery again\n  :commands goto(x, y, HEIGHT)") + recovery
    )


def test_an_autopilot_that_refuses_to_take_off_is_a_failure_in_its_words() -> None:
    flown = Flown()
    flown.fault("refuse=4")
    mission = flown.begin()
    flown.until(mission, "autopilot: failed", within_s=60)
    assert any("autopilot: failed" in text for text in told(mission))


# -- degrees ---------------------------------------------------------------------------------------------------------


NEARER = DOMAIN[DOMAIN.index('  :control "no other') : DOMAIN.index("  :commands goto")]
FREE = DOMAIN.replace(NEARER, "")
"""The domain without the recommendation to fly to the nearest place."""


def started(mission: object) -> list[str]:
    return [text.removeprefix("started: ") for text in told(mission) if text.startswith("started: ")]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ({}, ["fly-to(uav0, barn)", "fly-to(uav0, pond)", "land(uav0)"]),
        (
            {"domain": FREE, "constraints": "#control pond-first: always (seen(barn) -> seen(pond))"},
            ["fly-to(uav0, pond)", "fly-to(uav0, barn)", "land(uav0)"],
        ),
        ({"actions": ("fly-to(uav0, pond)",)}, None),
        (
            {"actions": ("fly-to(uav0, barn)", "fly-to(uav0, pond)", "land(uav0)"), "is_whole": True},
            ["fly-to(uav0, barn)", "fly-to(uav0, pond)", "land(uav0)"],
        ),
    ],
)
def test_the_four_degrees_of_what_is_delegated(given: dict[str, object], wanted: list[str] | None) -> None:
    flown = Flown(airborne=True)
    mission = flown.begin(**given)  # type: ignore[arg-type]
    flown.until(mission)
    assert told(mission)[-1] == "inform: reached: the plan is done", told(mission)
    assert wanted is None or started(mission) == wanted


def test_a_whole_plan_that_does_not_reach_the_goal_is_not_flown() -> None:
    flown = Flown(airborne=True)
    mission = flown.begin(actions=("fly-to(uav0, barn)", "land(uav0)"), is_whole=True)
    flown.until(mission, "no plan")
    assert started(mission) == []
    assert flown.vehicles[0].commands == []


# -- hostile ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "performative", "because"),
    [
        ({"problem": "#objects uav = {uav0} #goal nonsense(uav0)"}, "refuse", "nonsense"),
        ({"actions": ("fly-too(uav0, barn)",)}, "refuse", "Did you mean 'fly-to'?"),
        ({"actions": ("fly-to(barn, uav0)",)}, "refuse", "write fly-to(uav, place)"),
        ({"platforms": {"uav9": "0"}}, "refuse", "uav9 is no unit"),
        ({"problem": f"{ONE}#objects place = p1 .. p9999"}, "refuse", "objects: expected at most 2000, got 10002"),
        ({"chain": ("1", "0")}, "refuse", "the chain of delegation ends with 0, and cc sends it"),
        ({"chain": ("0", "cc")}, "refuse", "it was delegated by 0 already: 0 > cc"),
    ],
)
def test_what_cannot_be_flown_is_refused_with_the_reason(
    given: dict[str, object], performative: str, because: str
) -> None:
    flown = Flown(airborne=True)
    mission = flown.begin(**given)  # type: ignore[arg-type]
    ((found, text),) = [(str(act.performative), said.text) for act, said in mission.said]
    assert found == performative
    assert because in text
    assert flown.vehicles[0].commands == []


def test_a_vehicle_takes_no_commands_of_a_mission_that_it_has_not_joined_nor_a_second_mission() -> None:
    flown = Flown(airborne=True)
    land = PerformCommands(mission="m1", step=1, action="x", commands=(CommandEntry(name="land"),))
    assert flown.ask(land)[0][0] == "refuse"
    assert [performative for performative, _ in flown.ask(JoinMission(mission="m1"))] == ["agree", "inform"]
    unknown = PerformCommands(mission="m1", step=1, action="x", commands=(CommandEntry(name="explode"),))
    ((performative, said),) = flown.ask(unknown)
    assert (performative, said.code) == ("refuse", "unknown-command")
    ((performative, said),) = flown.ask(JoinMission(mission="m2"))
    assert (performative, said.text) == ("refuse", "the vehicle takes part in mission m1")
    assert flown.vehicles[0].commands == []
    ((_, said),) = flown.ask(MissionQuery())
    assert said == MissionList(missions=())


# -- proposals -------------------------------------------------------------------------------------------------------


def called(flown: Flown, to: str = "0", problem: str = ONE) -> Dialogue:
    content = CallForMission(mission="m1", domain=DOMAIN, problem=problem)
    dialogue = flown.world.ask("cc", to, content, Performative.CFP)
    flown.world.run_for(1.0)
    return dialogue


def decide(flown: Flown, dialogue: Dialogue, performative: Performative, content: Content) -> None:
    flown.world.speak(
        "cc",
        lambda member, now_us: member.acts.decide(dialogue.unit, dialogue.conversation, performative, content, now_us),
    )
    flown.world.run_for(1.0)


def test_a_call_is_answered_with_the_completed_plan_and_flown_only_when_that_is_consented_to() -> None:
    flown = Flown(airborne=True)
    dialogue = called(flown)
    ((performative, proposal),) = [(act.performative, said) for act, said in dialogue.said]
    assert performative is Performative.PROPOSE
    assert isinstance(proposal, MissionProposal)
    assert [action.partition("  ")[2] for action in proposal.actions] == [
        "fly-to(uav0, barn)",
        "fly-to(uav0, pond)",
        "land(uav0)",
    ]
    assert proposal.duration_s > 30.0
    flown.world.run_for(5.0)
    assert flown.vehicles[0].commands == []
    decide(flown, dialogue, Performative.ACCEPT_PROPOSAL, TakeMission())
    flown.until(dialogue)
    assert told(dialogue)[-1] == "inform: reached: the plan is done"
    assert started(dialogue) == ["fly-to(uav0, barn)", "fly-to(uav0, pond)", "land(uav0)"]


def test_a_proposal_that_is_left_is_not_flown_and_a_goal_that_cannot_be_is_refused() -> None:
    flown = Flown(airborne=True)
    dialogue = called(flown)
    decide(flown, dialogue, Performative.REJECT_PROPOSAL, LeaveMission(because="too dear"))
    flown.world.run_for(5.0)
    assert flown.vehicles[0].commands == []
    refused = called(flown, problem=ONE + "#goal both: flies(uav0) & !flies(uav0)")
    ((performative, said),) = [(act.performative, said) for act, said in refused.said]
    assert performative is Performative.REFUSE
    assert said.code == "no-plan"


def test_what_is_cancelled_while_its_texts_are_read_is_not_begun_and_as_many_as_it_leads_are_read_at_once() -> None:
    flown = Flown(1)
    asked = [
        flown.world.ask("cc", "0", FlyMission(mission=f"m{number}", domain=DOMAIN, problem=ONE)) for number in range(5)
    ]
    flown.world.run_for(0.03)
    flown.world.cancel("cc", "0", asked[0].conversation)
    flown.world.run_for(1.0)
    refused = [said for each in asked for _, said in each.said if isinstance(said, Reason)]
    assert [(each.code, each.text) for each in refused] == [
        ("busy", "this platform has mission m4 already, or 4 missions")
    ]
    assert {each.mission for each in flown.missions()} == {"m1", "m2", "m3"}
