"""Link declarations in running specifications: streams of linked objects, and formulas over them."""

from pathlib import Path

import pytest

from dyknow import Label, SourcePrototype
from dyknow.kpl import parse_specification
from dyknow.kpl.checking.symbols import Known, SymbolTable
from dyknow.kpl.linking.declarations import link_specifications, linkage_key, links_in
from dyknow.kpl.linking.streams import LinkStream
from dyknow.kpl.syntax.statements import roads_of
from dyknow.model.errors import SourceText, TextError, TextErrors
from dyknow.navigation import LocalFrame
from dyknow.reasoning.formulas.tree import Const, walk
from tests.kpl.instances import Running

PERCEPTS = """
sort vision-object(symbol in text, x_m in m, y_m in m, colour in text, end in bool)
sort world-object(symbol in text, x_m in m, y_m in m, vx_m_s in m/s, vy_m_s in m/s, colour in text, anchored in bool, end in bool)
source vision-object camera
compunit world-object WorldObject(vision-object)
strmgen percepts = camera
"""
WORLD = """
strmgen world = link(percepts, WorldObject,
  eventually [1000, oo] true, eventually [0, 1000] xy_dist[from, to] < thresh, true)
"""
KINDS = """
compunit world-object SameState(world-object)
strmgen reds = link(world, SameState,
  eventually [0, oo] colour[from] = "red", eventually [0, 1000] (xy_dist[from, to] < thresh and colour[from] = "red"),
  always colour[from] = "red")
"""


ROADS = 'roads "examples/roads/town.geojson"\n'
ON_ROAD = """
strmgen on_road = link(world, OnRoad,
  eventually [1000, oo] always [0, 1000] on_road[from], eventually [0, 1000] xy_dist[from, to] < thresh,
  always eventually [0, 10000] always [0, 1000] on_road[from])
"""


def specifications(text, roads=None):
    """The link specifications of a text."""
    declarations = parse_specification(text, read_file)
    return link_specifications(linkage_key(links_in(declarations), SymbolTable(declarations, Known(roads=roads))))


def read_file(path):
    return Path(path).read_text("utf-8")


class Camera(Running):
    """An instance that sees one car at 10 m/s for three seconds, and again after two."""

    def drive(self, until_ms=8000, colour="red"):
        for t in range(0, until_ms, 100):
            self.wait(t * 1000)
            if t % 5000 < 3000:
                self.push("camera", (f"vp{t // 5000}", t / 100, 0.0, colour, False), t * 1000)
            elif t % 5000 == 3000:
                self.push("camera", (f"vp{t // 5000}", t / 100, 0.0, colour, True), t * 1000)


def test_the_stream_of_a_link_has_the_states_of_one_object_through_the_gap() -> None:
    camera = Camera(PERCEPTS + WORLD + "stream seen = world\n")
    camera.drive()
    samples = [sample for name, sample in camera.outputs if name == "seen"]
    assert {sample.value[0] for sample in samples} == {"wo1"}
    assert samples[0].valid_us == 1_000_000
    times = [sample.valid_us for sample in samples]
    assert times == list(range(1_000_000, 8_000_000, 100_000))
    for sample in samples:
        symbol, x_m, _, vx_m_s, *_, colour, anchored, end = sample.value
        assert x_m == pytest.approx(sample.valid_us / 1e5, abs=1.0)
        assert vx_m_s == pytest.approx(10.0, abs=1.0)
        assert (symbol, colour, end) == ("wo1", "red", False)
        assert anchored is (not 3_000_000 <= sample.valid_us < 5_000_000)
    assert not camera.faults


def test_formulas_range_over_the_objects_of_a_link() -> None:
    camera = Camera(PERCEPTS + WORLD + 'monitor blue = always forall o in world: colour[o] = "blue"\n')
    camera.drive(3000)
    camera.wait(4_000_000)
    assert [each.event for each in camera.alarms][:1] == ["opened"]


