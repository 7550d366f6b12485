"""Derived features are streams that are there while they are wanted, in formulas as anywhere else."""

import pytest

from dyknow import Label, Policy
from dyknow.reasoning import FEATURES
from dyknow.reasoning.features.derivation import FeatureInput
from dyknow.reasoning.features.derived_streams import derived_stream, stream_of
from tests.kpl.instances import Running

POSITIONS = """
source position own
source position other
source number wind
strmgen heli-position[self] = own
strmgen heli-position[uav1] = other
strmgen wind_speed = wind
"""
METRE_DEG = 1 / 111_195.0


def fly(running: Running, metres: list[float | None]) -> None:
    """Both positions every 100 ms, so far apart; None: the other one brings nothing."""
    for distance_m in metres:
        at_us = (running.network.now_us // 100_000 + 1) * 100_000
        running.push("own", (58.0, 15.0), at_us)
        if distance_m is not None:
            running.push("other", (58.0 + distance_m * METRE_DEG, 15.0), at_us)


def test_a_derived_feature_is_a_declared_stream_of_what_both_units_brought_at_one_time() -> None:
    running = Running(f"{POSITIONS}stream d = xy_dist[self, uav1]\n")
    fly(running, [20.0, None, 10.0])
    made = [(sample.valid_us, sample.value) for name, sample in running.outputs if name == "d"]
    assert [at_us for at_us, _ in made] == [100_000, 300_000]
    assert [value for _, value in made] == pytest.approx([20.0, 10.0], rel=0.01)


def test_it_works_only_while_it_is_wanted() -> None:
    running = Running(f"{POSITIONS}stream d = xy_dist[self, uav1]\n")
    position = running.network.generator(Label("heli-position", ("uav1",)))
    assert position.subscriptions
    running.instance.change((), running.network.now_us)
    assert not running.network.has(Label("xy_dist", ("7", "uav1")))


def test_it_is_an_input_of_units_and_states() -> None:
    running = Running(
        f"{POSITIONS}strmgen near = state(xy_dist[self, uav1], wind_speed) with sample every 100, max delay 100\nstream n = near\n"
    )
    running.push("wind", 3.0, 100_000)
    fly(running, [20.0, 10.0])
    running.wait(500_000)
    values = [sample.value for name, sample in running.outputs if name == "n"]
    assert values[1] == (pytest.approx(20.0, rel=0.01), 3.0)


def test_one_formula_speaks_of_a_derived_feature_and_of_a_declared_stream() -> None:
    running = Running(f"{POSITIONS}monitor calm = always (xy_dist[self, uav1] >= 15 or wind_speed < 5)\n")
    calm = running.instance.monitors["calm"]
    for at in range(6):
        fly(running, [20.0 - 2 * at])
        running.push("wind", 4.0 + 2 * (at > 3), running.network.now_us)
    running.wait(2_000_000)
    assert [event.event for event in running.alarms] == ["opened"]
    assert running.alarms[0].valid_us == 500_000
    assert running.alarms[0].values == {"wind_speed": 6.0, "xy_dist[7, uav1]": pytest.approx(12.0, rel=0.01)}
    assert calm.monitor.verdict == "false"


def test_what_is_missing_is_named_by_what_the_feature_is_derived_from() -> None:
    running = Running(f"{POSITIONS}monitor apart = always (xy_dist[self, uav1] >= 15 or wind_speed < 5)\n")
    running.push("own", (58.0, 15.0), 100_000)
    assert running.instance.monitors["apart"].states.silent == ("wind_speed", "heli-position[uav1]")


def test_an_input_without_producer_is_reported_and_the_stream_begins_when_there_is_one() -> None:
    running = Running("stream d = speed[uav1]\n")
    assert any("heli-velocity[uav1], which has no producer here" in said for _, said in running.faults)
    running.add("source velocity v\nstrmgen heli-velocity[uav1] = v\n")
    running.push("v", (3.0, 4.0, 0.0), 100_000)
    assert [sample.value for name, sample in running.outputs if name == "d"] == [5.0]


def test_a_declared_stream_takes_the_place_of_a_derived_one_and_serves_its_subscribers() -> None:
    running = Running("stream d = speed[uav1]\nsource number raw\n")
    running.add("strmgen speed[uav1] = raw\n")
    running.push("raw", 7.0, 100_000)
    assert [sample.value for name, sample in running.outputs if name == "d"] == [7.0]


def test_a_feature_that_is_called_like_what_it_is_derived_from_is_read_from_the_record() -> None:
    stream = derived_stream(Label("derived.battery", ("0",)))
    assert stream is not None
    assert derived_stream(Label("battery", ("0",))) is None, "that is the label of the record"


@pytest.mark.parametrize("name", FEATURES)
def test_every_feature_names_its_inputs_and_asks_for_them_while_it_is_computed(name: str) -> None:
    units = ("0", "1")[: FEATURES[name].arity]
    asked: list[tuple[FeatureInput, bool]] = []
    running = Running(features=lambda label: derived_stream(label, demand=lambda *each: asked.append(each)))
    label = stream_of(running.network, Label(name, units))
    proxy = running.network.connect(label, Policy(), lambda _sample: None)
    assert {each for each, _ in asked} == {FeatureInput(each, unit) for each in FEATURES[name].needs for unit in units}
    proxy.cancel()
    assert [wanted for _, wanted in asked].count(False) == len(asked) // 2
