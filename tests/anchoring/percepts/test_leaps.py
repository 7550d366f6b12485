"""Which samples of a percept lie too far from the one before."""

from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import Percept
from dyknow.anchoring.percepts.leaps import PerceptLeaps


def at(t_ms: int, x_m: float, name: str = "a", sd_m: float = 1.0) -> Percept:
    return Percept(name, "vision_percept", ObjectState(t_ms * 1000, x_m, 0.0, 0.0, 0.0, diagonal(sd_m)))


def leaps_of(*percepts: Percept) -> list[float | None]:
    leaps = PerceptLeaps()
    return [leaps.leap_m(each) for each in percepts]


def test_one_far_sample_is_a_leap_and_those_before_and_after_are_none() -> None:
    assert leaps_of(at(0, 0.0), at(100, 1e6), at(200, 2.0)) == [None, 1e6, None]


def test_after_two_samples_at_one_place_the_percept_is_there() -> None:
    assert leaps_of(at(0, 0.0), at(100, 1e6), at(200, 1e6 + 5), at(300, 1e6)) == [None, 1e6, None, None]
    assert leaps_of(at(0, 0.0), at(100, 1e6), at(200, -1e6), at(300, 3.0)) == [None, 1e6, 1e6, None]


def test_what_may_be_farther_away_is_no_leap() -> None:
    assert leaps_of(at(0, 0.0), at(100, 150.0)) == [None, None]
    assert leaps_of(at(0, 0.0), at(4000, 4000.0)) == [None, None]
    assert leaps_of(at(0, 0.0, sd_m=100.0), at(100, 1500.0, sd_m=100.0)) == [None, None]
    assert leaps_of(at(0, 0.0), at(0, 1e6, "b")) == [None, None]
    assert leaps_of(at(0, 0.0), Percept("a", "vision_percept", None), at(100, 1e6)) == [None, None, None]


def test_percepts_that_were_not_seen_for_long_are_not_remembered() -> None:
    leaps = PerceptLeaps()
    for number in range(10_000):
        assert leaps.leap_m(at(100 * number, 0.0, f"c{number}")) is None
        leaps.leap_m(at(100 * number, 1e6, f"c{number}"))
    assert len(leaps._known) <= 110
