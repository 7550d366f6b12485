"""Percepts from JSON lines: what they come to, and what is wrong with others."""

import json
import math
import random
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.anchoring.links.structures import ObjectLinkage
from dyknow.anchoring.percepts.reading import PerceptReader, PerceptTick
from dyknow.anchoring.ready import VISION, WORLD, ready_specification
from dyknow.model.errors import TextError
from dyknow.navigation import LocalFrame

PERCEPT = {
    "t_ms": 100, "percept": "vp1", "type": VISION, "x_m": 1.0, "y_m": 2.0, "sd_m": 0.8, "vx_m_s": 9.0, "vy_m_s": 0.1,
    "colour": "red",
}  # fmt: skip


def read(*lines: Any, frame: LocalFrame | None = None) -> tuple[list[PerceptTick], list[TextError]]:
    errors: list[TextError] = []
    reader = PerceptReader("p.jsonl", (VISION,), errors.append, frame)
    texts = [line if isinstance(line, str) else json.dumps(line) for line in lines]
    return list(reader.ticks(texts)), errors


def test_a_line_is_a_percept_with_position_velocity_uncertainty_and_attributes() -> None:
    (tick,), errors = read(PERCEPT)
    ((symbol, type_, state),) = tick.percepts
    assert not errors
    assert (tick.valid_us, symbol, type_) == (100_000, "vp1", VISION)
    assert state is not None
    assert state[:5] == (100_000, 1.0, 2.0, 9.0, 0.1)
    assert state.covariance[0, 0] == pytest.approx(0.64)
    assert state.attributes == {"colour": "red"}


def test_trackers_may_number_their_percepts_and_lines_may_be_bytes() -> None:
    ticks, errors = read({**PERCEPT, "percept": 7}, {**PERCEPT, "percept": "8"})
    assert [one.symbol for one in ticks[0].percepts] == ["7", "8"]
    assert not errors
    reader = PerceptReader("p.jsonl", (VISION,), errors.append)
    found = list(reader.ticks([b"\xef\xbb\xbf" + json.dumps(PERCEPT).encode(), b'{"percept": "\xff"}\n']))
    assert [one.symbol for tick in found for one in tick.percepts] == ["vp1"]
    assert [error.line for error in errors] == [2]


