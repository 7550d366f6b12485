"""What a mission holds for true: effects by the state they begin in, features that are sensed, and what was assumed."""

from dyknow.planning import PlanFound, find_plan, parse_domain, parse_problem
from dyknow.planning.execution.beliefs import Beliefs
from dyknow.planning.execution.generation import plan_monitors
from dyknow.planning.execution.timeline import Schemas, expected_actions
from tests.planning.logistics import FOLDER, domain

GAUGE = """
#domain tank
#units tank
#feature level(tank) : fp
#feature full(tank) : boolean
#sensed level: load
#operator fill(tank) :duration 3s :precond [start] !full(tank) :effects [end] full(tank)
  :monitor EXEC until (!EXEC & level(tank) <= 5)
"""


def test_conditions_of_effects_count_in_the_state_in_which_each_action_starts() -> None:
    """The same action over the same objects stands twice in the plan: onto the carrier, and at the goal."""
    asked = parse_problem((FOLDER / "carrier.prob").read_text("utf-8"), domain())
    found = find_plan(domain(), asked)
    assert isinstance(found, PlanFound)
    put = [
        {each.label: each.value for each in one.changes}
        for one in expected_actions(Schemas(domain().joined(asked)), found.plan)
        if one.action.shown == "detach-box(uav0, b1)"
    ]
    assert [each.get("on-carrier[b1, c1]") for each in put] == ["correctly-placed", None]
    assert [each.get("xpos[b1]") for each in put] == [-0.6, None]


def test_what_is_sensed_is_no_constant_though_its_first_value_is_known_and_no_action_changes_it() -> None:
    read = parse_domain(GAUGE)
    asked = parse_problem("#objects tank = {t1} #init level(t1) := 0 #goal full(t1)", read)
    found = find_plan(read, asked)
    assert isinstance(found, PlanFound)
    (monitor,) = plan_monitors(read.joined(asked), found.plan)
    assert "level[t1] <= 5" in monitor.text


def test_what_is_assumed_counts_more_than_a_state_of_the_same_time_and_less_than_a_later_one() -> None:
    beliefs = Beliefs({}, 0, 1_000_000, lambda _label: False)
    beliefs.on_state(5_000_000, {"attached[u, b]": True})
    beliefs.change(5_000_000, [("attached[u, b]", False)])
    assert beliefs.values() == {"attached[u, b]": False}
    beliefs.on_state(5_200_000, {"attached[u, b]": True})
    assert beliefs.values() == {"attached[u, b]": True}
