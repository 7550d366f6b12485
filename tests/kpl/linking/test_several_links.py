"""Several links into one type, and links that exclude each other, as specifications say them."""

import math
import random

import pytest

from dyknow import Label
from dyknow.kpl.introspection.graph import graph_of
from dyknow.kpl.introspection.link_reasons import because
from dyknow.kpl.syntax.listing import print_specification
from dyknow.model.errors import TextErrors
from tests.kpl.instances import Running

NEW, NEAR = "eventually [1000, oo] true", "eventually [0, 1000] xy_dist[from, to] < thresh"
SENSORS = {"camera": (100, 1.5), "radar": (250, 2.0)}
"""Period in milliseconds, standard deviation in metres."""


def links_of(*sensors: str, options: str = "", unit: str = "WorldObject") -> str:
    declared = "sort sighting(symbol in text, x_m in m, y_m in m, sd_m in m, end in bool)\n"
    for each in sensors:
        declared += f"source sighting {each}\nstrmgen {each}_seen = {each}\n"
        declared += f"strmgen world = link({each}_seen, {unit}, {NEW}, {NEAR}, true){options}\n"
    return declared + "stream seen = world\n"


class Sky(Running):
    """One thing, seen by sensors of other rates, errors and gaps."""

    def watch(self, seed: int, sensors: tuple[str, ...], until_ms: int = 60_000) -> None:
        noise = {each: random.Random(f"{seed} {each}") for each in SENSORS}
        for t in range(0, until_ms, 50):
            self.wait(t * 1000)
            for each, (period_ms, sd_m) in SENSORS.items():
                x_m, y_m = (value + noise[each].gauss(0, sd_m) for value in place(t))
                window = (t // 1000 + (3 if each == "radar" else 0)) % 8
                if each in sensors and t % period_ms == 0 and window < 6:
                    self.push(each, (f"{each}{t // 8000}", x_m, y_m, sd_m, False), t * 1000)

    def error_m(self) -> float:
        """Root mean square of the error of the position, also where it is predicted."""
        samples = [sample for name, sample in self.outputs if name == "seen"]
        assert {sample.value[0] for sample in samples} == {"wo1"}, "no symbol twice"
        squares = [
            math.dist(place(sample.valid_us / 1000), sample.value[1:3]) ** 2
            for sample in samples
            if sample.valid_us > 3_000_000 and sample.valid_us % 500_000 == 0
        ]
        return math.sqrt(sum(squares) / len(squares))


def place(t_ms: float) -> tuple[float, float]:
    return 9.0 * t_ms / 1000, 15.0 * math.sin(t_ms / 5000)


@pytest.mark.parametrize("options", ["", " with errors correlated"])
def test_two_sensors_of_other_rate_noise_and_gaps_err_less_than_either_and_no_symbol_comes_twice(options) -> None:
    errors = []
    for sensors in (("camera", "radar"), ("camera",), ("radar",)):
        total = 0.0
        for seed in range(2):
            sky = Sky(links_of(*sensors, options=options))
            sky.watch(seed, sensors)
            assert not sky.faults
            total += sky.error_m()
        errors.append(total)
    both, camera, radar = errors
    assert both < camera
    assert both < radar


def test_units_that_are_no_filters_are_weighed_by_covariance_too() -> None:
    both, camera = (Sky(links_of(*each, unit="SameState")) for each in (("camera", "radar"), ("camera",)))
    both.watch(1, ("camera", "radar"), 20_000)
    camera.watch(1, ("camera",), 20_000)
    assert both.error_m() < camera.error_m()


def test_an_object_stays_anchored_while_one_link_remains_and_the_graph_says_which() -> None:
    sky = Sky(links_of("camera", "radar"))
    for t in range(0, 2000, 100):
        sky.push("camera", ("c1", 0.0, 0.0, 1.0, False), t * 1000)
        sky.push("radar", ("r1", 0.0, 0.0, 1.0, False), t * 1000)
    linkage = sky.network.process(Label("world")).linkage
    sky.push("camera", ("c1", 0.0, 0.0, 1.0, True), 2_000_000)
    sky.push("radar", ("r1", 0.0, 0.0, 1.0, False), 2_000_000)
    sky.wait(2_050_000)
    assert linkage.anchored("wo1")
    (node,) = (each for each in graph_of(sky.instance).nodes if each.name == "world")
    assert node.note == (
        "camera_seen -> world by WorldObject: 0 linked",
        "radar_seen -> world by WorldObject: 1 linked",
    )
    sky.push("radar", ("r1", 0.0, 0.0, 1.0, True), 2_100_000)
    sky.wait(2_150_000)
    assert not linkage.anchored("wo1")


def test_links_into_one_type_come_and_go_while_it_is_wanted() -> None:
    sky = Sky(links_of("camera"))
    (radar,) = (line for line in links_of("camera", "radar").splitlines() if "link(radar_seen" in line)
    sky.add("source sighting radar\nstrmgen radar_seen = radar\n" + radar)
    sky.watch(1, ("camera", "radar"), 3000)
    linkage = sky.network.process(Label("world")).linkage
    assert {one.source.type for one in linkage.find("wo1").incoming.values()} == {"camera_seen", "radar_seen"}
    (camera,) = (line for line in links_of("camera").splitlines() if "link(" in line)
    text = print_specification(sky.instance.specification)
    sky.remove(camera)
    for t in range(3000, 6000, 250):
        sky.push("radar", ("r2", 100.0, 0.0, 1.0, False), t * 1000)
    assert set(sky.network.process(Label("world")).linkage.objects("camera_seen")) == set()
    assert sky.network.process(Label("world")).linkage.find("r2") is not None
    sky.change(text)
    assert print_specification(sky.instance.specification) == text
    assert not sky.faults


def test_the_same_link_twice_and_a_stream_of_another_kind_under_its_name_are_refused() -> None:
    with pytest.raises(TextErrors, match="world is a generator already"):
        Sky(links_of("camera") + f"strmgen world = link(camera_seen, WorldObject, {NEW}, {NEAR}, true)\n")
    with pytest.raises(TextErrors, match="world is a generator already"):
        Sky(links_of("camera") + "strmgen world = camera\n")


KINDS = """
sort sighting(symbol in text, x_m in m, y_m in m, sd_m in m, length_m in m, end in bool)
source sighting camera
strmgen seen = camera
strmgen world = link(seen, WorldObject, eventually [1000, oo] true, eventually [0, 1000] xy_dist[from, to] < thresh, true)
""" + "".join(
    f"""
strmgen {name} = link(world, SameState,
  eventually [500, oo] always [0, 500] ({fits}),
  eventually [0, 1000] (xy_dist[from, to] < thresh and always [0, 400] ({fits})),
  always eventually [0, 1000] always [0, 400] ({fits})) with exclusive kind
stream {name}s = {name}
"""
    for name, fits in (("car", "length_m[from] < 7"), ("truck", "length_m[from] >= 7"))
)
SEEDS = [*range(20), *(pytest.param(seed, marks=pytest.mark.full) for seed in range(20, 200))]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_car_that_turns_out_to_be_a_truck_keeps_its_world_symbol_and_is_never_both(seed) -> None:
    rng = random.Random(seed)
    road = Running(KINDS)
    lengths = {"car": rng.uniform(3, 6), "truck": rng.uniform(8, 15)}
    first, second = ("car", "truck") if seed % 2 else ("truck", "car")
    change_ms = rng.randrange(4000, 5000, 100)
    linkage = None
    for t in range(0, 9000, 100):
        now = first if t < change_ms else second
        length_m = lengths[now] if rng.random() >= 0.03 or t > 7000 else sum(lengths.values()) - lengths[now]
        road.push("camera", ("vp1", 0.1 * t, rng.gauss(0, 0.2), 0.3, length_m, False), t * 1000)
        linkage = road.network.process(Label("world")).linkage
        for one in linkage.objects("world").values():
            assert len(one.outgoing) <= 1, "car and truck exclude each other"
    assert set(linkage.objects("world")) == {"wo1"}
    (link,) = linkage.find("wo1").outgoing.values()
    assert link.target.type == second
    history = linkage.explain("wo1")
    changes = [each for each in history if each.kind == "reclassified"]
    assert changes[-1].target_type == second
    assert all("length_m[wo1]" in because(each.reason) or "length_m[from]" in because(each.reason) for each in changes)
    assert all(each.reason.explanations for each in history if each.kind == "unlinked"), "with the samples that decided"
    assert {name for name, _ in road.outputs} == {"cars", "trucks"}
    assert not road.faults
