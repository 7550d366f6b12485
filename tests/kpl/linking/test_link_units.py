"""Units of users as computational units of links."""

from itertools import pairwise

import pytest

from dyknow import Field, Sort, UnitPrototype, computational_unit, value_unit
from dyknow.kpl.introspection.graph import graph_of
from dyknow.model.errors import TextError, TextErrors
from dyknow.network.prototypes import prototypes_in
from tests.kpl.instances import Running

CAR = Sort(
    "car",
    tuple(
        Field(*each)
        for each in (("symbol", "text"), ("x_m", "m"), ("y_m", "m"), ("kmh", "1"), ("calls", "1"), ("end", "bool"))
    ),
)
TEXT = """
sort vision-object(symbol in text, x_m in m, y_m in m, colour in text, end in bool)
source vision-object camera
strmgen percepts = camera
strmgen world = link(percepts, WorldObject,
  eventually [1000, oo] true, eventually [0, 1000] xy_dist[from, to] < thresh, true)
strmgen cars = link(world, CarOf, eventually [500, oo] true, eventually [0, 1000] xy_dist[from, to] < thresh, true)
stream seen = cars
"""


@value_unit(CAR, "world", name="CarOf")
def car_of(world: tuple) -> tuple:
    symbol, x_m, y_m, vx_m_s, vy_m_s, *_ = world
    return symbol, x_m + 1.0, y_m, 3.6 * (vx_m_s**2 + vy_m_s**2) ** 0.5, 0, False


@computational_unit(CAR, "world", "car", name="CarOf", needs_all=False)
def counting(_now_us, world, car):
    before = 0 if car is None else car.value[4]
    return ("", *world.value[1:3], 0.0, before + 1, False)


@value_unit(CAR, "world", name="CarOf")
def broken(_world):
    raise ZeroDivisionError("no lens")


@value_unit(CAR, "world", name="CarOf")
def silly(_world):
    return ("", float("nan"), "far", 0.0, 0, False)


class Camera(Running):
    """One car at 10 m/s."""

    def __init__(self, *units, text=TEXT):
        super().__init__(text, prototypes=prototypes_in(units))

    def drive(self, until_ms=4000):
        for t in range(0, until_ms, 100):
            self.push("camera", ("vp1", t / 100, 0.0, "red", False), t * 1000)


def test_the_unit_of_a_user_makes_the_states_and_those_below_keep_theirs() -> None:
    camera = Camera(
        car_of, text=TEXT + "sort car(symbol in text, x_m in m, y_m in m, kmh in 1, calls in 1, end in bool)\n"
    )
    camera.drive()
    samples = [sample for name, sample in camera.outputs if name == "seen"]
    assert {sample.value[0] for sample in samples} == {"co1"}, "symbols are those of the link"
    last = samples[-1]
    assert last.value[1] == pytest.approx(last.valid_us / 1e5 + 1.0, abs=1.0)
    assert last.value[3] == pytest.approx(36.0, abs=2.0)
    assert not camera.faults


def test_a_unit_of_two_inputs_takes_the_state_before() -> None:
    camera = Camera(counting)
    camera.drive()
    counts = [sample.value[4] for name, sample in camera.outputs if name == "seen"]
    assert counts[-1] > 20
    assert all(later == before + 1 for before, later in pairwise(counts))


@pytest.mark.parametrize(("unit", "said"), [(broken, "ZeroDivisionError"), (silly, "not of its sort")])
def test_what_a_unit_raises_is_counted_and_told_and_ends_no_link(unit, said) -> None:
    camera = Camera(unit)
    camera.drive()
    samples = [sample for name, sample in camera.outputs if name == "seen"]
    assert {sample.value[0] for sample in samples} == {"co1"}
    assert samples[-1].value[1] == pytest.approx(samples[-1].valid_us / 1e5, abs=1.5), "where the one below it is"
    assert camera.faults
    assert all(label == "cars" and said in text for label, text in camera.faults)
    (node,) = (each for each in graph_of(camera.instance).nodes if each.name == "cars")
    assert any("CarOf has failed" in each for each in node.note)
    assert "world -> cars by CarOf: 1 linked" in node.note


@pytest.mark.parametrize(
    ("units", "text", "message"),
    [
        ((), TEXT, "CarOf is no computational unit"),
        ((), TEXT + "sort car(symbol in text, x_m in m, y_m in m)\ncompunit car CarOf(world)\n", "nothing here implements CarOf"),
        ((value_unit("car", "world", name="CarOf")(lambda _: 1),), TEXT, "no states of objects"),
        ((value_unit("car", "vision-object", name="CarOf")(lambda _: 1),), TEXT, "takes vision-object here; world is world"),
        ((value_unit(CAR, "world", "pos", name="CarOf")(lambda *_: 1),), TEXT, "takes pos here; what it makes is car"),
        ((value_unit(CAR, "world", name="CarOf", cost_us=10**6)(lambda _: 1),), TEXT, "cannot be run by a host"),
        ((UnitPrototype("CarOf", "car", ("world",), dict, elsewhere=lambda *_: None),), TEXT + "sort car(symbol in text, x_m in m, y_m in m)\n", "cannot be run by a host"),
    ],
)  # fmt: skip
def test_units_that_cannot_be_those_of_a_link_are_refused_with_their_place(units, text, message) -> None:
    with pytest.raises((TextError, TextErrors), match=message) as wrong:
        Camera(*units, text=text)
    assert "a.kpl:" in str(wrong.value)
    errors = wrong.value.errors if isinstance(wrong.value, TextErrors) else [wrong.value]
    assert all(each.repair for each in errors if message in each.message)
