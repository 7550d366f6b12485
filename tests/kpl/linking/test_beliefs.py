"""Beliefs in running specifications: an environment model as a stream, whose instances formulas and policies know."""

from pathlib import Path

import pytest

from dyknow import Label, Sample
from dyknow.anchoring.belief.live.records import BELIEF_SORT
from dyknow.kpl import parse_specification, print_specification
from dyknow.kpl.linking.beliefs import BeliefStream
from dyknow.model.errors import SourceText, TextError, TextErrors
from tests.kpl.instances import Running

WATCHED = """
sort percept(symbol in text, x_m in m, y_m in m, sd_m in m, colour in text, end in bool)
sort view(x1_m in m, y1_m in m, x2_m in m, y2_m in m, x3_m in m, y3_m in m, x4_m in m, y4_m in m)
source percept camera
source view looked
strmgen percepts = camera
strmgen views = looked
"""
BELIEFS = 'strmgen beliefs = believe("examples/world/yard.toml", percepts as camera in views)\n'
WHOLE = (-50.0, -50.0, 50.0, -50.0, 50.0, 50.0, -50.0, 50.0)
EAST = (10.0, -50.0, 50.0, -50.0, 50.0, 50.0, 10.0, 50.0)


def read_file(path: str) -> str:
    return Path(path).read_text("utf-8")


class Looking(Running):
    """An instance with a camera."""

    def add(self, text):
        text = SourceText(text, "a.kpl")
        self.instance.add(parse_specification(text, read_file), self.now_us, text)

    def change(self, text):
        text = SourceText(text, "a.kpl")
        self.instance.change(parse_specification(text, read_file), self.now_us, text)

    def look(self, *places, view=WHOLE, sd_m=0.5):
        at_us = self.now_us + 100_000
        self.wait(at_us)
        self.network.now_us = at_us
        with self.network.instant.whole():
            self.instance.push("looked", Sample(at_us, at_us, view))
            for number, (x_m, y_m) in enumerate(places):
                self.instance.push("camera", Sample(at_us, at_us, (f"vp{number}", x_m, y_m, sd_m, "red", False)))

    @property
    def beliefs(self):
        return [(sample.value, sample.quality) for name, sample in self.outputs if name == "seen"]


def test_instances_are_states_of_objects_as_certain_as_they_exist() -> None:
    looking = Looking(WATCHED + BELIEFS + "stream seen = beliefs\n")
    for k in range(10):
        looking.look((k * 0.2, 0.0))
    value, quality = looking.beliefs[-1]
    symbol, existence, status, type_, types, x_m, *_ = value
    assert (symbol, status, type_, types) == ("i7_1", "confirmed", "car", "car 0.60, pedestrian 0.40")
    assert quality.certainty == existence > 0.99
    assert x_m == pytest.approx(1.8, abs=0.3)
    assert not looking.faults


def test_not_seeing_what_is_in_view_ends_an_instance_and_not_looking_there_does_not() -> None:
    looking = Looking(WATCHED + BELIEFS + "stream seen = beliefs\n")
    for _ in range(10):
        looking.look((0.0, 0.0))
    for _ in range(10):
        looking.look(view=EAST)
    assert looking.beliefs[-1][0][1] > 0.9
    for _ in range(10):
        looking.look()
    assert looking.beliefs[-1][0][-1] is True


def test_existence_is_a_fluent_of_formulas_and_min_certainty_leaves_out_what_hardly_exists() -> None:
    looking = Looking(
        WATCHED + BELIEFS + "monitor sure = always forall b in beliefs: existence[b] > 0.9\n"
        "stream seen = beliefs\nstream certain = beliefs with min certainty 0.9\n"
    )
    for _ in range(5):
        looking.look((0.0, 0.0))
    for _ in range(10):
        looking.look()
    assert [each.event for each in looking.alarms][:2] == ["opened", "closed"]
    certain = [sample.quality.certainty for name, sample in looking.outputs if name == "certain"]
    assert certain
    assert min(certain) >= 0.9
    assert len(certain) < len(looking.beliefs)


