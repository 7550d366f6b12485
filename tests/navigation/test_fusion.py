import math
import random
import statistics
from itertools import cycle, pairwise

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.navigation import faults
from dyknow.navigation.fusion import Accuracy, PositionFilter
from dyknow.navigation.motion import Measurement, Motion, MotionState
from dyknow.navigation.vehicle import FixReport, PositionReport, VelocityReport
from tests.navigation.flights import HOME, START_US, position_at, straight, wandering
from tests.navigation.offline import run_filter

PERIOD_US = 100_000


def ned(sample) -> tuple[float, float, float]:
    return HOME.to_ned(*sample.value[:3])


@given(
    st.integers(0, 99_999), st.sampled_from([20_000, 50_000, 100_000, 250_000]), st.sampled_from([2.7, 5.0, 10.0, 30.0])
)
@settings(max_examples=25, deadline=None)
def test_samples_lie_on_the_grid_of_the_period_whatever_the_phase_and_rate_of_the_source(phase, period, hertz) -> None:
    found = run_filter(straight(4, hertz=hertz, phase_us=phase), period)
    assert len(found) > 2e6 / period
    assert all(sample.valid_us % period == 0 for sample in found)
    assert all(b.valid_us - a.valid_us == period for a, b in pairwise(found)), "a steady source leaves no hole"
    assert all(b.available_us > a.available_us for a, b in pairwise(found))


def test_the_estimate_is_better_than_its_source_and_close_behind_it() -> None:
    found = run_filter(straight(20, noise_m=0.3, phase_us=37_000), PERIOD_US)
    errors = [math.dist(ned(s), (5.0 * (s.valid_us - START_US - 37_000) / 1e6, 0, -20)) for s in found[10:]]
    assert statistics.mean(errors) < 0.3, "the source alone errs by 0.48 m"
    assert all(s.available_us - s.valid_us <= 105_000 for s in found)


def matrices(state: MotionState) -> tuple[np.ndarray, np.ndarray]:
    """The mean (6,) of places, then speeds, and its covariance (6, 6)."""
    places, between, speeds = (np.diag([axis[at] for axis in state.axes]) for at in (2, 3, 4))
    return np.array((*state.places, *state.speeds)), np.block([[places, between], [between, speeds]])


def test_errors_are_as_large_as_the_covariance_says() -> None:
    """NEES: the squared error over the covariance of six numbers has mean 6 if the filter is consistent."""
    nees = []
    for seed in range(6):
        reports, truth = wandering(200, density=8.0, position_sd=0.5, velocity_sd=0.4, seed=seed)
        unit = PositionFilter(PERIOD_US, wait_us=0)
        states = []
        for report, available_us in reports:
            unit.on_report(report, available_us)
            if isinstance(report, PositionReport):
                states.append(unit._motion.latest)
        frame = unit._frame
        for state, true in list(zip(states, truth, strict=True))[20:]:
            where = frame.to_ned(*HOME.from_ned(*true[:3]))
            mean, covariance = matrices(state)
            error = mean - np.array((*where, *true[3:]))
            nees.append(float(error @ np.linalg.solve(covariance, error)))
    assert statistics.mean(nees) == pytest.approx(6.0, abs=0.6)


def test_stated_accuracy_weighs_the_sources() -> None:
    reports = []
    for k in range(60):
        at_us = START_US + k * 100_000
        reports += [
            (position_at(at_us, (0, 0, -20), "good", horizontal_sd_m=0.2, vertical_sd_m=0.2), at_us),
            (position_at(at_us, (3, 0, -20), "poor", horizontal_sd_m=4.0, vertical_sd_m=4.0), at_us),
        ]
    north = ned(run_filter(reports, PERIOD_US)[-1])[0]
    assert 0 < north < 0.1


def test_a_source_that_states_none_counts_as_a_third_of_a_metre() -> None:
    stated = [
        (r._replace(horizontal_sd_m=0.3, vertical_sd_m=0.3) if isinstance(r, PositionReport) else r, a)
        for r, a in straight(3)
    ]
    assert run_filter(stated, PERIOD_US) == run_filter(straight(3), PERIOD_US)


