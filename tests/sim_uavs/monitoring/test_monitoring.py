"""From the camera to the event: the ready specification of the scenario `traffic`, on a platform that sees simulated cars."""

import os

import pytest

from dyknow.agents.effects import Specify, Tell
from dyknow.compunits import catalogue
from dyknow.kpl import parse_specification
from dyknow.kpl.linking.declarations import links_in
from dyknow.proxies.files.named_files import beside
from dyknow.sim_uavs.dynamics.scenarios import scenario
from dyknow.sim_uavs.monitoring.specifications import READY
from dyknow.sim_uavs.roads.layouts import network_of
from dyknow.sim_uavs.streets import roads_of, traffic_of
from tests.agents.capabilities.cameras.watching import START_US, Watching
from tests.sim_uavs.monitoring.truth import chronicle_of, passages

FULL = bool(os.environ.get("DYKNOW_FULL"))
STREAMS = {
    "turns_left": "turn_left_in_crossing",
    "turns_right": "turn_right_in_crossing",
    "goes_straight": "straight_through_crossing",
}
STREAMS |= {f"{stream}_predicted": f"{chronicle}_predicted" for stream, chronicle in STREAMS.items()}
PREDICTED = "_predicted"
LATE_US = 2_500_000
SITUATION = scenario("traffic")
Event = tuple[int, str, str, str, str]
"""When, the chronicle, and from where through which crossing to where."""


def recognised_and_real(seed: int, index: int, seconds: float) -> tuple[list[Event], list[Event]]:
    """What a platform recognises, and what cars do at the crossing below it from when they are seen until the end."""
    ready = READY["traffic"]
    roads = network_of(roads_of(SITUATION))
    watching = Watching(seed, index, catalogue=catalogue(ready.modules).offered, roads=roads)
    named = tuple((path, (ready.file.parent / path).read_text("utf-8")) for path in ("turns.chr", "world.toml"))
    watching.specify(Specify(watching.now_us, ready.file.read_text("utf-8"), ready.file.name, named))
    watching.run(seconds)

    told = [each.record for each in watching.effects if isinstance(each, Tell)]
    assert not [each for each in told if each["event"] == "not-specified"]
    recognised = [
        (each["valid_us"], STREAMS[each["stream"]], *each["value"][0][1:])
        for each in told
        if each["event"] == "sample" and each["stream"] in STREAMS
    ]
    traffic = traffic_of(SITUATION, seed)
    true = passages(traffic.at, range(START_US, watching.now_us, 100_000))
    real = [(each.at_us, chronicle_of(traffic.network, each) or "", *each[2:]) for each in true]
    for each in recognised:
        assert any(is_of(each, other) for other in real), each
    seen_whole = range(START_US + 5_000_000, watching.now_us - 3_000_000)
    below = ("x11", "x21")[index]
    return recognised, [each for each in real if each[3] == below and each[0] in seen_whole]


def is_of(recognised: Event, real: Event) -> bool:
    name = recognised[1].removesuffix(PREDICTED)
    return (name, *recognised[2:]) == real[1:] and abs(recognised[0] - real[0]) < LATE_US


@pytest.mark.timeout(1200 if FULL else 240)
@pytest.mark.parametrize("seed", range(3, 7 if FULL else 4))
def test_turns_that_are_recognised_are_those_that_cars_take_and_none_is_overlooked(seed: int) -> None:
    recognised, below = recognised_and_real(seed, 0, 120.0 if FULL else 40.0)
    assert len(below) >= 4
    for each in below:
        assert any(is_of(other, each) for other in recognised), each


@pytest.mark.timeout(1200 if FULL else 240)
@pytest.mark.parametrize("seed", range(3, 7 if FULL else 4))
def test_turns_under_trees_are_predicted_and_no_others(seed: int) -> None:
    recognised, below = recognised_and_real(seed, 1, 120.0 if FULL else 30.0)
    predicted = [each for each in recognised if each[1].endswith(PREDICTED)]
    assert {each[3] for each in predicted} == {"x21"}
    assert len(predicted) >= len(below) / 3
    assert sum(any(is_of(other, each) for other in recognised) for each in below) >= 0.7 * len(below)


def test_the_ready_files_are_installed_with_the_package_and_their_chronicles_are_read() -> None:
    linked = {"traffic": {"cars", "road_cars"}, "logistics": {"boxes"}, "emergency": {"boxes"}}
    assert READY.keys() == linked.keys()
    for name, ready in READY.items():
        specification = parse_specification(ready.file.read_text("utf-8"), beside(ready.file))
        assert {label.feature for label, _ in links_in(specification)} == linked[name]
