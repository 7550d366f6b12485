"""Floor, ceiling, range, the autopilot's own fence, and a home that must be believed."""

from math import inf, nan

import pytest

from dyknow.agents.places import Bounds, Fix, FlightLimits
from dyknow.navigation.vehicle import FenceReport, GoToOrder, HoldOrder, HomeReport, InterruptOrder, LandOrder, Order

HOME = HomeReport(0, 58.0, 15.0, 50.0)
NORTH_DEG = 1 / 111_194.9
HERE = Fix(0, 58.0, 15.0, 100.0)


def goto(north_m: float = 0.0, height_m: float = 50.0) -> GoToOrder:
    return GoToOrder(58.0 + north_m * NORTH_DEG, 15.0, 50.0 + height_m)


@pytest.fixture
def bounds() -> Bounds:
    found = Bounds()
    assert found.on_home(HOME, flying=False) is None
    return found


def outside(bounds: Bounds, order: Order, fix: Fix | None = HERE) -> str:
    return bounds.outside(order, FlightLimits(), fix) or ""


def test_what_is_within_is_allowed_and_holding_and_landing_have_no_place(bounds: Bounds) -> None:
    for order in (goto(900.0), InterruptOrder(*goto()[:3]), HoldOrder(), LandOrder()):
        assert outside(bounds, order) == ""


@pytest.mark.parametrize("value", [nan, inf, -inf])
@pytest.mark.parametrize("field", ["latitude_deg", "longitude_deg", "altitude_m"])
def test_what_is_no_number_is_no_place(bounds: Bounds, field: str, value: float) -> None:
    assert "not a number" in outside(bounds, goto()._replace(**{field: value}))
    assert bounds.on_home(HOME._replace(**{field: value}), flying=False) == "home: expected finite degrees and metres"
    assert bounds.home == HOME


def test_beyond_the_range_is_refused_and_so_is_the_middle_of_nowhere(bounds: Bounds) -> None:
    assert "beyond the range of 1000 m" in outside(bounds, goto(1010.0))
    assert "from home" in outside(bounds, GoToOrder(0.0, 0.0, 100.0))


def test_who_is_outside_already_may_stop_there_and_come_nearer_but_not_go_farther(bounds: Bounds) -> None:
    out = HERE._replace(latitude_deg=58.0 + 1500.0 * NORTH_DEG)
    assert outside(bounds, goto(1500.0), out) == ""
    assert outside(bounds, goto(1200.0), out) == ""
    assert "range" in outside(bounds, goto(1600.0), out)


def test_without_a_home_the_altitude_over_it_follows_from_the_height_and_the_range_from_here() -> None:
    bounds = Bounds()
    assert "home is not known" in outside(bounds, goto())
    bounds.on_height(100.0, 50.0)
    assert outside(bounds, goto()) == ""
    assert "floor" in outside(bounds, goto(height_m=5.0))
    assert "from where it is" in outside(bounds, goto(1010.0))
    bounds.on_height(nan, 50.0)
    assert outside(bounds, goto()) == "", "what is not a number is not believed"


@pytest.mark.parametrize("leap", [HOME._replace(altitude_m=5050.0), HOME._replace(latitude_deg=58.001)])
def test_home_does_not_leap_in_flight(bounds: Bounds, leap: HomeReport) -> None:
    assert "leapt" in (bounds.on_home(leap, flying=True) or "")
    assert bounds.home == HOME
    bounds.forget()
    assert "leapt" in (bounds.on_home(leap, flying=True) or ""), "nor while the vehicle was silent"
    assert bounds.on_home(HOME._replace(altitude_m=60.0), flying=True) is None
    assert bounds.on_home(leap, flying=False) is None


def test_after_silence_home_is_to_be_told_again(bounds: Bounds) -> None:
    bounds.forget()
    assert "home is not known" in outside(bounds, goto())
    bounds.on_home(HOME, flying=True)
    assert outside(bounds, goto()) == ""


@pytest.mark.parametrize(
    ("fence", "order", "words"),
    [
        (FenceReport(0, highest_m=40.0), goto(height_m=38.5), "below the autopilot's fence of 40 m"),
        (FenceReport(0, lowest_m=15.0), goto(height_m=16.0), "above the autopilot's fence of 15 m"),
        (FenceReport(0, radius_m=300.0), goto(299.0), "inside the autopilot's fence of 300 m"),
    ],
)
def test_the_autopilots_own_fence_is_kept(bounds: Bounds, fence: FenceReport, order: GoToOrder, words: str) -> None:
    assert outside(bounds, order) == ""
    bounds.fence = fence
    assert words in outside(bounds, order)
    bounds.fence = FenceReport(0)
    assert outside(bounds, order) == ""


def test_limits_are_those_of_the_platform(bounds: Bounds) -> None:
    near = FlightLimits(floor_m=30.0, ceiling_m=60.0, range_m=200.0)
    assert "floor of 30" in (bounds.outside(goto(height_m=29.0), near, HERE) or "")
    assert "ceiling of 60" in (bounds.outside(goto(height_m=61.0), near, HERE) or "")
    assert "range of 200" in (bounds.outside(goto(210.0), near, HERE) or "")
