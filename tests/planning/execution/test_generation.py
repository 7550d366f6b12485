"""Monitors that are generated from a domain and a plan (thesis 7.6, 7.7): each as its text, once violated and once not."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.kpl.syntax.parsing import parse_formula
from dyknow.planning import parse_domain
from dyknow.planning.execution.generation import plan_monitors, unmonitored
from dyknow.reasoning import make_progression
from tests.planning.execution.crane import DOMAIN, domain, monitors, planned
from tests.planning.logistics import domain as logistics
from tests.planning.logistics import found, problem

GRIP, TURN, RELEASE = "executing-grip[k1, b1]", "executing-turn[k1, b1]", "executing-release[k1, b1]"
HOLDS, MODE, HEIGHT, X = "holds[k1, b1]", "mode[k1]", "height[k1]", "xpos[b1]"
PERIOD_US = 500_000


def verdict(text: str, *states: dict[str, object]) -> str:
    """Of the formula over states half a second apart; what a state does not name is false."""
    progression = make_progression(parse_formula(text), PERIOD_US)
    for at, state in enumerate(states):
        values = dict.fromkeys((GRIP, TURN, RELEASE, HOLDS), False) | state
        progression.progress(at * PERIOD_US, values)  # type: ignore[arg-type] # the values of the tests are values
    return progression.verdict


ON, HELD = {GRIP: True}, {HOLDS: True}
TURNS = {TURN: True, HOLDS: True}
FORMS = [
    ("precondition", 1, f"not {HOLDS} and abs({X} - 2) <= 0.5", [ON | {X: 2.4}], [ON | {X: 2.6}]),
    (
        "prevail",
        2,
        f"({TURN} and {HOLDS}) until not {TURN}",
        [TURNS, TURNS, {}],
        [TURNS, {TURN: True}],
    ),
    (
        "effect",
        3,
        f"{RELEASE} until (not {RELEASE} and not {HOLDS})",
        [{RELEASE: True, HOLDS: True}, {}],
        [{RELEASE: True, HOLDS: True}, HELD],
    ),
    ("effect", 1, f"{GRIP} until (not {GRIP} and {HOLDS})", [ON, ON | HELD, HELD], [ON, ON | HELD, ON, {}]),
    (
        "effect",
        2,
        f"{TURN} until abs({HEIGHT} - 5) <= 0.2",
        [TURNS | {HEIGHT: 0}, TURNS | {HEIGHT: 5}],
        [TURNS | {HEIGHT: 0}, {HEIGHT: 3}],
    ),
    ("duration", 1, f"{GRIP} until[0, 4s] not {GRIP}", [ON] * 8 + [{}], [ON] * 10),
    (
        "link",
        1,
        f"{GRIP} until {HOLDS} until {RELEASE}",
        [ON, HELD, HELD, {RELEASE: True}],
        [ON, HELD, {}],
    ),
    (
        "operator",
        1,
        f"eventually[0, 5s] always[0, 1s] {HOLDS}",
        [ON, HELD, {}, HELD, HELD, HELD],
        [*[ON, ON | HELD] * 8],
    ),
    (
        "global",
        0,
        f'always ({MODE} = "on" -> eventually[0, 2s] wind <= 10)',
        [{MODE: "on", "wind": 12}, {MODE: "off", "wind": 9}, {MODE: "off", "wind": 30}],
        [{MODE: "on", "wind": 12}] * 6,
    ),
]
DISTURBED = f"{GRIP} until ({HOLDS} and (not {RELEASE} and eventually[0, 2s] {HOLDS}) until ({RELEASE} and {HOLDS}))"


@pytest.mark.parametrize(("kind", "step", "text", "good", "bad"), FORMS, ids=[f"{one[0]}-{one[1]}" for one in FORMS])
def test_each_form_is_generated_and_is_violated_only_when_it_should_be(
    kind: str, step: int, text: str, good: list[dict[str, object]], bad: list[dict[str, object]]
) -> None:
    assert text in [one.text for one in monitors() if (one.kind, one.step) == (kind, step)]
    assert verdict(text, *good) != "false"
    assert verdict(text, *bad) == "false"


def test_a_causal_link_may_be_disturbed_for_a_bounded_time() -> None:
    assert DISTURBED in [one.text for one in monitors(":disturbed 2s") if one.kind == "link"]
    assert verdict(DISTURBED, ON, ON | HELD, {}, {}, {}, HELD, {RELEASE: True, HOLDS: True}) == "true"
    assert verdict(DISTURBED, ON, ON | HELD, *[{}] * 6) == "false"
    assert verdict(DISTURBED, ON, ON | HELD, {}, {RELEASE: True}) == "false", "it must hold again when it is needed"
    plain = next(one.text for one in monitors() if one.kind == "link")
    assert verdict(plain, ON, ON | HELD, {}) == "false"


def test_the_other_form_for_effects_is_true_however_the_action_ends() -> None:
    """Thesis 7.7 has `EXEC until (phi until not EXEC)` for the same condition; by its own 7.5.1 it is not."""
    assert verdict(f"{GRIP} until ({HOLDS} until not {GRIP})", ON, ON | HELD, ON, {}) == "true"
    assert verdict(f"{GRIP} until (not {GRIP} and {HOLDS})", ON, ON | HELD, ON, {}) == "false"


def test_only_conditions_that_are_flagged_are_monitored() -> None:
    quiet = planned(parse_domain(DOMAIN.replace(" monitored", "").replace(":monitor eventually", "// ")))
    assert [one.kind for one in plan_monitors(*quiet)] == ["global"]


@pytest.mark.parametrize("flag", ["precond", "prevail", "effects", "timeconstraint"])
def test_a_flag_that_is_taken_away_takes_its_monitors_away(flag: str) -> None:
    kinds = {"precond": "precondition", "timeconstraint": "duration", "effects": "effect"}
    changed = plan_monitors(*planned(parse_domain(DOMAIN.replace(f":{flag} monitored", f":{flag}"))))
    kind = kinds.get(flag, flag)
    gone = {"effect", "link"} if kind == "effect" else {kind}
    assert {one.text for one in monitors()} - {one.text for one in changed} == {
        one.text for one in monitors() if one.kind in gone
    }


def test_example_7_6_1_and_7_6_3_and_7_6_4_are_monitors_of_the_logistics_domain() -> None:
    asked = problem(boxes=1)
    made = plan_monitors(logistics().joined(asked), found(logistics(), asked).plan)
    texts = [one.text for one in made]
    lifted = "attached[uav1, b1] and altitude[uav1] >= 7.0 -> attached[uav1, b1] until altitude[uav1] <= 5.0"
    assert f"always ({lifted})" in texts
    assert "executing-climb-for-flying-empty[uav1] until altitude[uav1] >= 6.0" in texts
    attach = "executing-attach-box[uav1, b1] until[0, 5s] attached[uav1, b1] until executing-detach-box[uav1, b1]"
    assert attach in texts
    assert next(one for one in made if one.text == attach).outlives


def test_every_monitor_of_a_logistics_plan_reads_back_from_its_text() -> None:
    asked = problem(boxes=2, uavs=2)
    made = plan_monitors(logistics().joined(asked), found(logistics(), asked).plan)
    assert len(made) > 50
    assert [one.text for one in made if parse_formula(one.text) != one.formula] == []


def test_a_link_ends_at_its_own_consumer_if_an_action_between_has_the_same_flag() -> None:
    """The lamp is lit once; the same look is made twice, the link ends at the second one."""
    text = """
