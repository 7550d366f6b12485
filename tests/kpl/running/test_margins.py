"""How far a monitor is from violation, as a stream that is there while somebody asks for it."""

import pytest

from dyknow.kpl import Known, parse_specification
from dyknow.kpl.introspection.graph import graph_of
from dyknow.model.errors import TextErrors
from dyknow.model.values import NO_VALUE
from tests.kpl.instances import Running, label
from tests.kpl.specifications import check_specification

BASE = "source number raw\nsource number other\nstrmgen v[car1] = raw\nstrmgen v[car2] = other\n"
CALM = "monitor calm = always v[car1] < LIMIT with sample every 10, max delay 50\ndefine LIMIT = 5\n"


def told(running: Running, name: str) -> list[tuple[int, object]]:
    return [(sample.valid_us, sample.value) for each, sample in running.outputs if each == name]


def test_a_margin_is_told_for_every_state_of_the_monitor_and_only_while_somebody_asks() -> None:
    running = Running(BASE + CALM)
    states: list[int] = []
    running.instance.monitors["calm"].listeners.append(lambda state: states.append(state.valid_us))
    assert not running.network.has(label("margin[calm]"))
    running.add("stream far = margin[calm]\n")
    for value in (1.0, 4.5, 6.0, 5.0):
        running.push("raw", value)
    running.wait(100_000)
    assert told(running, "far") == [(10_000, 4.0), (20_000, 0.5), (30_000, -1.0), (40_000, 0.0)]
    assert [valid_us for valid_us, _ in told(running, "far")] == states
    assert "margin[calm]" in {node.name for node in graph_of(running.instance).nodes}
    listeners = running.instance.monitors["calm"].listeners
    running.remove("stream far = margin[calm]\n")
    assert not running.network.has(label("margin[calm]"))
    assert len(listeners) == 1


def test_the_margin_of_a_window_is_known_when_it_is_over_and_none_where_a_value_lacks() -> None:
    text = "monitor calm = always eventually[0, 20] v[car1] > 3 with sample every 10, max delay 10\nstream far = margin[calm]\n"
    running = Running(BASE + text)
    for value in (1.0, 4.0, 2.0, 7.0, NO_VALUE, 3.0):
        running.push("raw", value)
    found = told(running, "far")
    assert found[:2] == [(10_000, 1.0), (20_000, 4.0)]
    assert {value for _, value in found[2:]} <= {NO_VALUE}
    running.wait(200_000)
    assert len(told(running, "far")) > 4


def test_who_takes_the_margin_of_a_monitor_that_is_made_differently_goes_on() -> None:
    running = Running(BASE + CALM + "stream far = margin[calm]\n")
    running.push("raw", 1.0)
    running.wait(100_000)
    running.change(BASE + CALM.replace("< LIMIT", "< 2 * LIMIT") + "stream far = margin[calm]\n")
    running.push("raw", 1.0)
    running.wait(200_000)
    assert told(running, "far")[0] == (10_000, 4.0)
    assert {value for _, value in told(running, "far")} == {4.0, 9.0}


def test_the_members_of_a_domain_may_change() -> None:
    text = "source object cars\nstrmgen car_ids = cars\nmonitor calm = always forall c in car_ids: v[c] < 5 with sample every 10, max delay 10\n"
    running = Running(BASE + text + "stream far = margin[calm]\n")
    running.push("cars", ("car1",), 5_000)
    running.push("raw", 1.0, 10_000)
    running.push("other", 3.0, 10_001)
    running.push("raw", 2.0, 20_000)
    running.push("cars", ("car1", "car2"), 25_000)
    running.push("other", 4.5, 30_000)
    running.push("raw", 2.0, 30_001)
    running.wait(41_000)
    assert dict(told(running, "far")) == {10_000: 4.0, 20_000: 3.0, 30_000: 0.5}


@pytest.mark.parametrize(
    ("text", "said", "repair"),
    [
        ("stream far = margin[clam]", "no monitor is called clam", "margin[calm]"),
        (
            "stream far = margin[ever]",
            "ever has no margins: a margin needs windows that end",
            "an interval, as in eventually[0, 5s]",
        ),
        ("monitor m = always margin[ever] > 3", "ever has no margins", "an interval, as in eventually[0, 5s]"),
        (
            "stream far = margin[apart]",
            "apart is over what is derived from units (xy_dist)",
            "a monitor over streams of this instance",
        ),
        ("monitor m = always margin[calm, calm] > 3", "margin takes one object", "margin[object1]"),
    ],
)
def test_what_has_no_margin_is_refused_in_words(text: str, said: str, repair: str) -> None:
    other = "define soon = eventually v[car1] > 3\nmonitor ever = always soon\nmonitor apart = always xy_dist[self, 1] > 3\n"
    whole = f"{BASE}{CALM}{other}{text}\n"
    (error,) = check_specification(parse_specification(whole), Known(figures=("margin",)), whole).errors
    assert said in error.message
    assert error.repair == repair


def test_a_monitor_whose_margin_is_taken_stays_one_that_has_margins() -> None:
    running = Running(BASE + CALM + "stream far = margin[calm]\n")
    for changed in ("", "monitor calm = always eventually v[car1] < 5\n"):
        with pytest.raises(TextErrors, match="which the running instance needs"):
            running.change(f"{BASE}define LIMIT = 5\n{changed}stream far = margin[calm]\n")


def test_formulas_may_speak_of_margins() -> None:
    running = Running(
        BASE + CALM + "monitor close = always margin[calm] > 1 with sample every 10, max delay 200, close after 1\n"
    )
    for value in (1.0, 4.5, 1.0, 1.0):
        running.push("raw", value)
    running.wait(400_000)
    assert [each.event for each in running.alarms if each.monitor == "close"] == ["opened", "closed"]


def test_what_is_no_comparison_of_numbers_has_no_margin() -> None:
    running = Running(
        BASE.replace("number", "flag")
        + "monitor on = always v[car1] with sample every 10, max delay 10\nstream far = margin[on]\n"
    )
    running.push("raw", True)
    running.push("raw", True)
    assert told(running, "far")[0] == (10_000, NO_VALUE)
