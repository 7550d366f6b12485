"""Conditions of links speak of any label: streams, chronicles, other objects, features derived of both; the rest is refused."""

import pytest

from dyknow import Label, Sample, Sort
from dyknow.kpl import parse_specification
from dyknow.model.errors import SourceText, TextErrors
from dyknow.model.values import Field
from tests.kpl.instances import Running

SEEN = """sort seen(symbol in text, x_m in m, y_m in m, sd_m in m, colour in text, end in bool)
source seen camera
strmgen seen = camera
source number levels
strmgen level = levels
"""
WORLD = (
    "strmgen world = link(seen, WorldObject, eventually[1s, oo] true, eventually[0, 1s] xy_dist[from, to] < 4, true)\n"
)
STEP_MS = 100


class Watching(Running):
    """What a camera sees at ten samples a second: cars by the name of their percept, each at a place of its own."""

    def watch(
        self, text: str, until_ms: int, places, level=lambda _t_ms: 0.0, colour=lambda _name, _t_ms: "red"
    ) -> None:
        if text:
            self.add(text)
        for t in range(0, until_ms, STEP_MS):
            self.wait(t * 1000)
            with self.network.instant.whole():
                if (now := level(t)) is not None:
                    self.push("levels", now, t * 1000)
                for name, place in places.items():
                    if (at := place(t)) is not None:
                        self.push("camera", (name, *at, 0.3, colour(name, t), False), t * 1000)

    def begins_ms(self, name: str) -> float:
        """When a stream has its first sample."""
        return next(sample.valid_us for each, sample in self.outputs if each == name) / 1000

    @property
    def linkage(self):
        """That of the declarations that are chained."""
        return self.network.process(Label("cars")).linkage

    def symbols(self, name: str) -> set[str]:
        return {value[0] for value in self.values(name)}


def driving(y_m, until_ms=10**9):
    return lambda t_ms: (0.01 * t_ms, y_m) if t_ms < until_ms else None


def link(condition: str, reestablish: str = "false", maintain: str = "true") -> str:
    return f"strmgen cars = link(world, SameState, {condition}, {reestablish}, {maintain})\nstream out = cars\n"


def test_an_object_is_established_by_a_stream() -> None:
    running = Watching(SEEN + WORLD)
    running.watch(link("eventually level > 5"), 6000, {"a": driving(0.0)}, lambda t: 10.0 if t >= 4000 else 1.0)
    assert running.begins_ms("out") == 4000


def test_a_link_ends_by_a_stream() -> None:
    running = Watching(SEEN + WORLD)
    text = link("eventually level > 5", maintain="always level < 20")
    running.watch(text, 8000, {"a": driving(0.0)}, lambda t: 10.0 if t < 5000 else 30.0)
    kinds = [(event.kind, event.valid_us / 1000) for event in running.linkage.recent if event.target_type == "cars"]
    assert kinds[:2] == [("established", 1000), ("unlinked", 5000)]


def test_a_stream_that_is_silent_holds_no_longer() -> None:
    running = Watching(SEEN + WORLD)
    cars = {"a": driving(0.0), "b": lambda t: driving(20.0)(t) if t >= 3000 else None}
    running.watch(link("eventually level > 5"), 8000, cars, lambda t: 10.0 if t < 1500 else None)
    assert running.symbols("out") == {"co1"}, "b was seen when the level was not known any more"


def test_an_object_is_established_by_a_chronicle_that_is_recognised_of_it() -> None:
    turned = "attribute world.colour[?c]\nchronicle turned[?c] {\n  event(world.colour[?c]:(red, blue), t1)\n}\n"
    running = Watching(SEEN + WORLD)
    text = SourceText(link("eventually occurred(chronicle[turned, from])") + 'chronicle file "turned.chr"\n', "a.kpl")
    running.instance.add(parse_specification(text, lambda _path: turned), 0, text)
    cars = {"a": driving(0.0), "b": driving(20.0)}
    running.watch("", 9000, cars, colour=lambda name, t: "blue" if name == "b" and t >= 4000 else "red")
    assert running.symbols("out") == {"co1"}
    assert running.values("out")[0][2] == pytest.approx(20.0, abs=0.5)
    assert 4000 < running.begins_ms("out") < 6000


def test_a_quantifier_ranges_over_the_objects_of_the_linkage_and_leaves_out_the_one_itself() -> None:
    running = Watching(SEEN + WORLD)
    cars = {"a": driving(0.0), "b": driving(3.0), "c": driving(40.0)}
    running.watch(link("eventually[1s, oo] forall o in world - {from}: xy_dist[o, from] > 10"), 5000, cars)
    assert running.symbols("out") == {"co1"}
    assert running.values("out")[0][2] == pytest.approx(40.0, abs=0.5)


def test_a_quantifier_compares_attributes_of_other_objects() -> None:
    running = Watching(SEEN + WORLD)
    cars = {"a": driving(0.0), "b": driving(9.0), "c": driving(40.0)}
    text = link("eventually[1s, oo] exists o in world - {from}: colour[o] = colour[from]")
    running.watch(text, 5000, cars, colour=lambda name, _t: "blue" if name == "c" else "red")
    assert sorted(round(value[2]) for value in running.values("out")[-2:]) == [0, 9]


