"""Composites, learnt motion, sensors that are late and candidates, as specifications say them."""

import math
import random

import pytest

from dyknow import Label, Sample
from dyknow.kpl.introspection.graph import graph_of
from dyknow.model.errors import TextError, TextErrors
from tests.kpl.instances import Running
from tests.kpl.linking.test_several_links import NEAR, NEW, Sky, links_of

PERCEPTS = """
sort sighting(symbol in text, x_m in m, y_m in m, sd_m in m, end in bool)
source sighting camera
strmgen seen = camera
"""
CARS = f"strmgen cars = link(seen, WorldObject, {NEW}, {NEAR}, true)\n"
CONVOYS = """strmgen convoys = composite(cars,
  always [0, 2s] (xy_dist[from, to] < 30 and abs(speed[from] - speed[to]) < 3),
  always eventually [0, 2s] xy_dist[from, to] < 40)
"""


class Road(Running):
    """Cars on one line, by where each is at second 0 and how fast."""

    def drive(self, from_ms: int, to_ms: int, **cars: tuple[float, float]) -> None:
        for t in range(from_ms, to_ms, 200):
            self.wait(t * 1000)
            with self.network.instant.whole():
                for name, (x_m, speed) in cars.items():
                    self.push("camera", (name, x_m + speed * t / 1000, 0.0, 0.3, False), t * 1000)


def test_a_convoy_is_a_stream_of_objects_that_formulas_range_over() -> None:
    more = "stream there = convoys\nstream names = convoys.objects\nmonitor short = always forall c in convoys: count[c] >= 3\n"
    road = Road(PERCEPTS + CARS + CONVOYS + more)
    cars = {"a": (0.0, 10.0), "b": (20.0, 10.0), "c": (40.0, 10.0)}
    road.drive(0, 6000, **cars, d=(500.0, 10.0))
    names = [field.name for field in road.network.generator(Label("convoys")).sort.fields]
    last = dict(zip(names, road.values("there")[-1], strict=True))
    assert (last["symbol"], last["parts"], last["count"]) == ("convoys1", "co1 co2 co3", 3)
    assert last["anchored"] is True
    assert last["x_m"] == pytest.approx(78.0, abs=2.0)
    assert not road.alarms
    road.drive(6000, 16_000, **{**cars, "c": (100.0, 0.0)})
    assert road.values("there")[-1][names.index("parts")] == "co1 co2"
    assert [each.event for each in road.alarms][:1] == ["opened"]
    linkage = road.network.process(Label("convoys")).linkage
    assert {each.kind for each in linkage.explain("convoys1")} == {"established", "unlinked"}
    (node,) = (each for each in graph_of(road.instance).nodes if each.name == "convoys")
    assert node.note == ("cars -> convoys: 1 composites",)
    road.wait(90_000_000)
    assert road.values("there")[-1][names.index("end")] is True, "forgotten with its parts"
    assert not road.faults


def test_a_convoy_is_linked_on_and_looked_for() -> None:
    more = f"""strmgen columns = link(convoys, SameState, {NEW}, {NEAR}, true)
want guests in convoys = count[guests] = 3
stream there = columns
stream named = convoys.objects
"""
    road = Road(PERCEPTS + CARS + CONVOYS + more)
    road.drive(0, 8000, a=(0.0, 10.0), b=(20.0, 10.0), c=(40.0, 10.0))
    names = [field.name for field in road.network.generator(Label("columns")).sort.fields]
    last = dict(zip(names, road.values("there")[-1], strict=True))
    assert (last["parts"], last["count"], last["anchored"]) == ("cars_1 cars_2 cars_3", 3, True)
    assert list(road.network.process(Label("convoys")).linkage.objects("convoys")) == ["guests"]
    assert not road.faults


def test_least_parts() -> None:
    road = Road(PERCEPTS + CARS + CONVOYS.rstrip() + " with least 3\nstream there = convoys\n")
    road.drive(0, 6000, a=(0.0, 10.0), b=(20.0, 10.0))
    assert not road.values("there")
    road.drive(6000, 12_000, a=(0.0, 10.0), b=(20.0, 10.0), c=(40.0, 10.0))
    assert road.values("there")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("strmgen convoys = composite(cars, speed[from] < 3, true)\n", "implies no distance"),
        (CONVOYS + "want mine in convoys = colour[mine] = 3\n", "objects of convoys have no colour; they have .*count"),
        (CONVOYS + f"strmgen convoys = link(cars, SameState, {NEW}, {NEAR}, true)\n", "convoys is a generator already"),
        ("strmgen convoys = composite(convoys, xy_dist[from, to] < 3, true)\n", "a cycle: convoys <- convoys"),
        (CONVOYS.rstrip() + " with least 1\n", "least is a number from 2"),
        (CONVOYS.rstrip() + " with score distance\n", "no option score"),
    ],
)
def test_composites_that_cannot_be_are_refused_with_their_place(text, message) -> None:
    with pytest.raises((TextError, TextErrors), match=message) as wrong:
        Road(PERCEPTS + CARS + text)
    assert "a.kpl:" in str(wrong.value)


