"""Simulated truth and reports for the filter's tests: a point pushed about by white noise, seen with stated accuracy."""

import random

from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.vehicle import PositionReport, Report, VelocityReport

START_US = 1_700_000_000_000_000
HOME = LocalFrame(47.0, 8.0, 500.0)


def position_at(valid_us: int, ned: tuple[float, float, float], source: str = "A", **fields) -> PositionReport:
    latitude, longitude, altitude = HOME.from_ned(*ned)
    return PositionReport(valid_us, source, latitude, longitude, altitude, **fields)


def straight(
    seconds: float,
    *,
    hertz: float = 10.0,
    speed_m_s: float = 5.0,
    noise_m: float = 0.1,
    phase_us: int = 0,
    seed: int = 1,
) -> list[tuple[Report, int]]:
    """North at one speed, 20 m up; each report is available 5 ms after it held."""
    rng, found = random.Random(seed), []
    for k in range(round(seconds * hertz)):
        at_us = START_US + phase_us + round(k * 1e6 / hertz)
        t = k / hertz
        ned = (speed_m_s * t + rng.gauss(0, noise_m), rng.gauss(0, noise_m), -20 + rng.gauss(0, noise_m))
        found += [
            (VelocityReport(at_us, "A", speed_m_s, 0.0, 0.0), at_us + 5_000),
            (position_at(at_us, ned), at_us + 5_000),
        ]
    return found


def wandering(
    steps: int, *, density: float, position_sd: float, velocity_sd: float, seed: int, dt: float = 0.1
) -> tuple[list[tuple[Report, int]], list[tuple[float, ...]]]:
    """The filter's own model as truth: reports on the grid, and the true state (6 numbers) at each."""
    rng = random.Random(seed)
    state = [[rng.gauss(0, 1), rng.gauss(0, 3)] for _ in range(3)]
    reports, truth = [], []
    for k in range(steps):
        at_us = START_US + round(k * dt * 1e6)
        if k:
            for axis in state:
                shared, own = rng.gauss(0, 1), rng.gauss(0, 1)
                push = (density * dt) ** 0.5 * shared
                axis[0] += axis[1] * dt + push * dt / 2 + (density * dt**3 / 12) ** 0.5 * own
                axis[1] += push
        where, speed = [axis[0] for axis in state], [axis[1] for axis in state]
        seen = tuple(each + rng.gauss(0, position_sd) for each in where)
        felt = tuple(each + rng.gauss(0, velocity_sd) for each in speed)
        reports += [
            (VelocityReport(at_us, "A", *felt, velocity_sd), at_us),
            (position_at(at_us, seen, horizontal_sd_m=position_sd, vertical_sd_m=position_sd), at_us),
        ]
        truth.append((*where, *speed))
    return reports, truth
