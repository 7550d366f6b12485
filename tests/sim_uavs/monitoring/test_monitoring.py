"""From the camera to the event: the ready specification of the scenario `traffic`, on a platform that sees simulated cars."""

import os

import pytest

from agents.effects import Specify, Tell
from compunits import catalogue
from kpl import parse_specification
from kpl.linking.declarations import links_in
from proxies.recordings.named_files import beside
from sim_uavs.dynamics.scenarios import scenario
from sim_uavs.monitoring.specifications import READY
from sim_uavs.streets import traffic_of
from tests.agents.cameras.watching import START_US, Watching
from tests.sim_uavs.monitoring.truth import chronicle_of, passages

FULL = bool(os.environ.get("DYKNOW_FULL"))
STREAMS = {
    "turns_left": "turn_left_in_crossing",
    "turns_right": "turn_right_in_crossing",
    "goes_straight": "straight_through_crossing",
}


@pytest.mark.parametrize("seed", range(3, 7 if FULL else 4))
def test_turns_that_are_recognised_are_those_that_cars_take_and_none_is_overlooked(seed: int) -> None:
    ready = READY["traffic"]
    watching = Watching(seed, catalogue=catalogue(ready.modules).offered)
    named = tuple((path, (ready.file.parent / path).read_text("utf-8")) for path in ("turns.chr",))
    watching.specify(Specify(watching.now_us, ready.file.read_text("utf-8"), ready.file.name, named))
    watching.run(120.0 if FULL else 40.0)

    told = [each.record for each in watching.effects if isinstance(each, Tell)]
    assert not [each for each in told if each["event"] == "not-specified"]
    recognised = [
        (each["valid_us"], STREAMS[each["stream"]], *each["value"][0][1:])
        for each in told
        if each["event"] == "sample" and each["stream"] in STREAMS
    ]
    traffic = traffic_of(scenario("traffic"), seed)
    true = passages(traffic.at, range(START_US, watching.now_us, 100_000))
    really = [(each.at_us, chronicle_of(traffic.network, each), *each[2:]) for each in true]
    for at_us, *event in recognised:
        assert any(event == list(each) and abs(at_us - when_us) < 2_500_000 for when_us, *each in really), event
    seen_whole = range(START_US + 5_000_000, watching.now_us - 3_000_000)
    below = [each for each in really if each[3] == "x11" and each[0] in seen_whole]
    assert len(below) >= 4
    for when_us, *event in below:
        assert any(event == list(each) and abs(at_us - when_us) < 2_500_000 for at_us, *each in recognised), event


def test_the_ready_files_are_installed_with_the_package_and_their_chronicles_are_read() -> None:
    for ready in READY.values():
        specification = parse_specification(ready.file.read_text("utf-8"), beside(ready.file))
        assert {label.feature for label, _ in links_in(specification)} == {"cars"}
