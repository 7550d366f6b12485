"""Formulas in the specification around them: what names resolve to, sorts that are known, and what stays unchecked."""

import pytest

from dyknow import Policy
from dyknow.kpl import parse_specification
from dyknow.model.errors import TextError
from tests.kpl.instances import Running

BEFORE = """\
source pos gps
source objects named
source fast radar
strmgen cars = named
strmgen pos[car1] = gps
strmgen fast[car1] = radar
for c in cars strmgen dist[c] = radar
"""


def errors_of(text: str) -> list[str]:
    running = Running(BEFORE)
    try:
        running.add(text)
    except TextError as told:
        return [error.message for error in told.errors]  # type: ignore[attr-defined]
    return []


@pytest.mark.parametrize(
    "text",
    [
        "monitor m = fast[car1]",
        "monitor m = always (fast[car1] > 3 or fast[car1] = car1)",
        "monitor m = always (pos.north_m[car1] > 3 and since(pos[car1]) < 3s)",
        "monitor m = always pos[car1] != pos[car1]",
        "monitor m = always forall c in cars: pos.altitude_m[c] > 3",
        "monitor m = always forall c in {car7, car8}: fast[c] > 3",
        "monitor m = always forall c in cars - {car7}: c != car1 and dist[c] > 3",
        "monitor m = always dist[car9] > 3",
        "monitor m = always (fast[self] > 3 or fast[7] > 3)",
        "monitor m = always forall u in units - {self}: xy_dist[self, u] > 3 and cpa_time[self, u] > 3s",
        "monitor m = always speed[uav1] > 3",
        "monitor m = always stream_delay[worst] < 3",
        "monitor m = always (occurred(entered[car1, crossing]) -> fast[car1] < 3)",
        "monitor m = always sped[car1] > 3",
        'define WHO = "car1"\nmonitor m = always fast[WHO] > 3',
        "define T = 3s\ndefine p = fast[car1] > 3\nmonitor m = always (p -> eventually[0, T] not p)",
        "define twice[c] = 2 * fast[c]\nmonitor m = always twice[car1] > 3",
        "define near[c] = xy_dist[self, c] < 3\nmonitor m = always not near[uav1]",
        "strmgen s[car1] = state(pos[car1], fast[car1])\nmonitor m = always s.fast[car1] > 3",
        "stream x = pos.altitude_m[car1]",
        "strmgen cur = named\nstrmgen one = select pos[c] for c in cur\nmonitor m = always one.north_m > 3",
    ],
)
def test_what_is_right_or_unchecked_is_accepted(text: str) -> None:
    assert errors_of(text) == []


def test_what_a_definition_defines_is_looked_at_where_it_is_used() -> None:
    assert errors_of("define where[c] = pos.north_m[c]\nmonitor m = where[car1]") == [
        "a truth value is wanted, this is a number"
    ]
    assert errors_of("define here = pos[car1]\nmonitor m = here > 3") == ["a record meets a number"]


def test_makers_of_several_sorts_leave_a_feature_of_any_object_unchecked() -> None:
    one = "monitor m = always forall c in cars: pos[c] > 3"
    assert errors_of(one) == ["a record meets a number"]
    assert errors_of(f"strmgen pos[car2] = radar\n{one}") == []


def test_what_a_running_formula_speaks_of_cannot_be_taken_away() -> None:
    running = Running(f"{BEFORE}define slow[c] = fast[c] < 3\nmonitor m = always forall c in cars: slow[c]")
    before = running.state()
    with pytest.raises(TextError, match=r"there is no domain cars, which the running instance needs"):
        running.remove("strmgen cars = named\nfor c in cars strmgen dist[c] = radar")
    with pytest.raises(TextError, match=r"slow takes 2 objects, here are 1, which the running instance needs"):
        running.change(f"{BEFORE}define slow[c, d] = fast[c] < 3\nmonitor m = always forall c in cars: slow[c]")
    assert running.state() == before


def test_a_name_is_the_object_that_streams_are_called_by() -> None:
    running = Running(
        "source object seen\nstrmgen cur = seen\nstrmgen pos[car5] = seen\nmonitor m = always cur != car5"
    )
    running.push("seen", "car4")
    running.push("seen", "car5", 200_000)
    running.wait(3_000_000)
    assert [alarm.event for alarm in running.alarms][:1] == ["opened"]


def test_a_monitor_over_the_most_recent_values_has_the_usual_period_delay_and_grid() -> None:
    (declared,) = parse_specification("monitor m = v > 3 with use most recent")
    (longer,) = parse_specification("monitor m = v > 3 with sample every 1s, use most recent")
    assert str(declared.policy) == str(Policy.parse("sample every 100, max delay 1s, from 0, use most recent"))
    assert (longer.policy.sample_us, longer.policy.max_delay_us, longer.policy.from_us) == (1_000_000, 1_000_000, 0)
