"""Orders as speech acts: agreed, and done only when the vehicle has taken them over; and when a vehicle gives no way."""

from dataclasses import replace
from typing import Any

import pytest

from dyknow.agents.capabilities.flight.flight import FlightAgent
from dyknow.agents.capabilities.flight.options import AvoidanceOptions
from dyknow.agents.options import Chosen
from dyknow.agents.places import FlightPlan, Waypoint
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Content, Done, FlightOutlook, Goto, Hold, Reason, Resume, ReturnHome
from dyknow.navigation.vehicle import FenceReport, GoToOrder, HoldOrder
from dyknow.reasoning import builtin_profiles
from tests.box import Box, Vehicle

P = Performative
GOTO = Goto(latitude_deg=58.0, longitude_deg=15.0, altitude_m=120.0)


def flying(wire: Box, vehicle: Vehicle | None = None, **config: Any) -> Box:
    wire.join("0", vehicle or Vehicle(), **{"control": True, **config})
    wire.centre()
    wire.run(2.0)
    return wire


def answers(wire: Box, content: Content, run_s: float = 6.0) -> list[tuple[Performative, str | None]]:
    question = wire.question("cc", "0", content)
    wire.run(run_s)
    return [
        (said.act.performative, said.content.text if isinstance(said.content, Done | Reason) else None)
        for said in question.answers
    ]


def test_done_is_what_the_autopilot_has_acknowledged(wire: Box) -> None:
    assert answers(flying(wire), GOTO) == [(P.AGREE, None), (P.INFORM, "acknowledged")]
    assert [command.order for _, command in wire.vehicle("0").commands] == [GoToOrder(58.0, 15.0, 120.0)]


def outlook(wire: Box) -> FlightOutlook:
    """What platform 0 says of where its vehicle will fly."""
    question = wire.question("cc", "0", FlightOutlook(), performative=P.QUERY_REF)
    wire.run(1.0)
    (said,) = question.answers
    assert isinstance(said.content, FlightOutlook)
    return said.content


def test_a_platform_says_where_its_vehicle_flies_and_within_what(wire: Box) -> None:
    plan = FlightPlan((Waypoint(58.0, 15.0, 100.0), Waypoint(58.001, 15.001, 90.0)), loop=True)
    field = ((57.9, 14.9), (58.1, 14.9), (58.1, 15.1))
    inside = replace(next(iter(builtin_profiles().values())), name="inside", fence=field)
    flying(wire, plan=plan, profiles={**builtin_profiles(), "inside": inside})
    on_route = outlook(wire)
    assert (on_route.commander, on_route.again, len(on_route.ahead)) == ("route", True, 2)
    assert on_route.doing.startswith("flies its route, place ")
    answers(wire, GOTO)
    wire.nodes["0"].platform.part(FlightAgent).pilot.bounds.fence = FenceReport(1, highest_m=90.0, radius_m=300.0)
    ordered = outlook(wire)
    assert (ordered.commander, ordered.altitude_m, ordered.ahead) == ("order", 120.0, ("58.0000000 15.0000000",))
    limits, autopilot, declared = ordered.fences
    assert (limits.name, limits.lowest_m, limits.highest_m, limits.radius_m) == ("limits", 10.0, 120.0, 1000.0)
    assert (autopilot.name, autopilot.radius_m, autopilot.highest_m) == ("autopilot", 300.0, 90.0)
    assert (declared.name, len(declared.corners)) == ("inside", 3)
    assert ordered.origin is None


@pytest.mark.parametrize("word", ["denied", "failed", "unsupported"])
def test_a_refusal_of_the_autopilot_is_a_failure_with_its_word(wire: Box, word: str) -> None:
    assert answers(flying(wire, Vehicle(answer=word)), GOTO) == [(P.AGREE, None), (P.FAILURE, f"autopilot: {word}")]
    assert len(wire.vehicle("0").commands) == 1, "it is not repeated"
    assert any(word in note for note in notes(wire))


def notes(wire: Box) -> list[str]:
    return wire.nodes["0"].notes


def test_silence_of_the_autopilot_is_a_failure(wire: Box) -> None:
    flying(wire, Vehicle(answer=None))
    assert answers(wire, Hold()) == [(P.AGREE, None), (P.FAILURE, "no answer")]


