"""Two real quadcopter flights over one field, replayed into one time: the readers, the schedule and the filter.

The files are not ours to ship: DYKNOW_FLIGHT_DATA names the directory that holds them.
"""

import bisect
import itertools
import math
import os
import queue
import statistics
import time
from collections import Counter
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from dyknow.federation.members.clock import FederationClock
from dyknow.navigation.fusion import PositionFilter
from dyknow.navigation.geodesy import distance_m
from dyknow.navigation.vehicle import BatteryReport, HomeReport, PositionReport, Report, StatusReport
from dyknow.proxies.recordings.formats import open_recording
from dyknow.proxies.recordings.recording import Recording
from dyknow.proxies.recordings.replay import Replay, schedule
from tests.navigation.offline import run_filter

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif("DYKNOW_FLIGHT_DATA" not in os.environ, reason="DYKNOW_FLIGHT_DATA names no directory of logs"),
]

EPOCH_US = 1_700_000_000_000_000
PERIOD_US = 100_000
STEP_US = 50_000
TELEMETRY, DATAFLASH, PX4 = "dronekit_copter_flight.tlog", "dronekit_la_log171.bin", "pyulog_sample_px4_events.ulg"


class Place(NamedTuple):
    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    height_m: float = 0.0


@cache
def opened(name: str) -> Recording:
    return open_recording(Path(os.environ["DYKNOW_FLIGHT_DATA"]) / name)


@cache
def raw(name: str, from_us: int) -> tuple[list[int], list[Place]]:
    """Fixes as the log has them, on the federation's time."""
    recording, times, places = opened(name), [], []
    for _, report in schedule(recording, EPOCH_US, from_us, since_us=0):
        if (
            isinstance(report, PositionReport)
            and report.source == recording.reference
            and report.altitude_m is not None
        ):
            ground = places[0].altitude_m if places else report.altitude_m
            height = report.altitude_m - ground if report.height_m is None else report.height_m
            times.append(report.valid_us)
            places.append(Place(report.latitude_deg, report.longitude_deg, report.altitude_m, height))
    return times, places


def interpolated(track: tuple[list[int], list[Place]], at_us: int) -> Place | None:
    """Linear between the fixes around an instant; None over gaps of more than 2 s."""
    times, places = track
    k = bisect.bisect_right(times, at_us) - 1
    if k < 0 or k + 1 >= len(times) or times[k + 1] - times[k] > 2_000_000:
        return None
    share = (at_us - times[k]) / (times[k + 1] - times[k])
    return Place(*(a + share * (b - a) for a, b in zip(places[k], places[k + 1], strict=True)))


def separation(a: Place, b: Place) -> tuple[float, float, float]:
    """3-D, horizontal, vertical (first above second)."""
    level = distance_m(a.latitude_deg, a.longitude_deg, b.latitude_deg, b.longitude_deg)
    return math.hypot(level, a.altitude_m - b.altitude_m), level, a.altitude_m - b.altitude_m


def both_airborne(delay_us: int, at_us: int) -> tuple[Place, Place] | None:
    a, b = interpolated(raw(TELEMETRY, delay_us), at_us), interpolated(raw(DATAFLASH, 0), at_us)
    return (a, b) if a is not None and b is not None and a.height_m > 2 and b.height_m > 2 else None


def filtered(name: str, from_us: int) -> dict[int, Place]:
    reports = ((report, at_us) for at_us, report in schedule(opened(name), EPOCH_US, from_us))
    return {s.valid_us: Place(*s.value[:3]) for s in run_filter(reports, PERIOD_US)}


@pytest.mark.parametrize(
    ("delay_s", "smallest", "level", "steep", "at_s", "under_20_s", "airborne_s"),
    [(595, 8.70, 8.00, 3.42, 163.7, 33.3, 65.1), (390, 1.77, 1.28, -1.23, 96.1, 70.7, 124.1)],
)
def test_raw_fixes_of_both_logs_meet_as_their_description_says(
    delay_s, smallest, level, steep, at_s, under_20_s, airborne_s
) -> None:
    found = []
    for at_us in range(EPOCH_US, EPOCH_US + 300_000_000, STEP_US):
        pair = both_airborne(delay_s * 1_000_000, at_us)
        if pair is not None:
            found.append((*separation(*pair), at_us))
    closest = min(found)
    assert closest[:3] == pytest.approx((smallest, level, steep), abs=0.02)
    assert (closest[3] - EPOCH_US) / 1e6 == pytest.approx(at_s, abs=0.06)
    assert sum(each[0] < 20 for each in found) * STEP_US / 1e6 == pytest.approx(under_20_s, abs=0.2)
    assert len(found) * STEP_US / 1e6 == pytest.approx(airborne_s, abs=0.1)


@pytest.mark.parametrize("delay_s", [595, 390, 480])
def test_the_filter_keeps_the_separation_of_the_raw_fixes(delay_s) -> None:
    ours, theirs = filtered(TELEMETRY, delay_s * 1_000_000), filtered(DATAFLASH, 0)
    errors = []
    for at_us in sorted(ours.keys() & theirs.keys()):
        pair = both_airborne(delay_s * 1_000_000, at_us)
        if pair is not None:
            errors.append(abs(separation(ours[at_us], theirs[at_us])[0] - separation(*pair)[0]))
    assert len(errors) > 500
    assert statistics.median(errors) < 0.6
    assert statistics.quantiles(errors, n=20)[-1] < 2.5