def test_after_silence_nothing_is_invented_and_the_first_report_brings_it_back() -> None:
    reports = straight(10)
    cut = [(r, a) for r, a in reports if not 3_000_000 <= r.valid_us - START_US < 7_000_000]
    unit = PositionFilter(PERIOD_US)
    found = run_filter(cut, PERIOD_US, filtered=unit)
    inside = [s.valid_us - START_US for s in found if 2_900_000 < s.valid_us - START_US < 7_000_000]
    assert inside == [3_000_000, 3_100_000], "a quarter of a second, two and a half of the source's own intervals"
    back = next(s for s in found if s.valid_us >= START_US + 7_000_000)
    assert back.valid_us == START_US + 7_000_000
    assert abs(ned(back)[0] - 35.0) < 1.0


def test_silence_is_said_with_its_reason_and_since_when() -> None:
    unit = PositionFilter(PERIOD_US)
    assert (unit.health.state, unit.health.reason) == ("stale", faults.NO_POSITION)
    reports = straight(2)
    for report, available_us in reports:
        unit.on_report(report, available_us)
        unit.on_time(available_us)
    assert unit.health.state == "ok"
    while (due_us := unit.deadline_us) is not None:
        unit.on_time(due_us)
    last_us = reports[-1][0].valid_us
    assert unit.health == ("stale", faults.SILENT, last_us)
    assert due_us is None
    assert unit.on_time(last_us + 10_000_000) == []


def test_what_comes_and_is_old_when_it_does_is_late_and_not_silent() -> None:
    """The device's clock stops for 0.6 s after three seconds: what it stamps from then on is as much behind."""
    unit, reasons = PositionFilter(PERIOD_US), []
    for report, available_us in straight(6):
        late_us = 600_000 if report.valid_us > START_US + 3_000_000 else 0
        unit.on_report(report, available_us + late_us)
        unit.on_time(available_us + late_us + 50_000)
        reasons.append(unit.health.reason)
    assert faults.LATE in reasons
    assert reasons[-1] != faults.SILENT


@pytest.mark.parametrize("count", [1, 2, 4, 40])
def test_a_teleport_is_not_believed(count) -> None:
    reports = straight(9)
    forged = [
        (position_at(r.valid_us, (500 + k, 500, -20)), a)
        if isinstance(r, PositionReport) and 3_000_000 <= r.valid_us - START_US < 3_000_000 + count * 100_000
        else (r, a)
        for k, (r, a) in enumerate(reports)
    ]
    unit = PositionFilter(PERIOD_US)
    found = run_filter(forged, PERIOD_US, filtered=unit)
    assert unit.rejected[faults.TELEPORT] == count
    assert all(abs(ned(s)[1]) < 1 for s in found)


def test_a_vehicle_that_really_is_elsewhere_is_found_again_and_was_stale_meanwhile() -> None:
    reports = straight(12)
    moved = [
        (position_at(r.valid_us, (300.0 + k / 20, 400, -20)), a)
        if isinstance(r, PositionReport) and r.valid_us - START_US >= 3_000_000
        else (r, a)
        for k, (r, a) in enumerate(reports)
    ]
    unit, reasons = PositionFilter(PERIOD_US), set()
    found = []
    for report, available_us in moved:
        found += unit.on_report(report, available_us) + unit.on_time(available_us)
        reasons.add((unit.health.state, unit.health.reason))
    assert ("stale", faults.TELEPORT) in reasons
    assert unit.rejected["reacquired"] == 1
    assert unit.health.state == "ok"
    assert all(abs(ned(s)[1]) < 1 or abs(ned(s)[1] - 400) < 1 for s in found), "never in between"