def test_a_mode_that_does_not_follow_is_a_failure(wire: Box) -> None:
    (agreed, failed) = answers(flying(wire), ReturnHome())
    assert agreed == (P.AGREE, None)
    assert failed == (P.FAILURE, "not seen in the vehicle's mode within 4 s")


def test_a_newer_order_ends_the_wait_for_an_older(wire: Box) -> None:
    flying(wire, Vehicle(answer=None))
    older = wire.question("cc", "0", GOTO)
    wire.run(0.2)
    answers(wire, Hold())
    assert older.performatives == [P.AGREE, P.FAILURE]


def test_over_a_dead_link_an_order_is_refused(wire: Box) -> None:
    flying(wire)
    vehicle = wire.vehicle("0")
    assert vehicle is not None
    vehicle.is_silent = True
    wire.run(8.0)
    ((refused, reason),) = answers(wire, Hold())
    assert refused is P.REFUSE
    assert (reason or "").startswith("no heartbeat for ")
    assert wire.vehicle("0").commands == []


def test_over_a_dead_link_resume_is_refused_and_what_was_interrupted_remains(wire: Box) -> None:
    flying(wire, plan=FlightPlan((Waypoint(58.001, 15.0, 100.0),)))
    answers(wire, Hold())
    vehicle, sent = wire.vehicle("0"), len(wire.vehicle("0").commands)
    vehicle.is_silent = True
    wire.run(8.0)
    for _ in range(2):
        ((refused, reason),) = answers(wire, Resume(), 0.5)
        assert refused is P.REFUSE
        assert (reason or "").startswith("no heartbeat for ")
    vehicle.is_silent = False
    wire.run(2.0)
    assert len(vehicle.commands) == sent, "the hold stands"
    assert answers(wire, Resume()) == [(P.AGREE, None), (P.INFORM, "acknowledged")]
    assert vehicle.commands[-1][1].order == GoToOrder(58.001, 15.0, 100.0, 5.0)


def test_resume_of_a_plan_that_is_over_is_not_done(wire: Box) -> None:
    flying(wire, plan=FlightPlan((Waypoint(58.0, 15.0, 100.0),)))
    assert answers(wire, Resume()) == [(P.REFUSE, "the plan is over: order a place (dyknow delegate goto)")]


def test_what_was_ordered_is_ended_by_resume_and_nothing_else_is(wire: Box) -> None:
    flying(wire)
    ((refused, reason),) = answers(wire, Resume())
    assert (refused, reason) == (P.REFUSE, "nothing was interrupted that could be resumed")


def test_a_vehicle_in_a_mode_without_giving_way_shows_it(wire: Box) -> None:
    flying(wire, Vehicle(guided=False, mode="AUTO"))
    agent = wire.platform("0").part(FlightAgent)
    assert [condition.text for condition in agent.conditions()] == ["avoidance off: mode AUTO"]
    assert notes(wire).count("avoidance off: mode AUTO") == 1
    entry = next(each for each in wire.nodes["cc"].process.member.directory.entries() if each.unit == "0")
    assert [condition.text for condition in entry.conditions] == ["avoidance off: mode AUTO"]
    vehicle = wire.vehicle("0")
    assert vehicle is not None
    vehicle.guided, vehicle.mode = True, "GUIDED"
    wire.run(1.0)
    assert list(agent.conditions()) == []


@pytest.mark.parametrize(
    ("vehicle", "config"),
    [
        (Vehicle(guided=False, mode="AUTO"), {"missions": True}),
        (Vehicle(guided=False, mode="AUTO", airborne=False), {}),
        (Vehicle(guided=False, mode="AUTO"), {"options": Chosen(AvoidanceOptions(avoidance=False))}),
    ],
)
def test_where_a_mission_may_be_interrupted_or_nothing_flies_there_is_nothing_to_show(
    wire: Box, vehicle: Vehicle, config: dict[str, Any]
) -> None:
    assert list(flying(wire, vehicle, **config).platform("0").part(FlightAgent).conditions()) == []


def test_orders_hold_where_the_vehicle_is(wire: Box) -> None:
    answers(flying(wire), Hold())
    assert [command.order for _, command in wire.vehicle("0").commands] == [HoldOrder()]
