"""Faults that begin by themselves: read, printed, drawn from a seed, begun when their time has come."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.model.errors import TextError
from dyknow.sim_uavs.dynamics.faults import FaultSchedule, drawn, parse_fault, parse_fault_at, parse_scheduled

SECOND = 1_000_000


@pytest.mark.parametrize(
    "text", ["dropped-box at load+4s", "late=3 at 30s for 20s", "failed-take-off at arm+0s for 15s", "silence at 2min"]
)
def test_a_fault_of_a_schedule_is_printed_as_it_is_written(text: str) -> None:
    assert str(parse_fault_at(text)) == text
    assert parse_scheduled(f"uav7 {text}") == ("uav7", parse_fault_at(text))


@pytest.mark.parametrize(
    "text", ["", "0", "0 late=3", "0 late=3 in 3s", "0 lat at 3s", "0 late at land+3s", "0 late at 3x"]
)
def test_what_is_none_is_refused_with_one_that_is(text: str) -> None:
    with pytest.raises(TextError) as refused:
        parse_scheduled(text)
    assert refused.value.repair


@given(st.text(max_size=60))
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        _, read = parse_scheduled(text)
    except TextError:
        return
    assert parse_fault_at(str(read)) == read


def test_seeds_draw_every_kind_of_work_and_the_same_one_again() -> None:
    faults = [drawn(seed, index) for seed in range(20) for index in range(2)]
    assert faults == [drawn(seed, index) for seed in range(20) for index in range(2)]
    assert {each.fault.kind for each in faults} == {
        "dropped-box", "failed-attach", "failed-take-off", "misplaced-box", "late"
    }  # fmt: skip
    assert all(parse_fault_at(str(each)) == each for each in faults)


def test_faults_begin_once_when_their_time_after_the_start_the_arming_or_the_first_load_has_come() -> None:
    texts = ("late=3 at 5s for 2s", "failed-attach at arm+1s", "dropped-box at load+4s")
    schedule = FaultSchedule(map(parse_fault_at, texts), 0)
    begun = {
        second: found
        for second in range(30)
        if (found := schedule.due(second * SECOND, is_armed=second >= 7, holds=10 <= second <= 11))
    }
    assert begun == {
        5: [(parse_fault("late=3"), 7 * SECOND)],
        8: [(parse_fault("failed-attach"), None)],
        14: [(parse_fault("dropped-box"), None)],
    }