def test_a_second_sender_elsewhere_never_takes_over_while_the_true_one_speaks() -> None:
    both = []
    for r, a in straight(8):
        both.append((r, a))
        if isinstance(r, PositionReport):
            both.append((position_at(r.valid_us + 3_000, (900, 0, -20)), a + 3_000))
    unit = PositionFilter(PERIOD_US)
    found = run_filter(both, PERIOD_US, filtered=unit)
    assert unit.rejected["reacquired"] == 0
    assert all(ned(s)[0] < 50 for s in found)


@pytest.mark.parametrize(
    ("spoilt", "reason"),
    [
        ({"latitude_deg": math.nan}, faults.NOT_FINITE),
        ({"altitude_m": math.inf}, faults.NOT_FINITE),
        ({"horizontal_sd_m": math.nan}, faults.NOT_FINITE),
        ({"latitude_deg": -214.7483648}, faults.OUT_OF_RANGE),
        ({"longitude_deg": 190.0}, faults.OUT_OF_RANGE),
        ({"altitude_m": 1e9}, faults.OUT_OF_RANGE),
        ({"horizontal_sd_m": -1.0}, faults.OUT_OF_RANGE),
        ({"latitude_deg": 0.0, "longitude_deg": 0.0}, faults.NO_FIX),
        ({"valid_us": START_US + 60_000_000}, faults.AHEAD),
    ],
)
def test_what_is_no_position_is_refused_and_becomes_the_reason(spoilt, reason) -> None:
    unit = PositionFilter(PERIOD_US)
    reports = straight(2)
    found = run_filter(reports, PERIOD_US, until_us=reports[-1][1], filtered=unit)
    last = reports[-1][0]
    later = [(last._replace(valid_us=last.valid_us + k * 100_000), reports[-1][1] + k * 100_000) for k in range(1, 9)]
    found += run_filter([(r._replace(**spoilt), a) for r, a in later], PERIOD_US, filtered=unit)
    assert unit.rejected[reason] == 8
    assert (unit.health.state, unit.health.reason) == ("stale", reason)
    assert all(math.isfinite(each) for s in found for each in s.value)


def test_a_frozen_position_of_a_moving_vehicle_is_refused_and_named() -> None:
    reports = straight(8)
    stuck = next(r for r, _ in reports if isinstance(r, PositionReport) and r.valid_us - START_US >= 4_000_000)
    frozen = [
        (stuck._replace(valid_us=r.valid_us), a)
        if isinstance(r, PositionReport) and r.valid_us > stuck.valid_us
        else (r, a)
        for r, a in reports
    ]
    unit = PositionFilter(PERIOD_US)
    found = run_filter(frozen, PERIOD_US, filtered=unit)
    assert (unit.health.state, unit.health.reason) == ("stale", faults.FROZEN)
    assert found[-1].valid_us <= stuck.valid_us + 600_000


def test_a_noisy_source_that_falls_silent_in_its_noise_is_frozen_even_at_rest() -> None:
    rng, reports = random.Random(3), []
    for k in range(80):
        at_us = START_US + k * 100_000
        where = (rng.gauss(0, 0.1), rng.gauss(0, 0.1), -20) if k < 50 else (0.05, 0.05, -20)
        reports += [(VelocityReport(at_us, "A", 0.0, 0.0, 0.0), at_us), (position_at(at_us, where), at_us)]
    unit = PositionFilter(PERIOD_US)
    run_filter(reports, PERIOD_US, filtered=unit)
    assert unit.health.reason == faults.FROZEN


def test_a_parked_vehicle_without_noise_is_not_accused() -> None:
    reports = [(position_at(START_US + k * 100_000, (0, 0, 0)), START_US + k * 100_000) for k in range(100)]
    unit = PositionFilter(PERIOD_US)
    assert len(run_filter(reports, PERIOD_US, until_us=START_US + 9_900_000, filtered=unit)) == 100
    assert unit.health.state == "ok"


def test_without_an_altitude_there_is_no_estimate_and_with_one_there_is() -> None:
    bare = [(r._replace(altitude_m=None) if isinstance(r, PositionReport) else r, a) for r, a in straight(4)]
    known = [(r, a) for r, a in straight(8) if r.valid_us - START_US >= 4_000_000]
    found = run_filter(bare + known, PERIOD_US)
    assert found[0].valid_us == START_US + 4_000_000
    assert abs(ned(found[0])[2] + 20) < 1


