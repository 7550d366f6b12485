"""Streams that are asked for by the labels of the platform's own instance, exported or not."""

import json
from typing import Any

import pytest

from dyknow import Label
from dyknow.compunits import catalogue
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import QueryStream, StreamSamples
from tests.box import Box, Question

P = Performative
MAKES = """\
source gas sniffer
strmgen gas[self] = sniffer
compunit gas Doubled(gas)
strmgen double[self] = Doubled(gas[self])
"""
UNITS = """
from dyknow import computational_unit, source

@source("gas")
def sniffer(from_us):
    n = -(-from_us // 500_000)
    while True:
        yield n * 500_000, 40.0 + n % 10
        n += 1

@computational_unit("gas", "gas", name="Doubled", samplewise=True)
def doubled(_now_us, sample):
    return sample.value * 2
"""


@pytest.fixture
def sensor(wire: Box, tmp_path: Any) -> Box:
    """Platform 7 has a gas sensor and exports nothing; 8 asks."""
    path = tmp_path / "sniffer.py"
    path.write_text(UNITS, encoding="utf-8")
    wire.join("7", catalogue=catalogue([str(path)]).offered)
    wire.join("8")
    specify(wire, MAKES)
    return wire


def specify(wire: Box, text: str, unit: str = "7") -> None:
    wire.specify(unit, text, f"{unit}.kpl")
    wire.run(0.6)


def asked(wire: Box, stream: str, by: str = "8", to: str = "7", **when: Any) -> Question:
    question = wire.question(by, to, QueryStream(stream=stream, **when), P.QUERY_REF)
    wire.run(1.2)
    return question


def test_what_is_declared_is_asked_for_by_its_own_label_and_computed_when_it_is(sensor: Box) -> None:
    for stream in ("gas[self]", "double[7]"):
        [said] = asked(sensor, stream).contents
        assert isinstance(said, StreamSamples)
        assert (said.unit, said.stream) == ("7", stream)
        assert len(said.samples) == 1
        assert 40.0 <= said.samples[0].value["value"] / (2 if stream == "double[7]" else 1) < 50.0
    now_us = sensor.now_us
    [said] = asked(sensor, "double[self]", op="between", from_us=now_us - 2_000_000, to_us=now_us).contents
    assert [each.value["value"] % 2 for each in said.samples] == [0.0] * len(said.samples)
    assert len(said.samples) >= 3
    [said] = asked(sensor, "double[self]", op="at", at_us=now_us - 1_000_000).contents
    assert now_us - 2_000_000 <= said.samples[0].valid_us <= now_us - 1_000_000
    sensor.run(35.0)
    assert not sensor.platform("7").ports.network.find(Label("double", ("7",))).subscriptions


def test_a_derived_feature_and_a_stream_of_the_vehicle_are_asked_for_too(wire: Box) -> None:
    wire.fly("7", 0.0, 0.0, 3.0)
    wire.fly("8", 0.0, 300.0)
    wire.run(2.0)
    before = set(wire.platform("7").ports.network.labels())
    [said] = asked(wire, "speed[self]").contents
    assert said.samples[0].value["value"] == pytest.approx(3.0, abs=0.5)
    [said] = asked(wire, "heli-height[self]").contents
    assert said.samples[0].value.keys() == {"height_m"}
    [said] = asked(wire, "heli-height.height_m[7]").contents
    assert said.samples[0].value.keys() == {"value"}
    wire.run(35.0)
    assert set(wire.platform("7").ports.network.labels()) == before, "what is there because it was asked for goes again"


@pytest.mark.parametrize(
    ("stream", "said"),
    [
        ("gaz[self]", "no stream generator for 'gaz[self]'; this node has gas[7], double[7]"),
        ("gas[self", "a label ends with `]`"),
        ("gas[8]", "no stream generator for 'gas[8]'"),
        ("gas[a b]", "expected an object name or an integer"),
        ("xy_dist[7, 8, 9]", "no stream generator"),
        ("a" * 5000 + "[self]", "a label has at most"),
    ],
)
def test_what_is_not_there_is_refused_with_what_is(sensor: Box, stream: str, said: str) -> None:
    question = asked(sensor, stream)
    assert question.performatives == [P.REFUSE]
    assert said in question.reason
    assert sensor.platform("7").ports.agent.audit_log.refused["refused"] == 1


@pytest.mark.parametrize(
    ("export", "code"),
    [
        ("export private gas-level = gas[self]", "private"),
        ("export gas-level = gas[self] to 1", "no-receiver"),
        ("export gas-level = gas[self] to 1, 8", ""),
        ("export gas-level = gas[self]", ""),
        ("export private gas-level = gas[self]\nexport gas-there = gas[self]", ""),
    ],
)
def test_what_is_exported_to_some_only_is_for_them_under_its_own_label_too(sensor: Box, export: str, code: str) -> None:
    labels = 'label gas-level : gas in ppm "gas in the air"\nlabel gas-there : gas in ppm "gas over there"\n'
    specify(sensor, f"{labels}{MAKES}{export}\n")
    question = asked(sensor, "gas[self]")
    assert question.performatives == [P.REFUSE if code else P.INFORM]
    assert (question.contents[0].code if code else "") == code
    assert asked(sensor, "double[self]").performatives == [P.INFORM], "another stream"
    assert asked(sensor, "gas-level[self]").performatives == [P.REFUSE if code or "private" in export else P.INFORM]


def test_what_is_imported_is_asked_of_its_owner(sensor: Box) -> None:
    label = 'label gas-level : gas in ppm "gas in the air"\n'
    specify(sensor, f"{label}{MAKES}export gas-level = gas[self] to 8\n")
    specify(sensor, f"{label}import gas-level from 7 as gas[uav7]\nstream seen = gas[uav7]\n", "8")
    sensor.join("9")
    sensor.run(2.0)
    question = asked(sensor, "gas[uav7]", by="9", to="8")
    assert question.reason == "gas[uav7] is imported from 7: ask 7 for gas-level"
    assert asked(sensor, "gas-level[7]", by="9", to="8").performatives == [P.REFUSE], "nor by another name"
    assert asked(sensor, "gas[self]", by="9").contents[0].code == "no-receiver"


def test_values_that_no_act_carries_are_told_as_text(sensor: Box) -> None:
    specify(sensor, f"{MAKES}strmgen both = state(gas[self], double[self]) with sample every 500, max delay 100\n")
    [said] = asked(sensor, "both").contents
    assert isinstance(said, StreamSamples)
    one, two = json.loads(str(said.samples[0].value["value"]))  # type: ignore[index]
    assert two == 2 * one