def test_links_that_are_chained_are_one_linkage_and_what_does_not_fit_is_no_object_above() -> None:
    camera = Camera(PERCEPTS + WORLD + KINDS + "stream red = reds\nstream seen = world\n")
    camera.drive()
    assert {sample.value[0] for name, sample in camera.outputs if name == "red"} == {"ro1"}
    other = Camera(PERCEPTS + WORLD + KINDS + "stream red = reds\nstream seen = world\n")
    other.drive(colour="blue")
    assert not [sample for name, sample in other.outputs if name == "red"]
    assert [sample for name, sample in other.outputs if name == "seen"]


def test_an_object_that_is_forgotten_has_a_last_state_that_says_so() -> None:
    camera = Camera(PERCEPTS + WORLD + "stream seen = world\n")
    camera.drive(3100)
    camera.wait(40_000_000)
    last = [sample for name, sample in camera.outputs if name == "seen"][-1]
    assert last.value[-1] is True
    assert 32_500_000 <= last.valid_us <= 33_500_000


def test_without_a_subscriber_nothing_is_linked() -> None:
    camera = Camera(PERCEPTS + WORLD)
    camera.drive()
    process = camera.network.process(Label("world"))
    assert isinstance(process, LinkStream)
    assert not process.running
    assert not process.linkage.objects("world")


def test_defined_constants_stand_for_their_values() -> None:
    text = PERCEPTS + "define thresh = 8.0\n" + WORLD
    (specification,) = specifications(text)
    assert Const(8.0) in list(walk(specification.reestablish))


class OnTheRoad(Running):
    """An instance that is given the files that its specification names."""

    def add(self, text):
        text = SourceText(text, "a.kpl")
        self.instance.add(parse_specification(text, read_file), self.now_us, text)

    def drive(self, y_m=-1.8, until_ms=9000):
        """A car from the west through the crossing of the town at 10 m/s, hidden from 3 s to 4 s."""
        for t in range(0, until_ms, 100):
            self.wait(t * 1000)
            if not 3000 < t <= 4000:
                self.push("camera", (f"vp{t > 4000:d}", t / 100 - 100, y_m, "red", t == 3000), t * 1000)


def test_linked_objects_are_on_the_declared_roads() -> None:
    road = OnTheRoad(PERCEPTS + WORLD + ROADS + ON_ROAD + "for c in on_road stream link = on_road.link[c]\n")
    road.drive()
    found = [(name, sample.value) for name, sample in road.outputs]
    assert next(value for name, value in found if name == "link-oo1") == "west"
    assert {name for name, _ in found} == {"link-oo1"}
    assert not road.faults


def test_what_is_off_the_roads_is_no_object_on_them() -> None:
    road = OnTheRoad(PERCEPTS + WORLD + ROADS + ON_ROAD + "stream on = on_road\nstream seen = world\n")
    road.drive(y_m=-40.0)
    assert {name for name, _ in road.outputs} == {"seen"}


def test_streams_of_one_linkage_agree_on_the_symbols_whenever_they_begin() -> None:
    road = OnTheRoad(PERCEPTS + WORLD + ROADS + ON_ROAD + "stream seen = world\n")
    road.drive(until_ms=6000)
    road.add("stream on = on_road\n")
    for t in range(6000, 7000, 100):
        road.push("camera", ("vp1", t / 100 - 100, -1.8, "red", False), t * 1000)
    assert {sample.value[0] for name, sample in road.outputs if name == "on"} == {"oo1"}
    assert {sample.value[0] for name, sample in road.outputs if name == "seen"} == {"wo1"}


def test_roads_of_the_platform_serve_where_none_are_declared_and_others_replace_them() -> None:
    roads = roads_of(read_file("examples/roads/town.geojson"), "town")
    text = PERCEPTS + WORLD + ON_ROAD + "stream on = on_road\n"
    road = OnTheRoad(text, roads=roads)
    road.drive()
    assert road.outputs
    with pytest.raises(TextError, match="OnRoad needs roads"):
        OnTheRoad(text)


