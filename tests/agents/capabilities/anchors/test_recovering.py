"""A wanted object that may be one of several: the vehicle looks again from elsewhere until it is decided, and says what it does."""

from math import hypot

import pytest

from dyknow.agents.capabilities.anchors.looking_again import MOST_RECOVERIES
from dyknow.agents.capabilities.anchors.recovering import RecoveringAnchors
from dyknow.agents.capabilities.attention.following import Following
from dyknow.federation.messages.contents import AnswerQuestion, ControlMission, FlyMission, Follow, WantObject
from dyknow.navigation.vehicle import HoldOrder
from dyknow.sim_uavs.dynamics.faults import parse_fault
from tests.agents.capabilities.anchors.field import MARKED, Field, Standing
from tests.agents.capabilities.attention.chase import said
from tests.agents.capabilities.missions.flown import DOMAIN, ONE
from tests.agents.rosters import trust

TWO = {"a": Standing(20.0, 10.0), "b": Standing(-15.0, 12.0, mark_deg=270.0)}
"""Two red cars; the mark of the western one is seen from its west."""


def started(things: dict[str, Standing], seen_m: float = 70.0, **config: object) -> Field:
    field = Field(things, seen_m, **config)
    field.pass_time(3.0)
    return field


def kinds(told: list[str]) -> list[str]:
    return [each.partition(":")[0] for each in told]


def test_two_red_cars_are_looked_at_from_elsewhere_until_the_mark_of_one_is_seen() -> None:
    field = started(TWO)
    asked = field.want()
    told = field.until(asked, "suspect is found")
    assert kinds(told)[:4] == ["", "halted", "plan", "flies"]
    assert told[1] == "halted: case 2: co1: colour red is as described"
    assert told[2].startswith(
        "plan: case 2, 9 hypotheses: ((move v1) (look-at co1) (cond ((mark! co1 = f) (look-at co2) "
    )
    assert "observed: look-at co1 from v1 shows f" in told
    assert told[-3:-1] == [
        "observed: look-at co2 from v2 shows t",
        "anchored: suspect is co2: it was looked at again",
    ]
    east_m, _ = field.at_m
    assert east_m < -15.0 - 20.0, "the vehicle is west of the car whose mark is seen from there"
    assert len(field.looks) > 4
    assert field.tasks() == ["anchored: suspect is co2: it was looked at again"]
    entry = field.entry()
    assert (entry.mission, entry.phase) == ("anchor-suspect", "anchored")
    assert "flies: (move v2)" in entry.actions
    assert [kind for kind in field.explained() if kind in {"halted", "plan", "observed", "anchored"}] == [
        "halted", "plan", *["observed"] * 4, "anchored"
    ]  # fmt: skip
    assert field.platform.part(RecoveringAnchors).performing.mission == "", "the vehicle is free again"


def test_one_that_is_as_described_is_anchored_at_once_unless_it_is_cautious() -> None:
    field = started({**TWO, "b": TWO["b"]._replace(mark_deg=90.0)})
    assert "anchored: suspect is co2: case 4" in field.until(field.want(), "anchored")
    assert field.orders == []


def test_in_case_5_the_requester_is_asked_for_what_discriminates_and_the_answer_decides() -> None:
    field = started({"a": Standing(5.0, 5.0, mark_deg=225.0), "b": Standing(25.0, 28.0)})
    asked = field.want('colour[suspect] = "red"')
    assert "asks: which x_m does it have: 25 (co2), 5 (co1)?" in field.until(asked, "asks")
    question = field.entry().question
    assert question is not None
    wrong = AnswerQuestion(mission="anchor-suspect", number=question.number, answer="26")
    assert said(field.ask(wrong))[-1] == ("refuse", "expected one of 25, 5, got '26'")
    late = wrong.model_copy(update={"number": question.number + 1, "answer": "25"})
    assert said(field.ask(late))[-1][0] == "refuse"
    field.ask(wrong.model_copy(update={"answer": "25"}))
    assert "anchored: suspect is co2: the delegator answered" in field.until(asked, "anchored")
    assert field.orders == []


@pytest.mark.parametrize(
    ("description", "reason"),
    [
        ('eventually[0, 5s] colour[suspect] = "red"', "expected properties compared with values"),
        ("speed[suspect] > 5 and speed[suspect] < 2", "nothing could match"),
        ('colour[suspect] < "red"', "description: <: expected a number, got 'red'"),
    ],
)
def test_a_description_that_is_none_of_properties_is_refused(description: str, reason: str) -> None:
    ((performative, text),) = said(started({}).want(description))
    assert performative == "refuse"
    assert reason in text


