"""Link declarations in running specifications: streams of linked objects, and formulas over them."""

import pytest

from dyknow import Label, SourcePrototype
from dyknow.model.errors import TextError
from kpl import parse_specification
from kpl.linking.declarations import constants_in, link_specifications, links_in
from kpl.linking.streams import LinkStream
from reasoning.formulas.tree import Const, walk
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
    declarations = parse_specification(text)
    (specification,) = link_specifications(links_in(declarations), constants_in(declarations))
    assert Const(8.0) in list(walk(specification.reestablish))


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
        link_specifications(links_in(parse_specification(text)), {})
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
