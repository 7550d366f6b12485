from contextlib import suppress
from math import isnan, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.model.errors import TextError
from dyknow.sim_uavs.dynamics.faults import _KINDS, KINDS, ActiveFaults, SimulatedFault, parse_fault, spoil
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from dyknow.sim_uavs.dynamics.sensors import GpsReading

READING = GpsReading(Vector(1.0, 2.0, -3.0), Vector(4.0, 5.0, 6.0), 0.2, 0.3, 14)
EARLIER = READING._replace(position=Vector(0.0, 0.0, 0.0))
S = 1_000_000


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("silence", SimulatedFault("silence")),
        ("packet-loss=30", SimulatedFault("packet-loss", 30.0)),
        ("packet-loss", SimulatedFault("packet-loss", 30.0)),
        ("clock=+5s", SimulatedFault("clock", 5e6)),
        ("clock=-300ms", SimulatedFault("clock", -3e5)),
        ("clock=3600", SimulatedFault("clock", 3600e6)),
        ("battery-low=12.5", SimulatedFault("battery-low", 12.5)),
        (" teleport=-80 ", SimulatedFault("teleport", -80.0)),
    ],
)
def test_faults_read_as_they_are_written(text, fault) -> None:
    assert parse_fault(text) == fault


@given(st.sampled_from(KINDS), st.integers(0, 100))
def test_what_is_printed_is_read_back(kind, amount) -> None:
    takes_amount = parse_fault(kind).amount != 0.0
    fault = SimulatedFault(
        kind, min(max(float(amount), _KINDS[kind].least), _KINDS[kind].most) if takes_amount else 0.0
    )
    assert parse_fault(str(fault)) == fault


@pytest.mark.parametrize(
    "text",
    ["", "explosion", "silence=3", "packet-loss=130", "packet-loss=", "packet-loss=x", "clock=soon", "clock=nan"],
)
def test_a_wrong_fault_is_refused_with_its_repair(text) -> None:
    with pytest.raises(TextError) as caught:
        parse_fault(text)
    assert caught.value.repair


@given(st.text(max_size=30))
def test_any_text_is_a_fault_or_a_text_error(text) -> None:
    with suppress(TextError):
        assert parse_fault(text).kind in KINDS


def test_a_fault_ends_at_its_end_and_not_before() -> None:
    faults = ActiveFaults()
    faults.inject(SimulatedFault("silence"), 0, until_us=5 * S)
    assert faults.holds("silence", 5 * S - 1)
    assert not faults.holds("silence", 5 * S)


def test_a_fault_without_an_end_holds_until_one_of_its_kind_ends() -> None:
    faults = ActiveFaults()
    faults.inject(SimulatedFault("silence"), 0)
    faults.inject(SimulatedFault("nan"), 0)
    assert faults.holds("silence", 10**15)
    faults.inject(SimulatedFault("silence"), 0, until_us=0)
    assert [kind for kind in KINDS if faults.holds(kind, 10**15)] == ["nan"]


def test_clocks_step_and_drift() -> None:
    faults = ActiveFaults()
    assert (faults.step_us(S), faults.drift_us(S)) == (0, 0)
    faults.inject(SimulatedFault("clock", -3e5), S)
    faults.inject(SimulatedFault("clock-drift", 100.0), S)
    assert faults.step_us(2 * S) == -300_000
    assert faults.drift_us(11 * S) == 1000


def test_each_sensor_fault_spoils_as_it_says() -> None:
    def under(kind, amount=0.0):
        faults = ActiveFaults()
        faults.inject(SimulatedFault(kind, amount), 0)
        return spoil(READING, EARLIER, faults, 1)

    assert spoil(READING, EARLIER, ActiveFaults(), 1) == READING
    assert under("gps-loss") is None
    assert under("frozen-position") == EARLIER
    assert all(map(isnan, under("nan").position))
    jumped = under("teleport", 500.0).position.minus(READING.position)
    assert sqrt(sum(x * x for x in jumped)) == pytest.approx(500.0)
    assert under("silence") == READING, "a fault of the radio leaves the sensors alone"
