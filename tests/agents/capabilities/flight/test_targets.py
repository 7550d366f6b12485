"""Whose target a vehicle reports, where reports come late: the way back is another station's target, never one of ours."""

from random import Random

import pytest

from dyknow import Sample
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.navigation.vehicle import GoToOrder, HomeReport, StatusReport, TargetReport

HOME_M, STEP_US, STEPS = 50.0, 100_000, 200
FLIES = StatusReport(0, armed=True, guided=True, airborne=True, mode="GUIDED")


@pytest.mark.parametrize("seed", range(60))
def test_the_way_back_is_the_last_target_of_the_station_however_often_the_manoeuvre_changes(seed: int) -> None:
    """Drawn: a station gives targets, manoeuvres replace each other, and the vehicle reports its targets late."""
    rng = Random(seed)
    flown = Pilot(control=True, plan=None)
    flown.on_report(HomeReport(0, 58.0, 15.0, HOME_M), 0)
    lag, every = rng.randrange(16), rng.choice([1, 2, 5, 10])
    drawn = (58.0 + rng.uniform(0.0005, 0.003) for _ in range(1000))
    targets: list[tuple[float, str]] = [(next(drawn), "station")]
    ours: set[float] = set()
    quiet = lag + 2 * every
    since, divert_at, station_at = 0, quiet + rng.randrange(20), STEPS
    for step in range(STEPS):
        now_us = step * STEP_US
        flown.on_report(FLIES, now_us)
        flown.on_estimate(Sample(now_us, now_us, (58.0, 15.0, 100.0, 0.0, 0.0, 0.0)))
        if step == station_at:
            targets.append((next(drawn), "station"))
            since, divert_at, station_at = step, step + quiet + rng.randrange(20), STEPS
        elif step == divert_at:
            (command,) = flown.divert(110.0, (latitude := next(drawn), 15.0))
            assert isinstance(command.order, GoToOrder)
            ours.add(latitude)
            targets.append((latitude, "ours"))
            since, divert_at = step, step + rng.randint(1, 15)
            if rng.random() < 0.2:
                divert_at, station_at = STEPS, step + quiet + rng.randrange(10)
        else:
            targets.append(targets[-1])
        if step % every == 0 and step >= lag:
            latitude, by = targets[step - lag]
            flown.on_report(TargetReport(now_us, latitude, 15.0, 110.0 if by == "ours" else 100.0), now_us)
        aside = flown._aside
        assert not isinstance(aside, GoToOrder) or aside.latitude_deg not in ours
        if flown.diversion is not None:
            stations = [latitude for latitude, by in targets[: since + 1] if by == "station"]
            assert isinstance(aside, GoToOrder) or step - since < quiet
            if isinstance(aside, GoToOrder) and targets[-1][1] == "ours":
                assert aside.latitude_deg == stations[-1]
    assert ours


def test_a_late_target_of_the_replaced_order_is_no_stations() -> None:
    flown = Pilot(control=True, plan=None)
    flown.on_report(HomeReport(0, 58.0, 15.0, HOME_M), 0)
    for report in (FLIES, TargetReport(0, 58.0, 15.0, 100.0)):
        flown.on_report(report, 0)
    flown.on_estimate(Sample(0, 0, (58.0, 15.0, 100.0, 0.0, 0.0, 0.0)))
    flown.divert(100.0, (58.001, 15.0))
    flown.on_report(TargetReport(0, 58.001, 15.0, 100.0), 500_000)
    flown.divert(100.0, (58.002, 15.0))
    flown.divert(100.0, (58.003, 15.0))
    flown.on_report(TargetReport(0, 58.002, 15.0, 100.0), 700_000)
    assert flown._aside == GoToOrder(58.0, 15.0, 100.0)
    flown.on_report(TargetReport(0, 58.0005, 15.0, 100.0), 900_000)
    assert flown._aside == GoToOrder(58.0005, 15.0, 100.0), "another station's is another's"
