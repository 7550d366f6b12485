"""The numbered examples of thesis 7.5 and 7.6 as monitors of a domain, over states in which they are violated and not."""

from typing import Any

import pytest

from dyknow.kpl.syntax.parsing import parse_formula
from dyknow.planning import parse_domain, parse_problem
from dyknow.planning.execution.generation import plan_monitors
from dyknow.planning.execution.hints import monitor_hints
from dyknow.reasoning import make_progression
from tests.planning.execution.crane import planned

DOMAIN = """
#domain uav
#domain box
#units uav
#constant SMIN = 0.5
#constant WMIN = 0.2
#constant M = 800
#constant F = 1.2
#feature speed(uav) : fp
#feature winch(uav) : fp
#feature power(uav) : fp
#feature altitude(uav) : fp = 0
#feature attached(uav, box) : boolean
#operator climb-for-flying-empty(uav) :precond altitude(uav) < 7 :effects [end] altitude(uav) := 7
  :monitor EXEC until altitude(uav) >= 7.0
#operator attach-box(uav, box) :precond !attached(uav, box) :effects [end] attached(uav, box)
  :monitor EXEC until [0, 5000] (attached(uav, box) until executing-detach-box(uav, box))
  :monitor eventually [0, 5000] always [0, 1000] attached(uav, box)
#operator detach-box(uav, box) :precond attached(uav, box) & altitude(uav) >= 7 :effects [end] !attached(uav, box)
#monitor winch-is-up: always forall uav: speed(uav) > SMIN -> winch(uav) <= WMIN
#monitor power: always forall uav: power(uav) > M -> (power(uav) < F * M) until [0, 10s] always [0, 5s] power(uav) <= M
#monitor kept: always forall uav, box: attached(uav, box) & altitude(uav) >= 7.0 -> attached(uav, box) until altitude(uav) <= 4.0
"""
PROBLEM = "#objects uav = {heli1} #objects box = {bx7} #goal altitude(heli1) == 7 & attached(heli1, bx7)"
CLIMB, ATTACH, DETACH = (
    "executing-climb-for-flying-empty[heli1]",
    "executing-attach-box[heli1, bx7]",
    "executing-detach-box[heli1, bx7]",
)
ATTACHED, ALTITUDE, SPEED, WINCH, POWER = (
    "attached[heli1, bx7]",
    "altitude[heli1]",
    "speed[heli1]",
    "winch[heli1]",
    "power[heli1]",
)


def first_violated(text: str, states: list[dict[str, Any]]) -> int | None:
    """The number of the state, a second apart, in which it is; flags and `attached` are false unless they are named."""
    progression = make_progression(parse_formula(text), 1_000_000)
    for at, state in enumerate(states):
        progression.progress(at * 1_000_000, dict.fromkeys((CLIMB, ATTACH, DETACH, ATTACHED), False) | state)
        if progression.verdict == "false":
            return at
    return None


def climbs(*altitudes: float) -> list[dict[str, Any]]:
    return [{CLIMB: True, ALTITUDE: one} for one in altitudes]


HELD, ATTACHING = {ATTACHED: True}, {ATTACH: True}
EXAMPLES = {
    "7.5.1": (
        f"always ({SPEED} > 0.5 -> {WINCH} <= 0.2)",
        [{SPEED: 0.3, WINCH: 6.0}, {SPEED: 9.0, WINCH: 0.1}],
        [{SPEED: 0.3, WINCH: 6.0}, {SPEED: 0.6, WINCH: 6.0}],
    ),
    "7.5.2": (
        f"always ({POWER} > 800 -> {POWER} < 960.0 until[0, 10s] always[0, 5s] {POWER} <= 800)",
        [{POWER: 900.0}] * 8 + [{POWER: 700.0}] * 8,
        [{POWER: 900.0}, {POWER: 970.0}],
    ),
    "7.6.1": (
        f"always ({ATTACHED} and {ALTITUDE} >= 7.0 -> {ATTACHED} until {ALTITUDE} <= 4.0)",
        [HELD | {ALTITUDE: 7.2}, HELD | {ALTITUDE: 3.9}, {ALTITUDE: 3.5}],
        [HELD | {ALTITUDE: 7.2}, {ALTITUDE: 7.1}],
    ),
    "7.6.2": (
        f"eventually[0, 5s] always[0, 1s] {ATTACHED}",
        [{}, HELD, {}, HELD, HELD],
        [{}, HELD, {}, HELD, {}, {}, {}, {}],
    ),
    "7.6.3": (
        f"{CLIMB} until {ALTITUDE} >= 7.0",
        [*climbs(0.0, 3.0, 7.1), {ALTITUDE: 7.0}],
        [*climbs(0.0, 3.0), {ALTITUDE: 3.5}],
    ),
    "7.6.4": (
        f"{ATTACH} until[0, 5s] {ATTACHED} until {DETACH}",
        [ATTACHING, ATTACHING, HELD, HELD, HELD, {DETACH: True}],
        [ATTACHING, ATTACHING, HELD, HELD, {}],
    ),
}


