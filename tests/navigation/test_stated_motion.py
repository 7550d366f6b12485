"""What a vehicle states of its motion: no honest flight contradicts itself, with faulty receivers neither; lies do."""

import os
from collections.abc import Iterable
from math import cos, radians, sin
from pathlib import Path
from random import Random

import pytest

from dyknow.model.sample import Sample
from dyknow.navigation.fusion import Estimate
from dyknow.navigation.stated_motion import StatedMotion, Unflown
from dyknow.navigation.vehicle import Command, GoToOrder, Report
from dyknow.proxies.recordings.formats import open_recording
from dyknow.proxies.recordings.replay import schedule
from dyknow.sim_uavs.dynamics.faults import parse_fault
from dyknow.sim_uavs.dynamics.settings import HomePlace, VehicleConfig
from dyknow.sim_uavs.dynamics.vehicles import SimulatedVehicle
from tests.navigation.offline import run_filter

START_US, S = 1_700_000_000_000_000, 1_000_000
HOME = HomePlace(58.0, 15.0, 100.0)
PERIOD_US = 100_000
FAULTS = ("", "gps-loss", "frozen-position", "nan", "silence", "packet-loss=60", "clock=+1s", "clock-drift=300", "teleport=60", "teleport=500", "teleport=5000", "gps-noise=10", "gps-noise=30")  # fmt: skip
LOGS = ("dronekit_copter_flight.tlog", "dronekit_la_log171.bin", "pyulog_sample_px4_events.ulg")


def flown(seed: int, fault: str, seconds: int = 60) -> list[Sample]:
    """The estimates of a simulated vehicle that is sent about, with a fault for some seconds of the flight."""
    random = Random(f"{seed} {fault}")
    vehicle = SimulatedVehicle(VehicleConfig(1, HOME, airborne_m=40.0, seed=seed), START_US)
    now_us, reports = START_US, list[tuple[Report, int]]()
    fault_us, goto_us, number = START_US + random.randrange(5, 20) * S, START_US + S, 0
    while now_us < START_US + seconds * S:
        now_us += 50_000
        if now_us >= goto_us:
            goto_us, number = now_us + random.randrange(3, 15) * S, number + 1
            north, east = random.uniform(-0.003, 0.003), random.uniform(-0.003, 0.003)
            order = GoToOrder(HOME.latitude_deg + north, HOME.longitude_deg + east, HOME.altitude_m + random.uniform(10, 110), random.uniform(2, 20))  # fmt: skip
            vehicle.on_command(Command(number, order), now_us, now_us)
        if fault and now_us == fault_us:
            vehicle.inject(parse_fault(fault), now_us, now_us + random.randrange(1, 25) * S)
        reports += [(report, now_us + 5_000) for report in vehicle.on_time(now_us, now_us)]
    return run_filter(reports, PERIOD_US)


def judged(samples: Iterable[Sample], motion: StatedMotion | None = None) -> list[tuple[int, Unflown]]:
    """When what was found in estimates, exported as platforms do."""
    motion = motion or StatedMotion()
    found: list[tuple[int, Unflown]] = []
    for sample in samples:
        at_us, one = sample.valid_us, Estimate(*sample.value)
        found += [
            (at_us, each) for each in motion.on_position(at_us, *one[:2], max(one.var_n, one.var_e) ** 0.5, at_us)
        ]
        found += [(at_us, each) for each in motion.on_altitude(at_us, one.altitude_m, one.var_d**0.5)]
        motion.on_velocity(at_us, *one[3:6])
        found += [(at_us, each) for each in motion.on_camera(at_us, *one[:2])]
    return found


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("seed", range(3))
def test_an_honest_vehicle_contradicts_nothing_whatever_its_receiver_does(seed: int, fault: str) -> None:
    samples = flown(seed, fault)
    assert len(samples) > 200
    assert judged(samples) == []
    assert judged(samples[::5]) == [], "nor does a stream that comes less often"


@pytest.mark.skipif("DYKNOW_FLIGHT_DATA" not in os.environ, reason="DYKNOW_FLIGHT_DATA names no directory of logs")
@pytest.mark.parametrize("log", LOGS)
def test_recorded_flights_contradict_nothing(log: str) -> None:
    recording = open_recording(Path(os.environ["DYKNOW_FLIGHT_DATA"]) / log)
    for period_us in (50_000, 100_000, 500_000):
        samples = run_filter(((report, at_us) for at_us, report in schedule(recording, START_US, 0)), period_us)
        assert len(samples) > 20
        assert judged(samples) == []


@pytest.mark.parametrize("seed", range(20))
def test_a_leap_is_found_in_the_sample_that_leaps(seed: int) -> None:
    random = Random(seed)
    samples = flown(seed % 3, "", 30)
    at = random.randrange(10, len(samples) - 10)
    far_m, course = 10 ** random.uniform(2.5, 6.0), random.uniform(0, 6.28)
    north, east = far_m * cos(course) / 111_320, far_m * sin(course) / (111_320 * cos(radians(58.0)))
    lied = [one._replace(value=(one.value[0] + north, one.value[1] + east, *one.value[2:])) for one in samples[at:]]
    found = judged([*samples[:at], *lied])
    assert [(at_us, one.kind) for at_us, one in found] == [(samples[at].valid_us, "leap")]


@pytest.mark.parametrize("seed", range(20))
def test_a_velocity_that_is_not_flown_is_found_within_a_window_and_a_second(seed: int) -> None:
    random = Random(seed)
    samples = flown(seed % 3, "", 30)
    at = random.randrange(40, 150)
    by = [random.choice([-1, 1]) * random.uniform(20, 300) for _ in range(3)]
    lied = [
        one._replace(
            value=(*one.value[:3], *(v + more for v, more in zip(one.value[3:6], by, strict=True)), *one.value[6:])
        )
        for one in samples[at:]
    ]
    found = judged([*samples[:at], *lied])
    assert found[0][1].kind == "velocity"
    assert found[0][0] <= samples[at].valid_us + 4 * S


def test_leaps_over_silences_are_found_where_there_are_several_in_a_minute() -> None:
    samples = [one for one in flown(1, "") if (one.valid_us - START_US) % (10 * S) < 7 * S]
    assert judged(samples) == []
    lied = [
        one._replace(value=(one.value[0] + 0.1 * ((one.valid_us - START_US) // (10 * S) % 2), *one.value[1:]))
        for one in samples
    ]
    found = judged(lied)
    assert {one.kind for _, one in found} == {"leap"}
    assert found[0][0] < START_US + 31 * S


def test_cameras_are_where_the_vehicle_is() -> None:
    motion = StatedMotion()
    assert not [*motion.on_position(START_US, 58.0, 15.0, 0.5, START_US)]
    assert not [*motion.on_camera(START_US, 58.0005, 15.0)]
    (found,) = motion.on_camera(START_US + 100_000, 58.01, 15.0)
    assert found.text.startswith("cameras that are 11")