def test_a_declared_sort_chooses_the_fields_and_may_ask_for_the_probability_of_a_type() -> None:
    text = "sort beliefs(symbol in text, existence in fraction, p_car in fraction, end in bool)\n"
    looking = Looking(WATCHED + text + BELIEFS + "stream seen = beliefs\nmonitor cars = always p_car[i7_1] > 0.7\n")
    for _ in range(5):
        looking.look((0.0, 0.0))
    assert looking.beliefs[-1][0][2] == pytest.approx(0.6)
    assert [each.event for each in looking.alarms] == ["opened"]


def test_what_is_declared_is_printed_as_it_is_read_and_the_text_of_the_model_distinguishes_declarations() -> None:
    made = (
        'believe("examples/world/yard.toml", "examples/world/knowledge.toml", percepts as camera in views trust 0.7, '
        'others as camera for "search")'
    )
    (one,) = parse_specification(f"strmgen b = {made}\n")
    assert print_specification([one]) == f"strmgen b = {made}\n"
    texts = {"examples/world/yard.toml": read_file("examples/world/yard.toml")}
    (first,) = parse_specification(BELIEFS, texts.__getitem__)
    texts["examples/world/yard.toml"] += "\n# another\n"
    (second,) = parse_specification(BELIEFS, texts.__getitem__)
    assert first != second


def test_without_a_subscriber_nothing_is_believed() -> None:
    looking = Looking(WATCHED + BELIEFS)
    looking.look((0.0, 0.0))
    process = looking.network.process(Label("beliefs"))
    assert isinstance(process, BeliefStream)
    assert not process.running
    assert not process.watch.environment.table.names


LINKED = """
strmgen cars = link(percepts, WorldObject,
  eventually [1000, oo] true, eventually [0, 1000] xy_dist[from, to] < 20, true){with_}
stream cars_seen = cars
"""


def linked_to(text: str) -> str:
    """Which known car a red percept is taken for that appears near where a blue one was expected."""
    looking = Looking(WATCHED + BELIEFS + text)
    at_us = 0
    for at_us in range(0, 3_000_000, 100_000):
        looking.network.now_us = at_us
        with looking.network.instant.whole():
            for name, x_m, colour in (("vp0", 0.0, "red"), ("vp1", 12.0, "blue")):
                ended = at_us == 2_900_000
                looking.instance.push("camera", Sample(at_us, at_us, (name, x_m, 0.0, 0.5, colour, ended)))
    for at_us in range(4_000_000, 4_500_000, 100_000):
        looking.wait(at_us)
        looking.network.now_us = at_us
        looking.instance.push("camera", Sample(at_us, at_us, ("vp2", 6.1, 0.0, 0.5, "red", False)))
    return next(s.value[0] for n, s in reversed(looking.outputs) if n == "cars_seen" and s.value[-2] is True)


def test_association_probabilities_of_the_world_model_weigh_which_known_object_a_percept_is() -> None:
    sort = "sort car(symbol in text, x_m in m, y_m in m, colour in text, anchored in bool, end in bool)\n"
    unit = "compunit car WorldObject(percept)\n"
    assert linked_to(sort + unit + LINKED.format(with_="")) == "co2"
    assert linked_to(sort + unit + LINKED.format(with_=" with weigh beliefs")) == "co1"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('strmgen b = believe("/etc/no-such-file", percepts as camera)', "cannot be read"),
        ('strmgen b = believe("examples/kpl-none.toml", percepts as camera)', "cannot be read"),
        ('strmgen b = believe("examples/world/knowledge.toml", percepts as camera)', "unknown key|no sensors"),
        ('strmgen b = believe("examples/world/yard.toml", "examples/world/yard.toml", percepts as camera)', "unknown key"),
        ('strmgen b = believe("examples/world/yard.toml", percepts as lidar)', "has no sensor lidar"),
        ('strmgen b = believe("examples/world/yard.toml", views as camera)', "makes no percepts"),
        ('strmgen b = believe("examples/world/yard.toml", percepts as camera trust 1.5)', "trust is from 0"),
        ('strmgen b = believe("examples/world/yard.toml", nothing as camera)', "nothing"),
        ("strmgen c = link(percepts, WorldObject, true, true, true) with weigh views", "no stream of beliefs"),
    ],
)  # fmt: skip
def test_what_cannot_be_believed_is_refused_with_its_place(text: str, message: str) -> None:
    with pytest.raises((TextError, TextErrors), match=message):
        Looking(WATCHED + text + "\n")