def test_with_a_roster_only_a_command_centre_has_the_vehicle_look_again() -> None:
    field = started(TWO, trust=trust)
    field.world.add_command_centre("1", trust=trust("1"))
    field.pass_time(1.0)
    content = WantObject(symbol="suspect", type="cars", description=MARKED, recover="yes")
    other = field.world.ask("1", "0", content)
    field.pass_time(1.0)
    assert said(other) == [("refuse", "recover flies the vehicle, which only a command centre may ask for")]
    assert said(field.want())[0] == ("agree", "")


def test_without_control_it_is_refused() -> None:
    ((performative, text),) = said(started({}, control=False).want())
    assert (performative, "not given control" in text) == ("refuse", True)


@pytest.mark.full
def test_the_mission_that_has_the_vehicle_is_halted_and_continues_at_the_action_that_was_interrupted() -> None:
    field = started(TWO, seen_m=150.0)
    mission = field.world.ask("cc", "0", FlyMission(mission="m1", domain=DOMAIN, problem=ONE))
    field.until(mission, "started: fly-to(uav0, pond)")
    field.until(field.want(), "it was looked at again")
    told = field.until(mission, "reached")
    halted = told.index("waits: suspended: anchor suspect is recovered")
    assert told[halted + 1 : halted + 4] == [
        "anchor: anchored: suspect is co2: it was looked at again",
        "assumed: claimed[pond] := False",
        "continues: at fly-to(uav0, pond)",
    ]
    assert not any(each.startswith(("searched", "fault")) for each in told[halted:])


@pytest.mark.full
def test_an_action_that_cannot_begin_any_longer_has_the_mission_replan() -> None:
    field = started(TWO, seen_m=150.0)
    domain = DOMAIN.replace(
        "  :assume forall place: claimed(place) := false", "  :assume forall place: seen(place) := seen(place)"
    )
    mission = field.world.ask("cc", "0", FlyMission(mission="m1", domain=domain, problem=ONE))
    field.until(mission, "started: fly-to(uav0, pond)")
    field.until(field.want(), "it was looked at again")
    assert "replans: the preconditions of fly-to(uav0, pond) do not hold any longer" in field.until(mission, "replans")


@pytest.mark.full
def test_a_user_who_continues_the_mission_ends_the_recovery() -> None:
    field = started(TWO, seen_m=150.0)
    mission = field.world.ask("cc", "0", FlyMission(mission="m1", domain=DOMAIN, problem=ONE))
    field.until(mission, "started: fly-to(uav0, pond)")
    asked = field.want()
    field.until(asked, "looks: ")
    field.ask(ControlMission(mission="m1", how="resume"))
    assert any("mission m1 was continued, or is over" in each for each in field.until(asked, "fails: "))
    field.until(mission, "reached")


@pytest.mark.full
def test_what_no_camera_sees_is_searched_for_over_the_area_and_is_not_present() -> None:
    field = started({"a": Standing(5.0, 5.0, "blue")}, seen_m=25.0)
    told = field.until(field.want(within_m=40.0), "not present", 300)
    assert told[1] == "halted: case 1: no percept matches: the object may be elsewhere"
    assert sum(each.startswith("observed: from p") for each in told) == 9
    assert told[-1] == "not present: suspect is not present: 10 places were looked at"
    sent = len(field.orders)
    field.pass_time(20.0)
    assert len(field.orders) == sent, "what was concluded is not searched for again"
    field.things["c"] = Standing(*(each - 8.0 for each in field.at_m), mark_deg=45.0)
    field.pass_time(8.0)
    assert any("anchored" in each for each in field.tasks()), "it came into view by itself"


@pytest.mark.full
def test_a_candidate_that_a_search_sees_is_recovered_from_one_level_deeper() -> None:
    field = started({"a": Standing(5.0, 5.0, "blue"), "b": Standing(25.0, 28.0, mark_deg=0.0)}, seen_m=25.0)
    told = field.until(field.want(within_m=40.0), "anchored", 300)
    assert any("recovery 2 within it" in each for each in told)
    assert "anchored: suspect is co3: it was looked at again" in told