def moody(seed: int) -> list[tuple[float, float]]:
    """A minute and a gap of one driver whose speed goes up and down about a mean: (x_m, y_m) ten times a second."""
    rng = random.Random(seed)
    mean, speed, x_m, found = rng.uniform(8, 14), 10.0, 0.0, []
    for _ in range(700):
        speed += 0.1 * (mean - speed) * 0.4 + rng.gauss(0, 0.8) * math.sqrt(0.1)
        x_m += 0.1 * speed
        found.append((x_m, 0.0))
    return found


def error_after_gap_m(places: list[tuple[float, float]], options: str) -> float:
    """Of the prediction after 4 s in which nothing is seen."""
    road = Running(
        PERCEPTS.replace("sd_m in m,", "sd_m in m, vx_m_s in m/s, vy_m_s in m/s,")
        + CARS.rstrip()
        + options
        + "\nstream there = cars\n"
    )
    for number in range(600):
        x_m, y_m = places[number]
        speed = 10 * (x_m - places[number - 1][0]) if number else 10.0
        road.push("camera", ("vp", x_m, y_m, 0.3, speed, 0.0, number == 599), number * 100_000)
    road.wait(64_000_000)
    last = [sample for _, sample in road.outputs if sample.valid_us <= 63_900_000][-1]
    assert last.valid_us >= 63_500_000
    return math.dist(last.value[1:3], places[last.valid_us // 100_000])


def test_what_was_learnt_of_the_individual_predicts_it_better_than_what_holds_for_all() -> None:
    drives = [moody(seed) for seed in range(6)]
    general, own = (
        sum(error_after_gap_m(each, f" with predict {model}") for each in drives)
        for model in ("velocity", "individual")
    )
    assert own < 0.95 * general


def test_a_sensor_that_is_late_is_waited_for() -> None:
    sky = Sky(links_of("camera", "radar"))
    late: list[tuple[int, str, float]] = []
    for t in range(0, 6000, 100):
        late += [(t + 30, "camera", t / 100), *([(t + 300, "radar", t / 100)] if t % 300 == 0 else [])]
    for now_ms, name, x_m in sorted(late):
        sky.wait(now_ms * 1000)
        sky.network.now_us = now_ms * 1000
        valid_us = round(x_m * 100) * 1000
        sky.instance.push(name, Sample(now_ms * 1000, valid_us, (name, x_m, 0.0, 1.0, False)))
    linkage = sky.network.process(Label("world")).linkage
    assert {link.source.type for link in linkage.find("wo1").incoming.values()} == {"camera_seen", "radar_seen"}
    assert len(linkage.objects("world")) == 1
    assert len(sky.faults) <= 2, "until it is known how late it is"


def test_a_state_from_the_future_is_left_out_and_told() -> None:
    sky = Sky(links_of("camera"))
    for t in range(0, 3000, 100):
        sky.push("camera", ("vp1", 0.0, 0.0, 1.0, False), t * 1000)
        if t == 500:
            sky.instance.push("camera", Sample(t * 1000, 10**12, ("vp1", 0.0, 0.0, 1.0, False)))
    assert [said for _, said in sky.faults] == ["a state of vp1 has a valid time later than now, and is left out"]
    assert sky.values("seen")


def test_while_a_percept_may_be_several_objects_its_samples_say_how_certain_they_are() -> None:
    sky = Sky(links_of("camera", options=" with candidates 3"))
    for t in range(0, 8000, 100):
        if t < 2000:
            shown = {"a": -3.0, "b": 3.0}
        elif t > 2500:
            shown = {"c": 0.2}
        else:
            shown = {}
        sky.wait(t * 1000)
        with sky.network.instant.whole():
            for name, y_m in shown.items():
                sky.push("camera", (name, t / 100, y_m, 1.0, False), t * 1000)
        with sky.network.instant.whole():
            for name in ("a", "b") if t == 2000 else ():
                sky.push("camera", (name, 0.0, 0.0, 1.0, True), t * 1000)
    certainties = {sample.quality.certainty for name, sample in sky.outputs if name == "seen"}
    assert any(0.3 < each < 1.0 for each in certainties)
    (node,) = (each for each in graph_of(sky.instance).nodes if each.name == "world")
    assert node.note[0].startswith("camera_seen -> world by WorldObject with candidates 3: 1 linked")
    assert not sky.faults


def test_pairs_beyond_what_is_looked_at_are_counted(monkeypatch) -> None:
    monkeypatch.setattr("dyknow.anchoring.links.composites.MOST_PAIRS", 2)
    road = Road(PERCEPTS + CARS + CONVOYS + "stream there = convoys\n")
    road.drive(0, 6000, **{name: (4.0 * at, 10.0) for at, name in enumerate("abcdef")})
    (node,) = (each for each in graph_of(road.instance).nodes if each.name == "convoys")
    assert node.note[1] == "13 pairs of parts were left out, there are too many near each other"
    assert {one.value[-2] for _, one in road.outputs} == {3}, "those that were looked at are grouped all the same"