def test_an_impossible_model_is_refused_in_its_own_file() -> None:
    text = read_file("examples/world/yard.toml").replace("births = 0.3", "births = 0.003")
    with pytest.raises(TextErrors, match="no instance could ever be created") as wrong:
        parse_specification(BELIEFS, lambda _path: text)
    assert "examples/world/yard.toml:36" in str(wrong.value)


@pytest.mark.parametrize("bad", [1e9, -1e9])
def test_far_positions_are_left_out_and_counted_and_what_is_believed_stays(bad: float) -> None:
    looking = Looking(WATCHED + BELIEFS + "stream seen = beliefs\n")
    for _ in range(5):
        looking.look((0.0, 0.0))
    for _ in range(8):
        looking.look((0.0, 0.0), (bad, 0.0))
    assert {value[0] for value, _ in looking.beliefs} == {"i7_1"}
    assert ("beliefs", "percepts of percepts without a place that can be: 1") in looking.faults
    assert len(looking.faults) < 6


def test_a_frame_of_ten_thousand_percepts_is_cut_and_the_rest_counted() -> None:
    looking = Looking(WATCHED + BELIEFS + "stream seen = beliefs\n")
    for _ in range(5):
        looking.look((0.0, 0.0))
    looking.look((0.0, 0.0), *(((k * 37) % 1000 / 10.0 - 50.0, (k * 91) % 1000 / 10.0 - 50.0) for k in range(10_000)))
    assert any("beyond the most of one time" in fault for _, fault in looking.faults)
    for _ in range(3):
        looking.look((0.0, 0.0))
    assert looking.network.process(Label("beliefs")).watch.environment.table.rows()["i7_1"] == 0


def placed(path: str) -> str:
    return read_file(path) + "\n[origin]\nlatitude_deg = 58.4\nlongitude_deg = 15.6\n"


class Placed(Looking):
    """The same with a model that says where on earth it is."""

    def add(self, text):
        text = SourceText(text, "a.kpl")
        self.instance.add(parse_specification(text, placed), self.now_us, text)


PLACED = WATCHED.replace("x_m in m, y_m in m, sd_m", "latitude_deg in deg, longitude_deg in deg, sd_m", 1)


def test_a_model_that_is_placed_takes_percepts_in_degrees() -> None:
    looking = Placed(PLACED + BELIEFS + "stream seen = beliefs\n")
    for _ in range(10):
        looking.look((58.4001, 15.6))
    names = [field.name for field in BELIEF_SORT.fields]
    where = dict(zip(names, looking.beliefs[-1][0], strict=True))
    assert (where["x_m"], where["y_m"]) == pytest.approx((0.0, 11.1), abs=0.3)


def test_an_origin_of_the_model_that_is_another_than_that_of_the_specification_is_refused() -> None:
    define = "define ORIGIN_LATITUDE_DEG = 58.4\ndefine ORIGIN_LONGITUDE_DEG = {}\n"
    Placed(define.format(15.6) + PLACED + BELIEFS + "stream seen = beliefs\n")
    with pytest.raises(TextError, match=r"\[origin\] of examples/world/yard.toml is 5847.2 m from"):
        Placed(define.format(15.7) + PLACED + BELIEFS + "stream seen = beliefs\n")