#domain lamp
#units lamp
#feature lit(lamp) : boolean
#feature looks(lamp) : fp = 0
#operator light(lamp) :precond !lit(lamp) :effects monitored [end] lit(lamp)
#operator look(lamp) :precond lit(lamp) :effects [end] looks(lamp) := looks(lamp) + 1
"""
    made = plan_monitors(*planned(parse_domain(text), "#objects lamp = {l1} #goal looks(l1) == 2"))
    assert "executing-light[l1] until lit[l1] until executing-look[l1, 3]" in [one.text for one in made]


@given(st.lists(st.booleans(), min_size=1, max_size=12))
def test_7_5_1_until_holds_from_now_on_and_not_at_the_state_it_ends_with(held: list[bool]) -> None:
    """`EXEC until not EXEC` with the condition: it counts in every state of the action, and in none after."""
    text = f"({TURN} and {HOLDS}) until not {TURN}"
    states = [{TURN: True, HOLDS: one} for one in held]
    assert (verdict(text, *states, {}) == "true") is all(held)
    for one, other in pairwise(held):
        if not one and other:
            assert verdict(text, *states) == "false"


def test_a_plan_with_nothing_to_do_has_global_monitors_alone() -> None:
    declared, plan = planned(
        domain(), "#objects crane = {k1} #objects box = {b1} #init xpos(b1) := 2 #goal !holds(k1, b1)"
    )
    assert plan.actions == ()
    assert [one.kind for one in plan_monitors(declared, plan)] == ["global"]


POWER = """#domain robot
#domain place
#feature power(robot) : fp
#feature linked(robot, place) : boolean
#feature at(robot) : fp = 0
#operator go(robot, place)
  :timeconstraint 2s <= end - start <= 2s
  :precond monitored [start] linked(robot, place)
  :prevail monitored [start, end] power(robot) >= 10
  :effects [end] at(robot) := 1
"""
POWERED = """#objects robot = {r1}
#objects place = {p1}
#init power(r1) := 90, linked(r1, p1)
#goal there: at(r1) == 1
"""


def test_a_measured_number_is_monitored_though_the_problem_gives_it_and_what_gives_no_monitor_is_named() -> None:
    declared, plan = planned(parse_domain(POWER), POWERED)
    assert [(one.kind, one.text) for one in plan_monitors(declared, plan)] == [
        ("prevail", "(executing-go[r1, p1] and power[r1] >= 10) until not executing-go[r1, p1]")
    ]
    assert [(one.place.line, one.about, one.features) for one in unmonitored(declared, plan)] == [
        (8, "go", ("linked",))
    ]
    assert unmonitored(*planned(domain())) == ()