def test_an_empty_line_of_a_pipe_completes_a_tick_unless_only_the_next_line_shows_that_its_time_is_right() -> None:
    errors: list[TextError] = []
    taken: list[int] = []

    def lines() -> Iterator[str]:
        for t_ms, complete in ((0, [0]), (100, [0, 100]), (1e9, [0, 100]), (200, [0, 100, 200])):
            yield json.dumps({**PERCEPT, "t_ms": t_ms})
            yield "\n"
            assert taken == complete
        yield json.dumps({**PERCEPT, "percept": "late", "t_ms": 200})

    reader = PerceptReader("-", (VISION,), errors.append, is_piped=True)
    for tick in reader.ticks(lines()):
        taken.append(tick.valid_us // 1000)
        assert len(tick.percepts) == 1
    assert [(error.line, error.message.split()[-1]) for error in errors] == [(5, "line"), (9, "time")]


def test_lines_of_one_time_are_one_tick_and_an_end_has_no_state() -> None:
    ticks, errors = read(PERCEPT, {**PERCEPT, "percept": "vp2"}, "", {"t_ms": 200.5, "percept": "vp1", "end": True})
    assert not errors
    assert [(tick.valid_us, [(one.symbol, one.state is None) for one in tick.percepts]) for tick in ticks] == [
        (100_000, [("vp1", False), ("vp2", False)]),
        (200_500, [("vp1", True)]),
    ]


def test_places_on_earth_become_metres_about_the_first_or_in_the_frame_of_the_roads() -> None:
    first = {"t_ms": 0, "percept": "a", "latitude_deg": 58.4, "longitude_deg": 15.6}
    (tick,), errors = read(first, {**first, "percept": "b", "latitude_deg": 58.401})
    assert not errors
    a, b = (one.state for one in tick.percepts)
    assert a is not None
    assert b is not None
    assert math.hypot(a.x_m, a.y_m) < 1e-6
    assert b.y_m == pytest.approx(111.4, abs=0.3)
    ((_, (given_frame,)),), _ = read(first, frame=LocalFrame(58.4, 15.59, 0.0))
    assert given_frame.state is not None
    assert given_frame.state.x_m == pytest.approx(585.0, abs=2.0)


WRONG = {
    "no json": "{",
    "no object": "[1]",
    "nan": '{"t_ms": 0, "percept": "a", "x_m": NaN, "y_m": 0}',
    "infinite": '{"t_ms": 0, "percept": "a", "x_m": 1e999, "y_m": 0}',
    "huge integer": f'{{"t_ms": 0, "percept": "a", "x_m": 1{"0" * 400}, "y_m": 0}}',
    "far": {**PERCEPT, "x_m": 1e9},
    "no position": {"t_ms": 0, "percept": "a"},
    "half a position": {"t_ms": 0, "percept": "a", "x_m": 0},
    "two positions": {**PERCEPT, "latitude_deg": 0, "longitude_deg": 0},
    "truth for a number": {**PERCEPT, "x_m": True},
    "no time": {"percept": "a", "x_m": 0, "y_m": 0},
    "time that is a text": {**PERCEPT, "t_ms": "now"},
    "no name": {"t_ms": 0, "x_m": 0, "y_m": 0},
    "a name that is a fraction": {**PERCEPT, "percept": 7.5},
    "a long name": {**PERCEPT, "percept": "x" * 300},
    "another type": {**PERCEPT, "type": "vision_precept"},
    "negative deviation": {**PERCEPT, "sd_m": -1},
    "half a velocity": {"t_ms": 0, "percept": "a", "x_m": 0, "y_m": 0, "vx_m_s": 1},
    "an end that is a number": {**PERCEPT, "end": 1},
    "an attribute that is a list": {**PERCEPT, "colour": [1]},
    "many attributes": {**PERCEPT, **{f"a{n}": n for n in range(100)}},
    "a long line": json.dumps({**PERCEPT, "x": "y" * 2_000_000}),
    "deep": "[" * 100_000,
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_line_that_is_wrong_is_reported_with_its_number_and_remedy_and_the_others_are_read(name: str) -> None:
    ticks, (error,) = read(PERCEPT, WRONG[name], {**PERCEPT, "t_ms": 200})
    assert [tick.valid_us for tick in ticks] == [100_000, 200_000]
    assert (error.line, error.file) == (2, "p.jsonl")
    assert error.repair
    assert len(str(error)) < 1000


def test_a_line_without_a_place_is_told_what_is_missing() -> None:
    (error,) = read(PERCEPT, {"t_ms": 100, "percept": "vp9", "type": "vision_percept"})[1]
    assert (error.message, '"end": true' in error.repair) == ("x_m and y_m are missing", True)


def test_a_type_that_is_nearly_right_gets_a_suggestion() -> None:
    assert "vision_percept" in str(read({**PERCEPT, "type": "vision_precept"})[1][0])


def test_time_that_goes_backwards_is_left_out() -> None:
    ticks, (error,) = read(PERCEPT, {**PERCEPT, "t_ms": 50}, {**PERCEPT, "t_ms": 150})
    assert [tick.valid_us for tick in ticks] == [100_000, 150_000]
    assert "before, there was t_ms 100" in error.message


@pytest.mark.parametrize("before", [[0, 100], []])
def test_a_single_time_far_ahead_spoils_none_of_the_lines_after_it(before: list[int]) -> None:
    times_ms = [*before, 1e9, 200, 300]
    ticks, (error,) = read(*({**PERCEPT, "t_ms": t_ms} for t_ms in times_ms))
    assert [tick.valid_us // 1000 for tick in ticks] == [*before, 200, 300]
    assert error.line == len(before) + 1
    assert "1e+06 s ahead" in error.message


def test_a_recording_that_begins_anew_is_left_out_and_a_pause_is_none() -> None:
    ticks, errors = read(*({**PERCEPT, "t_ms": t_ms} for t_ms in (0, 100, 90_000, 90_100, 0, 100, 90_200)))
    assert [tick.valid_us // 1000 for tick in ticks] == [0, 100, 90_000, 90_100, 90_200]
    assert [error.line for error in errors] == [5, 6]


def test_one_percept_twice_in_a_tick_counts_if_both_are_the_same_and_else_not_at_all() -> None:
    (tick,), errors = read(PERCEPT, PERCEPT)
    assert len(tick.percepts) == 1
    assert not errors
    (tick,), (error,) = read(PERCEPT, {**PERCEPT, "x_m": 90.0}, {**PERCEPT, "percept": "vp2"})
    assert [one.symbol for one in tick.percepts] == ["vp2"]
    assert error.line == 2


def test_a_place_that_a_percept_cannot_have_reached_is_left_out() -> None:
    ticks, (error,) = read(PERCEPT, {**PERCEPT, "t_ms": 110, "x_m": 1e6}, {**PERCEPT, "t_ms": 200, "x_m": 2.0})
    assert [[each.state.x_m for each in tick.percepts if each.state] for tick in ticks] == [[1.0], [], [2.0]]
    assert error.line == 2
    assert "vp1 is 999999 m from where it was" in error.message


def test_local_and_geographic_positions_do_not_mix() -> None:
    on_earth = {"t_ms": 200, "percept": "a", "latitude_deg": 0.0, "longitude_deg": 0.0}
    assert "local" in read(PERCEPT, on_earth)[1][0].message
    errors: list[TextError] = []
    reader = PerceptReader("p.jsonl", (VISION,), errors.append, LocalFrame(0.0, 0.0, 0.0), is_local=False)
    assert not list(reader.ticks([json.dumps(PERCEPT)]))
    assert "geographic" in errors[0].message
    far = {**on_earth, "t_ms": 300, "latitude_deg": 50.0}
    assert "km" in read(on_earth, far)[1][0].message


@given(st.lists(st.text(max_size=60) | st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(sorted(PERCEPT)), inner, max_size=9),
).map(json.dumps), max_size=8))  # fmt: skip
def test_whatever_the_lines_are_each_is_read_or_reported(lines: list[str]) -> None:
    lines = [line.replace("\n", " ") for line in lines]
    ticks, errors = read(*lines)
    assert sum(len(tick.percepts) for tick in ticks) + len(errors) <= sum(bool(line.strip()) for line in lines)


def test_ten_thousand_percepts_of_clutter_in_a_frame_leave_the_known_identity_as_it_is() -> None:
    rng = random.Random(1)
    linkage = ObjectLinkage(ready_specification())
    lines = []
    for t_ms in range(0, 3000, 100):
        lines.append({**PERCEPT, "t_ms": t_ms, "x_m": t_ms / 100, "y_m": 0.0, "vx_m_s": 10.0})
        if t_ms in {1500, 1600}:
            lines += [
                {"t_ms": t_ms, "percept": f"c{t_ms}.{n}", "x_m": rng.uniform(0, 1000), "y_m": rng.uniform(0, 1000)}
                for n in range(10_000)
            ]
    ticks, errors = read(*lines)
    events = [event for tick in ticks for event in linkage.on_percepts(*tick).events]
    assert not errors
    assert [(event.kind, event.source) for event in events] == [("established", "vp1")]
    assert linkage.anchored("wo1")
    assert set(linkage.objects(WORLD)) == {"wo1"}


def test_a_time_alone_is_a_tick_without_percepts() -> None:
    ticks, errors = read({"t_ms": 0}, PERCEPT, {"t_ms": 100}, {"t_ms": 30_000})
    assert not errors
    assert [(each.valid_us, len(each.percepts)) for each in ticks] == [(0, 0), (100_000, 1), (30_000_000, 0)]


def test_a_time_alone_that_goes_backwards_or_is_none_is_left_out() -> None:
    ticks, errors = read(PERCEPT, {"t_ms": 50}, {"t_ms": "later"}, {"t_ms": 200})
    assert [each.valid_us for each in ticks] == [100_000, 200_000]
    assert [each.line for each in errors] == [2, 3]


def test_an_object_is_forgotten_while_only_time_passes() -> None:
    linkage = ObjectLinkage(ready_specification(None))
    seen = [{**PERCEPT, "t_ms": t_ms, "x_m": t_ms / 100} for t_ms in range(0, 3_000, 100)]
    ticks, errors = read(*seen, {"t_ms": 10_000}, {"t_ms": 100_000})
    assert not errors
    alive = [(linkage.on_percepts(*tick), [*linkage.objects(WORLD)])[1] for tick in ticks]
    assert [len(each) for each in alive[-3:]] == [1, 1, 0]