def test_without_the_roads_the_links_on_them_cannot_stay() -> None:
    road = OnTheRoad(PERCEPTS + WORLD + ROADS + ON_ROAD + "stream on = on_road\n")
    with pytest.raises(TextError, match="OnRoad"):
        road.change(PERCEPTS + WORLD + ON_ROAD + "stream on = on_road\n")
    road.drive()
    assert road.outputs


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('roads "/etc/no-such-file"', "cannot be read"),
        ('roads "tests/kpl/linking/test_linking.py"', "dyknow roads check"),
        (ROADS + ROADS, "roads is declared already"),
    ],
)
def test_roads_that_are_none_are_told_with_their_place(text: str, message: str) -> None:
    with pytest.raises(TextErrors, match=message) as wrong:
        OnTheRoad(text)
    assert "a.kpl:" in str(wrong.value)


def test_positions_in_degrees_are_linked_where_it_is_known_where_the_frame_lies() -> None:
    text = (
        """
sort seen-object(symbol in text, latitude_deg in deg, longitude_deg in deg)
source seen-object camera
strmgen percepts = camera
"""
        + WORLD
        + "stream seen = world\n"
    )
    with pytest.raises(TextError, match="placed in degrees"):
        Camera(text)
    camera = Camera("define ORIGIN_LATITUDE_DEG = 58.4\ndefine ORIGIN_LONGITUDE_DEG = 15.6\n" + text)
    frame = LocalFrame(58.4, 15.6, 0.0)
    for t in range(0, 3000, 100):
        camera.push("camera", ("vp1", *frame.from_ned(0.0, t / 100, 0.0)[:2]), t * 1000)
    last = camera.outputs[-1][1].value
    names = [field.name for field in camera.network.generator(Label("world")).sort.fields]
    record = dict(zip(names, last, strict=True))
    assert record["x_m"] == pytest.approx(29.0, abs=1.0)
    assert record["longitude_deg"] == pytest.approx(frame.from_ned(0.0, 29.0, 0.0)[1], abs=2e-5)


def test_a_place_that_cannot_be_is_no_percept() -> None:
    camera = Camera(PERCEPTS + WORLD + "stream seen = world\n")
    for t, x_m in enumerate([float("nan"), float("inf"), 1e300, -1e300] * 6):
        camera.push("camera", ("vp1", x_m, 0.0, "red", False), t * 100_000)
    assert not [each for each in camera.outputs if each[0] == "seen"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (WORLD.replace("WorldObject", "WorldObjekt"), "WorldObject"),
        (WORLD.replace("WorldObject", "OnRoad"), "needs roads"),
        (
            "strmgen a = link(b, SameState, true, true, true)\nstrmgen b = link(a, SameState, true, true, true)\n",
            "themselves",
        ),
    ],
)
def test_what_cannot_be_linked_is_told_with_its_place(text: str, message: str) -> None:
    with pytest.raises(TextError, match=message) as wrong:
        specifications(text)
    assert wrong.value.repair


def test_a_stream_that_is_none_of_percepts_is_refused() -> None:
    with pytest.raises(TextError, match="makes no percepts"):
        Running("source number n\ncompunit w WorldObject(number)\nstrmgen percepts = n\n" + WORLD)


def test_a_stream_of_the_unit_itself_is_linked_and_so_is_one_that_goes_by_a_semantic_label() -> None:
    text = (
        (PERCEPTS + WORLD)
        .replace("percepts = camera", "percepts[self] = camera")
        .replace("link(percepts,", "link(percepts[self],")
    )
    camera = Camera(text + "stream seen = world\n")
    camera.drive(2000)
    assert {sample.value[0] for name, sample in camera.outputs if name == "seen"} == {"wo1"}


def test_the_percepts_of_one_image_that_a_source_reads_at_once_are_one_tick() -> None:
    def images(from_us):
        for number in range(30):
            at_us = from_us + 100_000 * number
            yield at_us, [(f"vp{each}", 10.0 * number / 10.0, 100.0 * each, "red", False) for each in range(3)]

    camera = Camera(prototypes=(SourcePrototype("camera", "vision-object", images),))
    camera.add(PERCEPTS + WORLD + "stream seen = world\n")
    for at_ms in range(0, 2500, 50):
        camera.wait(at_ms * 1000)
    seen = [sample for name, sample in camera.outputs if name == "seen"]
    assert {sample.value[0] for sample in seen} == {"wo1", "wo2", "wo3"}
    assert not camera.faults
