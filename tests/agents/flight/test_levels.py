"""Three in one place: one climbs, one stays, one descends, in whatever order they learn of each other."""

from collections import deque
from itertools import combinations, permutations

import pytest

from agents.flight.avoidance import WOULD_HOLD, Avoidance, May
from agents.flight.encounters import CLEAR_M, LeaveToPartner, ManoeuvreRole, Propose, Step
from agents.flight.levels import code_of, is_of_level, level_of, mover, together, ways
from agents.flight.places import Fix

METRE_DEG = 1 / 111_320.0
CLIMB, DESCEND, HOLD, ASIDE = ManoeuvreRole
UNITS = ("0", "1", "2")
ORDERS = list(permutations(list(permutations(UNITS, 2)), 6))[::7]
"""In which the six warnings of three platforms open: each seventh of the 720 orders."""


def fixes(*altitudes_m: float) -> dict[str, Fix]:
    """Three that make for one place at 5 m/s, from the south, the north and the east, 40 m away."""
    away, east = 40.0 * METRE_DEG, 40.0 * METRE_DEG / 0.53
    zero, one, two = altitudes_m
    return {
        "0": Fix(0, 58.0 - away, 15.0, zero, north_m_s=5.0),
        "1": Fix(0, 58.0 + away, 15.0, one, north_m_s=-5.0),
        "2": Fix(0, 58.0, 15.0 + east, two, east_m_s=-5.0),
    }


def anything(_altitude_m: float | None) -> str | None:
    return None


def not_below(floor_m: float) -> May:
    return lambda altitude_m: "below the floor" if altitude_m is not None and altitude_m < floor_m else None


def agreed(at: dict[str, Fix], warned: list[tuple[str, str]], may: May = anything) -> dict[str, Avoidance]:
    """What they agree on, their warnings opening in this order before any proposal arrives."""
    platforms = {unit: Avoidance(unit) for unit in UNITS}
    under_way: deque[tuple[str, Propose]] = deque()

    def send(sender: str, steps: list[Step]) -> None:
        assert not any(isinstance(step, LeaveToPartner) for step in steps)
        under_way.extend((sender, step) for step in steps if isinstance(step, Propose))

    for unit, partner in warned:
        send(unit, platforms[unit].on_warned(partner, at[unit], at[partner], may, 0))
    for _ in range(60):
        if not under_way:
            return platforms
        unit, asked = under_way.popleft()
        partner = asked.partner
        there, here = platforms[partner], platforms[unit]
        refused, steps = there.on_proposal(
            unit, asked.climber, at[partner], at[unit], may, 0, warned=True, level=asked.level
        )
        send(partner, steps)
        if refused is None:
            send(unit, here.on_agreed(partner, at[unit], at[partner], may, 0))
        elif refused.code == "superseded":
            here.on_superseded(partner)
        elif refused.code == WOULD_HOLD or is_of_level(refused.code):
            send(unit, here.on_counter(partner, refused.code, at[unit], at[partner], may, 0))
        else:
            send(unit, here.on_declined(partner, at[unit], at[partner], may, 0))
    raise AssertionError("they never agree")


def altitudes_m(platforms: dict[str, Avoidance], at: dict[str, Fix]) -> list[float]:
    """Where they go, from the lowest to the highest."""
    wanted = {unit: together(each.encounters.values()) for unit, each in platforms.items()}
    return sorted(getattr(wanted[unit], "altitude_m", None) or at[unit].altitude_m for unit in UNITS)


@pytest.mark.parametrize("altitudes", [(102.0, 100.0, 101.5), (100.0, 100.1, 99.9), (99.0, 104.0, 101.0)])
def test_three_in_one_place_take_three_levels_in_nearly_every_order_of_warnings(
    altitudes: tuple[float, float, float],
) -> None:
    at, apart = fixes(*altitudes), 0
    for order in ORDERS:
        platforms = agreed(at, list(order))
        lowest_m, middle_m, highest_m = altitudes_m(platforms, at)
        apart += min(middle_m - lowest_m, highest_m - middle_m) >= CLEAR_M
        assert max(highest_m - max(altitudes), min(altitudes) - lowest_m) <= 35.0, "none climbs twice as high"
        for one, other in combinations(UNITS, 2):
            roles = {platforms[one].encounters[other].role, platforms[other].encounters[one].role}
            assert len(roles) == 2, (order, one, other, "of each two one makes room for the other")
    assert apart >= 0.85 * len(ORDERS), "else two began to climb at once, and one follows the other above it"


def test_where_there_is_no_room_below_the_third_climbs_above_the_one_that_climbs() -> None:
    at = fixes(102.0, 100.0, 101.5)
    for order in ORDERS[::5]:
        platforms = agreed(at, list(order), not_below(90.0))
        assert altitudes_m(platforms, at)[0] >= 90.0
        for one, other in combinations(UNITS, 2):
            roles = {platforms[one].encounters[other].role, platforms[other].encounters[one].role}
            assert roles == {CLIMB, HOLD}, (order, one, other)


@pytest.mark.parametrize(
    ("mine", "theirs", "expected"),
    [
        (None, None, None),
        (HOLD, HOLD, None),
        (CLIMB, None, "0"),
        (None, DESCEND, "1"),
        (HOLD, None, "0"),
        (HOLD, CLIMB, "1"),
        (CLIMB, DESCEND, "0"),
        (CLIMB, CLIMB, "1"),
    ],
)
def test_the_one_that_makes_room_for_another_makes_it_here_and_both_sides_find_the_same(
    mine: ManoeuvreRole | None, theirs: ManoeuvreRole | None, expected: str | None
) -> None:
    assert mover("0", mine, "1", theirs) == expected
    assert mover("1", theirs, "0", mine) == expected


def test_below_one_that_climbs_there_is_no_climbing() -> None:
    assert ways(None, None) == ways(CLIMB, HOLD) == (CLIMB,)
    assert ways(HOLD, None)[0] is ways(DESCEND, None)[0] is DESCEND
    assert ways(CLIMB, CLIMB)[0] is DESCEND, "of two that climb, each for another, one descends"


@pytest.mark.parametrize("level", [CLIMB, DESCEND, HOLD, None])
def test_a_refusal_says_what_its_sender_does_for_another(level: ManoeuvreRole | None) -> None:
    assert is_of_level(code_of(level))
    assert level_of(code_of(level)) is level
    assert level_of("anything else") is None