def test_when_only_the_altitude_goes_the_reason_says_so() -> None:
    reports = [
        (r._replace(altitude_m=None) if isinstance(r, PositionReport) and r.valid_us - START_US > 3_000_000 else r, a)
        for r, a in straight(6)
    ]
    unit = PositionFilter(PERIOD_US)
    found = run_filter(reports, PERIOD_US, filtered=unit)
    assert (unit.health.state, unit.health.reason) == ("stale", faults.NO_ALTITUDE)
    assert found[-1].valid_us <= START_US + 3_300_000


def test_an_altitude_that_comes_less_often_than_the_place_makes_no_flicker() -> None:
    """ArduPilot without a home: GLOBAL_POSITION_INT without altitude at 10 Hz, the receiver's at 2 Hz."""
    reports = [
        (r._replace(altitude_m=None) if isinstance(r, PositionReport) and (r.valid_us - START_US) % 500_000 else r, a)
        for r, a in straight(10)
    ]
    unit, states = PositionFilter(PERIOD_US), []
    for report in reports:
        run_filter([report], PERIOD_US, until_us=report[1], filtered=unit)
        states.append(unit.health.state)
    assert states[2:] == ["ok"] * len(states[2:])


def test_without_satellites_the_estimate_says_so_and_is_ever_less_certain_until_they_are_back() -> None:
    lost_us, back_us = START_US + 4_000_000, START_US + 14_000_000
    fixes = [
        (FixReport(START_US, True), START_US),
        (FixReport(lost_us, False), lost_us),
        (FixReport(back_us, True), back_us),
    ]
    reports = sorted([*straight(30), *fixes], key=lambda each: each[1])
    unit, found, reasons = PositionFilter(PERIOD_US), [], []
    for report in reports:
        found += run_filter([report], PERIOD_US, until_us=report[1], filtered=unit)
        reasons.append(unit.health[:2])
    assert list(dict.fromkeys(reasons)) == [("stale", faults.NO_POSITION), ("ok", ""), ("ok", faults.NO_GPS)]
    assert reasons[-1] == ("ok", "")
    sd_m = {round((s.valid_us - START_US) / 1e6, 1): math.sqrt(s.value.var_e) for s in found}
    assert sd_m[3.9] < 0.5
    assert sd_m[6.0] == pytest.approx(1.0, abs=0.2)
    assert sd_m[14.0] == pytest.approx(5.0, abs=0.2)
    assert sd_m[20.0] == pytest.approx(5.0, abs=0.2), "an autopilot may take a while to believe its satellites again"
    assert sd_m[25.0] < 0.5
    assert max(s.value.var_d for s in found[10:]) < 0.2, "the height comes from the air's pressure"


def test_the_jump_back_to_the_satellites_after_they_were_lost_is_believed() -> None:
    lost_us, back_us = START_US + 4_000_000, START_US + 24_000_000
    fixes = [
        (FixReport(START_US, True), START_US),
        (FixReport(lost_us, False), lost_us),
        (FixReport(back_us, True), back_us),
    ]
    east = [
        (position_at(r.valid_us, (5.0 * (r.valid_us - START_US) / 1e6, 25.0, -20.0)), a)
        if isinstance(r, PositionReport) and r.valid_us > back_us
        else (r, a)
        for r, a in straight(30)
    ]
    unit = PositionFilter(PERIOD_US)
    found = run_filter(sorted([*east, *fixes], key=lambda each: each[1]), PERIOD_US, filtered=unit)
    assert unit.rejected[faults.TELEPORT] == 0
    assert ned(found[-1])[1] == pytest.approx(25.0, abs=1.0)


def test_a_vehicle_that_never_had_satellites_is_as_certain_as_it_says() -> None:
    found = run_filter([(FixReport(START_US, False), START_US), *straight(20)], PERIOD_US)
    assert found[-1].value.var_e < 0.2


