"""Recovery operators, tolerances and disturbances in the text of a domain."""

import pytest

from dyknow.model.errors import TextErrors
from dyknow.planning import parse_domain, print_declarations
from tests.planning.execution.crane import DOMAIN
from tests.planning.logistics import domain as logistics

TEXT = """
#domain uav
#domain box
#units uav
#feature x(box) : fp :within 0.5 :disturbed 2s
#feature load(uav) : fp = 4
#feature on(uav, box) : boolean
#operator lift(uav, box) :effects monitored [end] on(uav, box) :recovery lighter
#monitor few: always forall uav: load(uav) >= 0 :recovery replan
#recovery lighter(uav, box)
  :when !on(uav, box)
  :act brake
  :assume load(uav) := load(uav) - 1, forall box2: on(uav, box2) -> !on(uav, box2)
  :assume !on(uav, box)
  :locate x(box)
  :times 2 drop-goal
#recovery replan :assume forall uav, box: load(uav) < 1 & on(uav, box) -> x(box) := 0
"""


def test_recoveries_are_read_and_printed_back() -> None:
    for found in (parse_domain(TEXT), parse_domain(DOMAIN), logistics()):
        assert parse_domain(print_declarations(found)) == found
    (lighter, replan) = parse_domain(TEXT).recoveries
    assert (lighter.act, lighter.times, lighter.then) == ("brake", 2, "drop-goal")
    assert [len(one) for one in lighter.assumptions] == [2, 1]
    assert (replan.act, replan.times, replan.then) == ("loiter", 3, "ask")
    feature = parse_domain(TEXT).features[0]
    assert (feature.within, feature.disturbed_us) == (0.5, 2_000_000)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        (":act brake", ":act break", "break is no word for :act"),
        ("drop-goal", "drop-goals", "drop-goals is no word for :times"),
        (":times 2", ":times 0", "a number from 1 to 1000 is wanted"),
        (":times 2", ":times 2.5", "a number from 1 to 1000 is wanted"),
        (":recovery lighter", ":recovery ligther", "there is no recovery ligther"),
        (":recovery replan", ":recovery lighter", "lighter is about box, and there is none here"),
        (":locate x(box)", ":locate box", "what is located is a feature of an object"),
        (":when !on(uav, box)", ":when !onn(uav, box)", "there is no feature onn"),
        (":assume !on(uav, box)", ":assume !onn(uav, box)", "there is no feature onn"),
        ("replan :assume", "replan(uav) :assume", "replan is done before every new plan"),
        (":within 0.5", ":within -1", "a tolerance is a number that is not negative"),
        (":effects monitored", ":duration monitored 3s :effects", "no bound that could be monitored"),
    ],
)
def test_what_is_wrong_with_a_recovery_is_said_with_its_place(before: str, after: str, message: str) -> None:
    with pytest.raises(TextErrors) as caught:
        parse_domain(TEXT.replace(before, after, 1))
    assert any(message in str(one) for one in caught.value.errors), caught.value
    assert all(one.line for one in caught.value.errors)