def test_gaps_of_the_telemetry_stay_gaps() -> None:
    times, _ = raw(TELEMETRY, 0)
    gaps = [(a, b) for a, b in itertools.pairwise(times) if b - a > 3_000_000]
    assert gaps, "the log pauses for up to 18.8 s"
    estimates = filtered(TELEMETRY, 0)
    satellites = [
        report.valid_us
        for _, report in schedule(opened(TELEMETRY), EPOCH_US, 0, since_us=0)
        if isinstance(report, PositionReport) and report.altitude_m is not None
    ]
    for before, after in gaps:
        last = max(each for each in satellites if each < after - 2_000_000)
        inside = [at for at in estimates if last + 1_000_000 < at < after - 2_000_000 and at > before]
        assert not inside, "nothing further than a second beyond the last fix"


def test_altitudes_from_before_home_was_set_are_not_used() -> None:
    fixes = [
        report
        for _, report in schedule(opened(TELEMETRY), EPOCH_US, 0, since_us=0)
        if isinstance(report, PositionReport)
    ]
    bare = [each for each in fixes if each.altitude_m is None]
    assert len(bare) > 200
    assert all(580 < each.altitude_m < 640 for each in fixes if each.altitude_m is not None)
    rebooted = [each for each in bare if each.valid_us > EPOCH_US + 188_000_000]
    assert rebooted, "after its reboot the vehicle has no home again"
    assert all(580 < place.altitude_m < 640 for place in filtered(TELEMETRY, 0).values())


def test_only_the_vehicle_is_read_from_a_log_of_three_systems() -> None:
    kinds = Counter(type(report).__name__ for _, report in opened(TELEMETRY).reports())
    assert kinds["StatusReport"] == 1047, "the heartbeats of system 1; the ground station's 1374 are not"
    assert kinds["PositionReport"] == 2684 + 2710


def test_a_dataflash_log_tells_time_home_battery_and_state() -> None:
    recording = opened(DATAFLASH)
    assert time.strftime("%Y-%m-%d", time.gmtime(recording.first_position_us / 1e6)) == "2015-11-21"
    found = [report for _, report in recording.reports()]
    fixes = [each for each in found if isinstance(each, PositionReport)]
    assert len(fixes) == 1038
    assert (round(min(f.altitude_m for f in fixes), 1), round(max(f.altitude_m for f in fixes), 1)) == (589.3, 601.7)
    assert next(each for each in found if isinstance(each, HomeReport)).altitude_m == pytest.approx(588.92)
    assert any(each.armed for each in found if isinstance(each, StatusReport))
    levels = [each.fraction for each in found if isinstance(each, BatteryReport)]
    assert levels[0] > levels[-1] > 0


def test_a_px4_log_is_read_as_the_reference_parser_reads_it() -> None:
    from pyulog import ULog

    path = Path(os.environ["DYKNOW_FLIGHT_DATA"]) / PX4
    reference = ULog(str(path))
    from dyknow.proxies.recordings.ulog import UlogRecording

    topics = frozenset({"vehicle_gps_position", "vehicle_global_position", "vehicle_local_position", "sensor_combined"})
    rows: dict[str, list[dict]] = {}
    for topic, row in UlogRecording(path).rows(topics):
        rows.setdefault(topic, []).append(row)
    for topic in topics:
        expected = reference.get_dataset(topic).data
        assert len(rows[topic]) == len(expected["timestamp"])
        for name in expected:
            ours, theirs = [row[name] for row in rows[topic]], expected[name].tolist()
            assert all(a == b or (math.isnan(a) and math.isnan(b)) for a, b in zip(ours, theirs, strict=True)), name


def test_the_px4_flight_hovers_at_two_metres() -> None:
    estimates = filtered(PX4, 0)
    heights = [place.altitude_m - 487.95 for place in estimates.values()]
    assert 1.5 < max(heights) < 3.0
    assert all(distance_m(p.latitude_deg, p.longitude_deg, 47.3977418, 8.5455939) < 3.0 for p in estimates.values())


@pytest.mark.parametrize("speed", [4.0, 10.0])
def test_two_replays_share_one_time_and_what_they_gave_live_is_had_offline(speed) -> None:
    """The journal of a live replay (report, available time), filtered again offline, gives the same samples.

    It lasts until the two have estimates for more than 60 common instants, so they lie on one grid.
    """
    recordings = [(opened(TELEMETRY), 480_000_000), (opened(DATAFLASH), 90_000_000)]
    began_us = time.time_ns() // 1000
    clock = FederationClock(began_us, speed)

    def now_us() -> int:
        return clock.federation_us(time.time_ns() // 1000)

    mailbox: queue.Queue[tuple[str, Report, int]] = queue.Queue()
    units = {name: PositionFilter(PERIOD_US) for name in (TELEMETRY, DATAFLASH)}
    replays = [
        Replay(recording, began_us, from_us, lambda r, n=name: mailbox.put((n, r, now_us())), now_us, speed=speed)
        for name, (recording, from_us) in zip(units, recordings, strict=True)
    ]
    journals: dict[str, list[tuple[Report, int]]] = {name: [] for name in units}
    live: dict[str, list] = {name: [] for name in units}
    for replay in replays:
        replay.start()
    while len(set.intersection(*({s.valid_us for s in samples} for samples in live.values()))) <= 60:
        name, report, at_us = mailbox.get(timeout=20)
        journals[name].append((report, at_us))
        live[name] += units[name].on_report(report, at_us)
        for other, unit in units.items():
            live[other] += unit.on_time(at_us) if not mailbox.qsize() else []
    for replay in replays:
        replay.stop()
    for name, samples in live.items():
        offline = run_filter(journals[name], PERIOD_US)
        assert [(s.valid_us, s.value) for s in samples] == [(s.valid_us, s.value) for s in offline][: len(samples)]