@given(st.lists(st.tuples(st.integers(1, 3_000_000), st.floats(-50, 50), st.booleans()), min_size=1, max_size=30))
@settings(max_examples=50, deadline=None)
def test_the_axes_are_the_filter_of_six_numbers_that_filterpy_has(measured) -> None:
    start = Measurement(0, "position", (0.0, 0.0, 0.0), (0.1, 0.1, 0.1))
    motion, peer = Motion(start, lambda _a, _b: (0.1, -0.2, 0.3), (8.0, 4.0)), KalmanFilter(dim_x=6, dim_z=3)
    places, speeds = np.diag((1.0, 1.0, 1.0, 0.0, 0.0, 0.0)), np.diag((0.0, 0.0, 0.0, 1.0, 1.0, 1.0))
    shift = np.eye(6, k=3)
    at_us = 0
    for step_us, value, moves in measured:
        at_us += step_us
        peer.x, peer.P = matrices(motion.latest)
        dt = step_us / 1e6
        noise = 4.0 * (dt**3 / 3 * places + dt * dt / 2 * (shift + shift.T) + dt * speeds)
        push = dt * dt / 2 * np.eye(6)[:, :3] + dt * np.eye(6)[:, 3:]
        peer.predict(u=np.array((0.1, -0.2, 0.3)), B=push, F=np.eye(6) + dt * shift, Q=noise)
        kind = "velocity" if moves else "position"
        each = Measurement(at_us, kind, (value, -value, 1.0), (0.1, 0.2, 0.3))
        peer.update(np.array(each.values), R=np.diag(each.variances), H=np.eye(6)[3:] if moves else np.eye(6)[:3])
        motion.fuse(each)
        mean, covariance = matrices(motion.latest)
        assert np.allclose(mean, peer.x, rtol=1e-9, atol=1e-12)
        assert np.allclose(covariance, peer.P, rtol=1e-9, atol=1e-12)


def test_a_late_report_is_fused_where_it_belongs() -> None:
    def fused(order: list[int]) -> Motion:
        start = Measurement(0, "position", (0.0, 0.0, 0.0), (0.1, 0.1, 0.1))
        motion = Motion(start, lambda _a, _b: None, (8.0, 4.0))
        for k in order:
            motion.fuse(Measurement(k * 50_000, "position", (k * 0.3, -k * 0.1, 0.0), (0.1, 0.1, 0.1)))
        return motion

    straight_on, mixed = fused([1, 2, 3, 4, 5]).latest, fused([2, 1, 5, 3, 4]).latest
    assert np.allclose(straight_on.axes, mixed.axes, atol=1e-12)


@given(st.lists(st.integers(0, 400_000), min_size=40, max_size=40), st.integers(0, 1000))
@settings(max_examples=15, deadline=None)
def test_jitter_reorders_reports_and_estimates_stay_good(delays, seed) -> None:
    reports = straight(2, seed=seed)
    jittered = sorted(((r, r.valid_us + delays[k % 40]) for k, (r, _) in enumerate(reports)), key=lambda each: each[1])
    found = run_filter(jittered, PERIOD_US)
    assert all(b.valid_us > a.valid_us for a, b in pairwise(found))
    assert all(math.dist(ned(s), (5.0 * (s.valid_us - START_US) / 1e6, 0, -20)) < 2.5 for s in found)


@given(st.lists(st.integers(2_000, 70_000), min_size=1, max_size=200))
@settings(max_examples=20, deadline=None)
def test_when_timers_fire_does_not_matter_only_when_reports_come(ticks) -> None:
    """Live, the loop wakes late or needlessly; offline, exactly. Values and valid times are the same."""
    reports = straight(3, phase_us=61_000)
    unit, found, woken = PositionFilter(PERIOD_US), [], cycle(ticks)
    now_us = START_US
    for report, available_us in reports:
        while (now_us := now_us + next(woken)) < available_us:
            found += unit.on_time(now_us)
        now_us = available_us
        found += unit.on_report(report, available_us)
    offline = run_filter(reports, PERIOD_US, until_us=reports[-1][1])
    assert [(s.valid_us, s.value) for s in found] == [(s.valid_us, s.value) for s in offline][: len(found)]
    assert len(offline) - len(found) <= 1


