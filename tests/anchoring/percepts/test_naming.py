"""Names of detections that have none: one name for each thing while it is seen, at any rate and speed."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import US_PER_S
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.percepts.naming import DetectionNames
from dyknow.anchoring.percepts.reading import PerceptReader

SD_M = 0.3


def state(now_us: int, x_m: float, y_m: float) -> ObjectState:
    return ObjectState(now_us, x_m, y_m, 0.0, 0.0, diagonal(SD_M))


@pytest.mark.parametrize("hz", [2.5, 8.0, 10.0, 25.0])
@pytest.mark.parametrize(("speed_m_s", "lane_m"), [(1.4, 4.0), (4.0, 4.0), (14.0, 12.0)])
@pytest.mark.parametrize("seed", range(3))
def test_things_keep_their_names_while_they_are_seen(hz: float, speed_m_s: float, lane_m: float, seed: int) -> None:
    """Walkers, bikes and cars next to each other, in both directions, one detection in twenty missed."""
    rng = random.Random(seed)
    names, given = DetectionNames(), dict[int, set[str]]()
    things = [(n * lane_m, rng.choice((-1, 1)) * speed_m_s * rng.uniform(0.8, 1.2)) for n in range(10)]
    for frame in range(int(10 * hz)):
        now_us = round(frame * US_PER_S / hz)
        seen = [
            (n, state(now_us, speed * now_us / US_PER_S + rng.gauss(0, SD_M), y + rng.gauss(0, SD_M)))
            for n, (y, speed) in enumerate(things)
            if rng.random() > 0.05
        ]
        rng.shuffle(seen)
        for (n, one), (name, same) in zip(seen, names.named(now_us, [each for _, each in seen]), strict=True):
            assert same is one
            given.setdefault(n, set()).add(name)
    assert all(len(each) == 1 for each in given.values()), given
    assert len(set.union(*given.values())) == len(things)


@given(
    scenes=st.lists(st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), max_size=8), max_size=30),
    gaps=st.lists(st.integers(1, 3_000_000), min_size=30, max_size=30),
)
def test_each_detection_has_one_name_and_no_two_of_one_time_the_same(
    scenes: list[list[tuple[float, float]]], gaps: list[int]
) -> None:
    names, now_us = DetectionNames("x"), 0
    for places, gap_us in zip(scenes, gaps, strict=False):
        now_us += gap_us
        found = names.named(now_us, [state(now_us, *at) for at in places])
        assert [(one.state.x_m, one.state.y_m) for one in found] == places
        assert len({one.name for one in found}) == len(places)


def test_after_a_silence_a_name_has_ended() -> None:
    names = DetectionNames()
    for frame in range(10):
        assert names.named(frame * 100_000, [state(frame * 100_000, 0.0, 0.0)])[0].name == "d1"
    for frame in range(10, 15):
        assert names.named(frame * 100_000, []) == []
    assert names.named(1_500_000, [state(1_500_000, 0.0, 0.0)])[0].name == "d2"


def read(*lines: str) -> tuple[list[list[str]], list[str]]:
    wrong: list[str] = []
    reader = PerceptReader("seen", ["vision_percept", "radar"], lambda error: wrong.append(str(error).splitlines()[0]))
    return [[one.symbol for one in tick.percepts] for tick in reader.ticks(lines)], wrong


def line(t_ms: int, x_m: float, type_: str = "vision_percept", more: str = "") -> str:
    return f'{{"t_ms": {t_ms}, "type": "{type_}", "x_m": {x_m}, "y_m": 0.0{more}}}'


def test_lines_without_a_percept_get_names_by_type_and_a_time_alone_is_a_look_at_nothing() -> None:
    lines = [line(100 * n, x, type_) for n in range(3) for type_ in ("vision_percept", "radar") for x in (0.0, 30.0)]
    symbols, wrong = read(*lines, '{"t_ms": 300}')
    assert not wrong
    assert symbols == [["vd1", "vd2", "rd1", "rd2"]] * 3 + [[]]


def test_names_in_some_lines_of_a_type_are_refused_with_their_place() -> None:
    _, wrong = read(line(0, 0.0), line(0, 9.0, more=', "percept": "p"'), line(0, 9.0, "radar", ', "percept": 7'))
    assert wrong == ["seen:2:1: percepts of the type vision_percept have no names here, and this one has"]
    _, wrong = read(line(0, 0.0, more=', "percept": "p"'), line(0, 9.0))
    assert wrong == ["seen:2:1: percepts of the type vision_percept have names here, and this one has none"]
    _, wrong = read('{"t_ms": 0, "type": "radar", "end": true}')
    assert wrong == ["seen:1:1: percept is missing: what has no name cannot end"]