@pytest.mark.full
def test_one_that_is_seen_again_beside_another_is_looked_at_again() -> None:
    field = started({"b": Standing(5.0, 28.0, mark_deg=180.0)})
    asked = field.want()
    field.until(asked, "anchored")
    field.pass_time(3.0)
    field.hidden = {"b", "c"}
    field.things["c"] = Standing(12.0, 30.0)
    field.pass_time(3.0)
    field.things["b"] = Standing(9.0, 33.0, mark_deg=0.0)
    field.hidden.clear()
    told = field.until(asked, "it was looked at again")
    assert "lost: suspect is no longer anchored: case 2, co2: colour red is as described" in told
    field.pass_time(3.0)
    ((symbol, _),) = [pair for pair in field.marked() if pair[0] == "suspect"]
    assert symbol == "suspect"


@pytest.mark.full
def test_what_was_followed_is_followed_again_where_it_is_then() -> None:
    field = started({"b": Standing(5.0, 28.0, mark_deg=180.0)})
    asked = field.want()
    field.until(asked, "anchored")
    following = field.world.ask("cc", "0", Follow(object="suspect", standoff_m=10.0))
    field.pass_time(6.0)
    field.hidden = {"b", "c"}
    field.things["c"] = Standing(12.0, 30.0)
    field.pass_time(3.0)
    field.things["b"] = Standing(9.0, 33.0, mark_deg=0.0)
    field.hidden.clear()
    field.until(asked, "it was looked at again")
    field.until(following, "suspect is followed again")
    field.pass_time(12.0)
    assert [text for _, text in said(following) if "followed" in text] == [
        "suspect is not followed meanwhile: it is open which object suspect is",
        "suspect is followed again",
    ]
    assert field.platform.part(Following).symbol == "suspect"
    east_m, north_m = field.at_m
    assert hypot(east_m - field.start_m[0] - 9.0, north_m - field.start_m[1] - 33.0) < 16.0


@pytest.mark.full
def test_in_its_pilots_hands_nothing_is_sent_and_that_is_told_within_two_seconds() -> None:
    field = started(TWO)
    asked = field.want()
    field.until(asked, "flies: (move v1)")
    field.vehicle.inject(parse_fault("takeover"), field.world.now_us)
    field.pass_time(2.0)
    assert any(each.startswith("waits: suspect is not looked at again: ") for _, each in said(asked))
    sent = len(field.vehicle.commands)
    field.pass_time(30.0)
    assert not [each for _, each in field.vehicle.commands[sent:] if not hasattr(each.order, "pan_rad")]


@pytest.mark.full
def test_what_is_hidden_on_purpose_wears_out_no_vehicle() -> None:
    field = started({"b": Standing(5.0, 28.0, mark_deg=180.0)})
    asked = field.want()
    field.until(asked, "anchored")
    for number in range(MOST_RECOVERIES + 2):
        field.things[f"c{number}"] = Standing(12.0 + 3.0 * number, 30.0)
        field.hidden = set(field.things)
        field.pass_time(6.0)
        field.hidden = {"b"}
        field.pass_time(6.0)
        if any("is enough" in each for _, each in said(asked)):
            break
        field.hidden.clear()
        field.pass_time(12.0)
    told = [each for _, each in said(asked)]
    assert sum(each.startswith("halted") for each in told) <= MOST_RECOVERIES


@pytest.mark.full
def test_cancelled_in_flight_the_vehicle_holds_and_is_free() -> None:
    field = started(TWO)
    asked = field.want()
    field.until(asked, "flies: (move v1)")
    field.world.cancel("cc", "0", asked.conversation)
    field.pass_time(2.0)
    assert isinstance(field.vehicle.commands[-1][1].order, HoldOrder) or any(
        isinstance(each.order, HoldOrder) for _, each in field.vehicle.commands
    )
    assert field.tasks() == []
    sent = len(field.orders)
    field.pass_time(10.0)
    assert len(field.orders) == sent


@pytest.mark.full
def test_a_look_that_shows_nothing_in_time_is_replanned_without() -> None:
    field = started(TWO)
    asked = field.want()
    field.until(asked, "looks: (look-at co1)")
    field.is_blind = True
    field.pass_time(13.0)
    field.is_blind = False
    told = field.until(asked, "it was looked at again")
    plans = [at for at, each in enumerate(told) if each.startswith("plan: ")]
    assert len(plans) == 2
    assert not any(each.startswith("observed") for each in told[: plans[1]])
    assert "anchored: suspect is co2: it was looked at again" in told


@pytest.mark.full
def test_one_that_is_seen_by_half_is_looked_at_from_where_the_rest_is_seen() -> None:
    field = started({"p": Standing(10.0, 15.0, mark_deg=0.0)})
    told = field.until(field.want(), "anchored")
    assert told[1] == "halted: case 2: co1: colour red is as described"
    assert "anchored: suspect is co1: it was looked at again" in told