@pytest.mark.parametrize("number", EXAMPLES)
def test_an_example_is_generated_as_its_text_and_violated_only_when_it_should_be(number: str) -> None:
    text, good, bad = EXAMPLES[number]
    made = plan_monitors(*planned(parse_domain(DOMAIN), PROBLEM))
    assert text in [one.text for one in made]
    assert first_violated(text, good) is None
    assert first_violated(text, bad) is not None


def test_example_7_5_2_is_violated_if_power_does_not_return_in_time() -> None:
    text = EXAMPLES["7.5.2"][0]
    high, normal = {POWER: 900.0}, {POWER: 700.0}
    assert first_violated(text, [high] * 12) == 10
    assert first_violated(text, [high] * 6 + [normal] * 2 + [high] + [normal] * 9) is None
    assert first_violated(text, [high] * 6 + [normal] * 4 + [high] + [normal] * 9) == 10


def test_example_7_6_1_does_not_see_a_box_that_is_dropped_on_the_way_up_and_7_6_4_does() -> None:
    """What the thesis says of the brittleness of the global formula."""
    dropped = [
        ATTACHING | {ALTITUDE: 3.0},
        HELD | {ALTITUDE: 3.0},
        HELD | {ALTITUDE: 5.0},
        {ALTITUDE: 7.0},
        {ALTITUDE: 7.0},
    ]
    assert first_violated(EXAMPLES["7.6.1"][0], dropped) is None
    assert first_violated(EXAMPLES["7.6.4"][0], dropped) == 3


def test_always_over_what_is_measured_is_hinted_at_and_the_ways_of_7_9_are_not() -> None:
    """7.9: bare `always` over a noisy fluent; within `eventually` it is wanted so."""
    text = """#domain uav #feature speed(uav) : fp #feature up(uav) : boolean
#define fast(uav) := speed(uav) > 9
"""
    bare = "#monitor limit: always forall uav: speed(uav) <= 9"
    hints = monitor_hints(parse_domain(text + bare))
    assert [(one.place.line, "speed" in one.message) for one in hints] == [(3, True)]
    assert hints[0].repair.startswith("eventually [0, 1s] (speed(uav) <= 9)")
    for formula in (
        "always eventually [0, 2s] forall uav: speed(uav) <= 9",
        "always forall uav: speed(uav) > 9 -> eventually [0, 2s] always [0, 1s] speed(uav) <= 9",
        "always forall uav: up(uav)",
    ):
        assert monitor_hints(parse_domain(f"{text}#monitor limit: {formula}")) == ()
    assert monitor_hints(parse_domain(f"{text}#monitor limit: always !exists uav: fast(uav)")) != ()


def test_equality_of_what_is_measured_is_hinted_at_unless_it_has_a_tolerance() -> None:
    text = "#domain uav #units uav #feature h(uav) : fp = 0{} #operator up(uav) :effects monitored [end] h(uav) := 7"
    (hint,) = monitor_hints(parse_domain(text.format("")))
    assert "no measured value is equal" in hint.message and ":within" in hint.repair
    assert monitor_hints(parse_domain(text.format(" :within 0.5"))) == ()


def test_a_goal_that_wants_a_measured_place_exactly_is_hinted_at() -> None:
    text = """
#domain uav
#units uav
#feature x(uav) : fp :within 3
#feature wanted(uav) : fp
#define is-there(uav) := x(uav) == wanted(uav)
#sensed x: east
"""
    declared = parse_domain(text)
    asked = "#objects uav = {u1}\n#init wanted(u1) := 9\n#goal there: "
    for goal in ("x(u1) == 9", "is-there(u1)"):
        (hint,) = monitor_hints(declared.joined(parse_problem(asked + goal, declared)))
        assert (hint.is_goal, hint.place.line) == (True, 3) and hint.message.startswith("the goal there is that x")
        assert hint.repair.startswith("abs(x(u")
    for goal in ("abs(x(u1) - 9) <= 2", "wanted(u1) == 9"):
        assert monitor_hints(declared.joined(parse_problem(asked + goal, declared))) == ()