@given(st.data())
@settings(max_examples=40, deadline=None)
def test_no_sequence_of_reports_makes_it_raise_or_leave_the_grid(data) -> None:
    number = st.floats(allow_nan=True, allow_infinity=True)
    times = st.integers(START_US - 10_000_000, START_US + 10_000_000)
    positions = st.builds(
        PositionReport, times, st.sampled_from("AB"), number, number, number | st.none(), number | st.none()
    )
    near = times.map(lambda t: position_at(t, ((t % 1000) / 100, 0, -20)))
    velocities = st.builds(VelocityReport, times, st.just("A"), number, number, number | st.none(), number | st.none())
    reports = data.draw(st.lists(st.one_of(positions, near, near, velocities), max_size=60))
    available = sorted(data.draw(st.lists(times, min_size=len(reports), max_size=len(reports))))
    found = run_filter(list(zip(reports, available, strict=True)), PERIOD_US)
    assert all(s.valid_us % PERIOD_US == 0 and all(map(math.isfinite, s.value)) for s in found)
    assert all(b.valid_us > a.valid_us for a, b in pairwise(found))


def test_a_long_flight_moves_its_frame_along_and_loses_nothing() -> None:
    reports = straight(300, hertz=5.0, speed_m_s=60.0)
    found = run_filter(reports, PERIOD_US)
    last = found[-20]
    assert abs(ned(last)[0] - 60.0 * (last.valid_us - START_US) / 1e6) < 1.0
    assert abs(last.value[3] - 60.0) < 0.5
    assert abs(HOME.from_ned(*ned(last))[2] - last.value[2]) < 1e-3


def test_a_flight_after_a_clock_set_back_is_taken_up_again() -> None:
    early = [(r._replace(valid_us=r.valid_us + 30_000_000), a + 30_000_000) for r, a in straight(3)]
    unit = PositionFilter(PERIOD_US)
    run_filter(early, PERIOD_US, until_us=early[-1][1], filtered=unit)
    behind = [(r._replace(valid_us=r.valid_us + 11_000_000), a + 33_000_000) for r, a in straight(30)]
    found = run_filter(behind, PERIOD_US, until_us=behind[-1][1], filtered=unit)
    assert unit.rejected[faults.TOO_LATE] >= 1
    assert unit.rejected["reacquired"] == 1
    assert found[0].valid_us > early[-1][0].valid_us
    assert found[-1].valid_us > START_US + 40_500_000


def test_an_impossible_period_is_refused() -> None:
    with pytest.raises(ValueError, match="period"):
        PositionFilter(0)


def test_measured_acceleration_carries_the_estimate_through_a_turn() -> None:
    from dyknow.navigation.vehicle import AccelerationReport, AttitudeReport

    def north_error(*, inertial: bool) -> float:
        reports, truth = [], {}
        for k in range(400):
            at_us, t = START_US + k * 20_000, k * 0.02
            where, push = 10 * math.sin(t), -10 * math.sin(t)
            truth[at_us] = where
            if inertial:
                reports.append((AttitudeReport(at_us, "A", 0.0, 0.0, 0.0), at_us))
                reports.append((AccelerationReport(at_us, "A", push, 0.0, -9.80665), at_us))
            if k % 20 == 0:
                reports.append((position_at(at_us, (where, 0, -20)), at_us))
        accuracy = Accuracy(density=20.0, density_inertial=0.5)
        unit = PositionFilter(PERIOD_US, accuracy=accuracy, wait_us=10_000)
        found = run_filter(reports, PERIOD_US, filtered=unit)
        return max(
            abs(ned(s)[0] - truth[s.valid_us]) for s in found if s.valid_us in truth and s.valid_us > START_US + 3e6
        )

    assert north_error(inertial=True) < 0.4 * north_error(inertial=False)