def test_a_distance_from_the_own_vehicle_is_derived_of_both() -> None:
    running = Watching()
    position = Sort("position", (Field("latitude_deg", "deg"), Field("longitude_deg", "deg")))
    own = running.network.add_source(Label("heli-position", ("7",)), position)
    running.add(f"define ORIGIN_LATITUDE_DEG = 58.0\ndefine ORIGIN_LONGITUDE_DEG = 15.0\n{SEEN}{WORLD}")
    cars = {"a": driving(0.0), "b": driving(200.0)}

    def level(t_ms: int) -> float:
        own.push(Sample(t_ms * 1000, t_ms * 1000, (58.0, 15.0)))
        return 0.0

    running.watch(link("eventually[1s, oo] always[0, 1s] xy_dist[self, from] < 100"), 6000, cars, level)
    assert running.symbols("out") == {"co1"}
    assert running.values("out")[0][2] == pytest.approx(0.0, abs=0.5)


def test_a_stream_of_each_object_is_read_by_its_symbol() -> None:
    running = Watching(f"{SEEN}{WORLD}source number risks\nstrmgen risk[wo2] = risks\n")

    def level(t_ms: int) -> float:
        running.push("risks", 9.0 if t_ms >= 3000 else 0.0, t_ms * 1000)
        return 0.0

    running.watch(link("eventually risk[from] > 5"), 5000, {"a": driving(0.0), "b": driving(30.0)}, level)
    assert running.symbols("out") == {"co1"}
    assert running.values("out")[0][2] == pytest.approx(30.0, abs=0.5)
    assert running.begins_ms("out") == 3000


@pytest.mark.parametrize(
    ("conditions", "said", "repair"),
    [
        (
            'colr[from] = "red", false, true',
            "objects of world have no colr, and no stream is called so",
            "colour[from]",
        ),
        ("eventually speed[frm] > 3, false, true", "nothing is called frm", "speed[from]"),
        ('true, colr[to] = "red", true', "objects of cars have no colr", "colour[to]"),
        ("true, false, lvel < 5", "lvel is no variable, constant, object or stream", "level"),
        ("speed[to] > 3, false, true", "a condition to establish is of `from` alone", "speed[from]"),
        ("occurred(chronicle[uturn, from]), false, true", "no chronicle is called uturn", "chronicle file"),
        ("occurred(landed[from]), false, true", "nothing makes the event landed[from]", "chronicle[NAME, from]"),
        ("forall o in wrld: speed[o] > 3, false, true", "there is no domain wrld", "world"),
        ('forall o in world: colr[o] = "red", false, true', "world are of sort world, which has no colr", "colour[o]"),
        ('colour = "red", false, true', "colour is an attribute of objects", "colour[from]"),
        ("battery[from] > 3, false, true", "objects of world have no battery", ""),
        ("z_dist[self, from] > 3, false, true", "z_dist cannot be derived of world", "sort world"),
        ("colour[from] > 3, false, true", "an object has no order", "compare with"),
        ("thresh[from] > 3, false, true", "thresh is a distance", "thresh"),
        ('seen.colour[from] = "red", false, true', "`from` is of world, not of seen", "colour[from]"),
        ("true, xydist[self, from] < 5, true", "nothing makes xydist[self, from]", ""),
    ],
)
def test_what_is_no_attribute_and_no_stream_is_refused_with_its_place(conditions, said, repair) -> None:
    text = SEEN + WORLD + f"strmgen cars = link(world, SameState, {conditions})\n"
    with pytest.raises(TextErrors) as wrong:
        Running(text)
    error = wrong.value.errors[0]
    assert said in error.message
    assert repair in error.repair
    assert (error.line, error.file) == (7, "a.kpl")
    assert error.column > 20


def test_attributes_of_the_levels_below_and_of_the_state_are_read() -> None:
    running = Watching(SEEN + WORLD)
    running.watch(
        link('colour[from] = "red" and y_m[from] > 10 and sd_m[from] < 9'),
        3000,
        {"a": driving(0.0), "b": driving(20.0)},
    )
    assert running.symbols("out") == {"co1"}


def test_what_a_condition_reads_cannot_be_taken_away() -> None:
    running = Watching(SEEN + WORLD)
    running.add(link("eventually level > 5"))
    with pytest.raises(TextErrors, match="level"):
        running.remove("strmgen level = levels")


def test_streams_are_left_when_nobody_wants_the_objects_any_more() -> None:
    running = Watching(SEEN + WORLD)
    running.watch(link("eventually level > 5"), 2000, {"a": driving(0.0)})
    process = running.network.process(Label("cars"))
    assert process._shared.taken.labels == (Label("level"),)
    running.remove("stream out = cars")
    assert process._shared.taken.labels == ()
    assert not running.network.generator(Label("level")).subscriptions
