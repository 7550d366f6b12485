"""How fast the own vehicle flies its way: what is seen, and what its parameters say while it gains speed."""

from dyknow.agents.capabilities.separation.own.flown_speeds import FlownSpeeds
from dyknow.agents.places import Fix
from dyknow.navigation.cruise import CruiseReport

CRUISE = CruiseReport(0, 12.0, 4.0, 3.0)


def flown(*speeds: float) -> FlownSpeeds:
    """Those speeds one after the other, ten a second."""
    found = FlownSpeeds()
    for at, speed in enumerate(speeds):
        found.watch(Fix(at * 100_000, 58.0, 15.0, 100.0, speed, 0.0, 0.0))
    return found


def test_while_it_gains_speed_it_flies_as_fast_as_its_parameters_say() -> None:
    gaining = flown(*(0.2 * step for step in range(40)))
    assert gaining.level_m_s(CRUISE) == 12.0
    assert 7.0 < gaining.level_m_s(CruiseReport(0)) < 8.0, "nothing is known but what is seen"


def test_one_that_flies_steadily_flies_so_whatever_its_parameters_say_and_also_while_it_brakes() -> None:
    steady = [5.0] * 40
    assert flown(*steady).level_m_s(CRUISE) == 5.0
    assert flown(*([11.0] * 30), *steady).level_m_s(CRUISE) == 5.0, "a faster leg before is over"
    assert flown(*steady, 4.0, 3.0, 2.0).level_m_s(CRUISE) == 5.0


def test_one_that_stands_will_fly_as_its_parameters_say_or_as_before() -> None:
    assert flown(0.0, 0.0).level_m_s(CRUISE) == 12.0
    assert flown(0.0, 0.0).level_m_s(CruiseReport(0)) == 5.0
    assert flown(*([7.0] * 40), *([0.0] * 40)).level_m_s(CruiseReport(0)) > 6.0


def test_it_climbs_and_sinks_as_its_parameters_say_or_faster() -> None:
    found = flown(0.0)
    assert (found.climb_m_s(CRUISE), found.descent_m_s(CRUISE)) == (4.0, 3.0)
    assert (found.climb_m_s(CruiseReport(0)), found.descent_m_s(CruiseReport(0))) == (2.5, 1.5)
    found.watch(Fix(100_000, 58.0, 15.0, 100.0, 0.0, 0.0, -6.0))
    assert found.climb_m_s(CRUISE) == 6.0
    found.forget()
    assert found.climb_m_s(CRUISE) == 4.0
