"""An environment model on a platform with cameras: what is believed, what happened to it, and which rules were obeyed."""

from collections import defaultdict
from math import hypot
from pathlib import Path

import pytest

from dyknow import Label
from dyknow.agents.effects import Specify
from dyknow.agents.specification.object_queries import ObjectQueries
from dyknow.kpl.linking.beliefs import BeliefStream
from dyknow.policies.ahead import moved_on
from tests.agents.capabilities.cameras.watching import Watching

MODEL = Path("sim_uavs/monitoring/world.toml").read_text("utf-8")
KNOWLEDGE = """
name = "town"
tasks = ["search"]
[classes.car]
lasting = true
[classes.truck]
[classes.motorcycle]
[[rules]]
name = "no-red-cars"
class = "car"
attribute = "colour"
values = ["black", "blue", "green", "grey", "white", "yellow"]
action = "repair"
"""
FILES = (("world.toml", MODEL), ("town.toml", KNOWLEDGE))
BELIEFS = """
strmgen beliefs = believe("world.toml"{more}, vision-percepts[self] as camera in camera-view[self]{task})
stream believed = beliefs
export believed-objects = beliefs
"""


def watching(more: str = "", task: str = "") -> Watching:
    found = Watching(seed=3)
    found.specify(Specify(found.now_us, BELIEFS.format(more=more, task=task), "a.kpl", FILES))
    found.look_at("beliefs")
    found.run(12.0)
    return found


@pytest.fixture(scope="module")
def plain() -> Watching:
    return watching()


def events(of: Watching) -> list[tuple[str, str, str]]:
    part = of.platform.part(ObjectQueries)
    return [(each.event, each.target, each.because) for each in part._events("0", None)]


def test_each_car_in_view_is_one_confirmed_instance_seen_by_the_platform(plain: Watching) -> None:
    of_car = defaultdict[str, set[str]](set)
    for sample in plain.samples["beliefs"]:
        record = plain.platform.ports.network.generator("beliefs").sort.as_record(sample.value)
        cars = plain.truth.get(sample.valid_us, ())
        if record["status"] == "confirmed" and record["seen_by"] == "0" and cars:
            near = min(cars, key=lambda car: hypot(car.x_m - record["x_m"], car.y_m - record["y_m"]))
            if hypot(near.x_m - record["x_m"], near.y_m - record["y_m"]) < 3.0:
                of_car[near.name].add(record["symbol"])
    assert len(of_car) >= 3
    assert all(len(symbols) == 1 for symbols in of_car.values())


def test_a_belief_that_is_predicted_is_as_much_vaguer_as_its_velocity_is_uncertain(plain: Watching) -> None:
    sort = plain.platform.ports.network.generator("beliefs").sort
    sample = next(each for each in reversed(plain.samples["beliefs"]) if not sort.as_record(each.value)["end"])
    predicted = moved_on(sample, sort, 5_000_000)
    assert predicted is not None
    now, then = sort.as_record(sample.value), sort.as_record(predicted.value)
    assert then["x_m"] == pytest.approx(now["x_m"] + 5.0 * now["vx_m_s"])
    assert now["v_sd_m_s"] > 0.1
    assert then["sd_m"] == pytest.approx(hypot(now["sd_m"], 5.0 * now["v_sd_m_s"]))


def test_what_happened_to_instances_is_told_with_their_existence(plain: Watching) -> None:
    told = events(plain)
    assert {kind for kind, *_ in told} <= {"confirmed", "deleted", "trust"}
    part, symbol = plain.platform.part(ObjectQueries), next(target for kind, target, _ in told if kind == "confirmed")
    kinds = {each.event for each in part._events("0", symbol)}
    assert {"created", "confirmed", "attribute-created"} <= kinds


def test_knowledge_is_loaded_for_its_task_and_its_rules_are_cited() -> None:
    searching = watching(', "town.toml"', ' for "search"')
    told = events(searching)
    assert ("loaded", "town") in {each[:2] for each in told}
    assert any(kind == "repaired" and "no-red-cars" in why for kind, _, why in told)
    assert all(sample.value[10] != "red" for sample in searching.samples["beliefs"] if sample.value[3] == "car")
    other = watching(', "town.toml"', ' for "rest"')
    assert not any(kind in {"loaded", "repaired"} for kind, *_ in events(other))


def test_the_process_is_there_while_it_is_wanted(plain: Watching) -> None:
    process = plain.platform.ports.network.process(Label("beliefs"))
    assert isinstance(process, BeliefStream)
    ((source, trust),) = process.sources
    assert (source.name, trust.value) == ("0", pytest.approx(1.0, abs=0.2))
