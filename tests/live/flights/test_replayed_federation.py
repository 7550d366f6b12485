"""Recorded flights as platforms of one federation: what is federated is what the same filter gives offline.

The logs are not ours to ship: DYKNOW_FLIGHT_DATA names the directory that holds them.
"""

import os
import statistics
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from dyknow.federation.messages.contents import Query, Samples
from dyknow.proxies.recordings.formats import open_recording
from dyknow.proxies.recordings.mcap_log import JournalRecording
from dyknow.proxies.recordings.replay import schedule
from tests.live.flights.federated import POSITION, Federated
from tests.live.flights.replays import PERIOD_US, Flown, crossings, file, fixes, fly_out, flying, gaps, watch
from tests.live.flights.test_real_flights import (
    DATAFLASH,
    EPOCH_US,
    PX4,
    TELEMETRY,
    Place,
    both_airborne,
    interpolated,
    raw,
    separation,
)
from tests.navigation.offline import run_filter

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif("DYKNOW_FLIGHT_DATA" not in os.environ, reason="DYKNOW_FLIGHT_DATA names no directory of logs"),
]

S = 1_000_000
SOURCES = {DATAFLASH: "GPS", PX4: "vehicle_gps_position"}
WHOLE_S = 209.0  # the dataflash log's fixes
TRIES, PAUSE_S = 3, 1.0  # a machine that stands still for two seconds makes a platform gone for a moment
SKIPPED = 5  # estimates that a process skips which is late by 50 ms once, at ten times the speed


def recorded(name: str, from_s: float) -> dict:
    return {"kind": "replay", "file": file(name), "from_us": round(from_s * S)}


def fly_both(
    directory: Path, delay_s: float, from_s: float, for_s: float, speed: float, patience_s: float = 2.0
) -> Flown:
    """Telemetry and dataflash log, aligned by `delay_s`, from and for so many seconds of the latter."""
    vehicles = {"tel": recorded(TELEMETRY, delay_s + from_s), "fla": recorded(DATAFLASH, from_s)}
    with flying(directory, vehicles, speed, patience_s) as (federation, flown):
        flown.ends_us = flown.epoch_us + round(for_s * S) - S
        watch(federation, flown, flown.epoch_us + round(for_s * S / 2))
        ask_both(federation, flown)
        watch(federation, flown, flown.epoch_us + round(for_s * S))
        fly_out(federation, flown, 3 * S)
    return flown


def ask_both(federation: Federated, flown: Flown) -> None:
    now_us = federation.client.federation_us()
    at_us = (now_us - 2 * S) // PERIOD_US * PERIOD_US
    for unit in federation.fleet.running:
        for op, when in (
            ("latest", {}),
            ("at", {"at_us": at_us}),
            ("between", {"from_us": at_us - 2 * S, "to_us": at_us}),
        ):
            question = Query(semantic_label=POSITION, op=op, **when)
            for _ in range(TRIES):
                answers = flown.answers[f"{unit} {op}"] = federation.ask(unit, question)
                if any(isinstance(each, Samples) for each in answers):
                    break
                federation.wait_for(lambda: False, PAUSE_S)


def as_offline(flown: Flown, a: str, b: str, least: int) -> None:
    """The federated separation is that of the filter run offline, sample by sample."""
    live, offline = flown.live_apart(a, b), flown.offline_apart(a, b)
    shared = live.keys() & offline.keys()
    assert len(shared) > least
    missing = [(at_us - flown.epoch_us) / S for at_us in sorted(offline.keys() - live.keys())]
    most = max(SKIPPED, 0.01 * len(offline))
    assert len(missing) <= most, f"nearly all of them were federated; not those at {missing} s"
    largest_m = max(abs(live[at] - offline[at]) for at in shared)
    sys.stdout.write(f"federated and offline differ by {largest_m:.6f} m at most, in {len(shared)} of {len(offline)}\n")
    assert largest_m < 0.05


def again_offline(directory: Path, flown: Flown, unit: str) -> None:
    """The node's journal is a recording of its flight: filtered again it gives the estimates that were federated."""
    recording = open_recording(directory / f"{unit}.mcap")
    reports = ((report, at_us) for at_us, report in schedule(recording, recording.first_position_us))
    found = {sample.valid_us: sample.value for sample in run_filter(reports, PERIOD_US)}
    settled = [at for at in flown.live[unit] if flown.epoch_us + 2 * S < at < flown.ends_us]
    assert len(settled) > 100
    assert max(separation(Place(*flown.live[unit][at]), Place(*found[at][:3]))[0] for at in settled) < 0.05


def with_the_edges_of_the_filter(flown: Flown, a: str, b: str) -> None:
    expected = crossings(flown.offline_apart(a, b))
    for by in (a, b):
        found = flown.edges(by)
        assert [event for event, _ in found] == [event for event, _ in expected]
        for (_, at_us), (_, due_us) in zip(found, expected, strict=True):
            assert abs(at_us - due_us) <= PERIOD_US


def queried(flown: Flown) -> None:
    """Each platform answered with what it streams."""
    for unit, track in flown.live.items():
        for op in ("latest", "at", "between"):
            [said] = flown.answers[f"{unit} {op}"]
            assert isinstance(said, Samples), said
            assert said.samples or op == "between"
            for sample in said.samples:
                assert (sample.value["latitude_deg"], sample.value["longitude_deg"]) == track[sample.valid_us][:2]


def near(flown: Flown, a: str, b: str, place_of: Callable[[str, int], Place | None]) -> None:
    """The federated separation is that of raw fixes, give or take what they differ by among themselves."""
    errors = []
    for at_us, metres in flown.live_apart(a, b).items():
        pair = place_of(a, at_us), place_of(b, at_us)
        if pair[0] is not None and pair[1] is not None:
            errors.append(abs(metres - separation(*pair)[0]))
    assert len(errors) > 50
    sys.stdout.write(
        f"of {len(errors)} raw separations: {statistics.median(errors):.3f} m in median, "
        f"{statistics.quantiles(errors, n=20)[-1]:.3f} m at the 95th percentile\n"
    )
    assert statistics.median(errors) < 0.6
    assert statistics.quantiles(errors, n=20)[-1] < 2.5


def near_the_raw_fixes(flown: Flown, delay_s: float, from_s: float) -> None:
    """While both are airborne."""

    def place_of(unit: str, at_us: int) -> Place | None:
        pair = both_airborne(round(delay_s * S), at_us - flown.epoch_us + EPOCH_US + round(from_s * S))
        return None if pair is None else pair[unit == "fla"]

    near(flown, "tel", "fla", place_of)


def at_true_altitudes(flown: Flown) -> None:
    assert all(580 < altitude_m < 640 for _, _, altitude_m in flown.live["tel"].values())


def with_gaps_missing(flown: Flown) -> int:
    """While the log pauses, monitors show that they do not know; how often they were asked in a pause."""
    seen = 0
    for before_us, after_us in gaps(flown.offline["tel"], 12 * S):
        during = [m for at, m in flown.watched if before_us + 9 * S < at < after_us - S]
        assert {m.by for m in during} == {"tel", "fla"}
        assert {(m.inputs, m.shows) for m in during} == {("missing", "unknown")}
        assert all(all("tel" in which for which in m.which) for m in during)
        assert not [a for a in flown.alarms if before_us < a.valid_us < after_us]
        assert {m.inputs for at, m in flown.watched if at > after_us + 5 * S} == {"fresh"}
        seen += len(during)
    return seen


@pytest.mark.parametrize(
    ("delay_s", "from_s", "for_s", "speed"),
    [
        (595, 125, 66, 10.0),
        pytest.param(595, 133, 60, 1.0, marks=pytest.mark.full),
        pytest.param(390, 66, 60, 1.0, marks=pytest.mark.full),
        pytest.param(595, 0, WHOLE_S, 10.0, marks=pytest.mark.full),
        pytest.param(390, 0, WHOLE_S, 10.0, marks=pytest.mark.full),
        pytest.param(480, 0, WHOLE_S, 10.0, marks=pytest.mark.full),
    ],
)
def test_two_real_flights_federate_as_the_filter_has_them(tmp_path, delay_s, from_s, for_s, speed) -> None:
    flown = fly_both(tmp_path, delay_s, from_s, for_s, speed)
    as_offline(flown, "tel", "fla", least=round(8 * for_s))
    near_the_raw_fixes(flown, delay_s, from_s)
    with_the_edges_of_the_filter(flown, "tel", "fla")
    assert len(crossings(flown.offline_apart("tel", "fla"))) >= 3
    queried(flown)
    at_true_altitudes(flown)


@pytest.mark.parametrize(
    ("from_s", "for_s", "speed"),
    [(42, 36, 10.0), pytest.param(0, WHOLE_S, 10.0, marks=pytest.mark.full)],
)
def test_a_gap_and_a_reboot_of_the_log_are_missing_inputs(tmp_path, from_s, for_s, speed) -> None:
    """118 s into it the telemetry log pauses for 18 s, and its vehicle has no home again."""
    flown = fly_both(tmp_path, 120, from_s, for_s, speed, patience_s=0.3)
    as_offline(flown, "tel", "fla", least=round(4 * for_s))
    with_the_edges_of_the_filter(flown, "tel", "fla")
    assert with_gaps_missing(flown) >= 2
    at_true_altitudes(flown)


@pytest.mark.full
def test_a_journal_flies_again_as_it_flew(tmp_path) -> None:
    """The journals of two replays, replayed: the same separation, at the same distance from the epoch."""
    first, again = tmp_path / "first", tmp_path / "again"
    first.mkdir()
    again.mkdir()
    with flying(first, {"one": recorded(DATAFLASH, 110), "two": recorded(PX4, 0)}, 10.0) as (federation, flown):
        federation.until_us(flown.epoch_us + 24 * S)
    journals = {unit: {"kind": "replay", "file": str(first / f"{unit}.mcap")} for unit in ("one", "two")}
    with flying(again, journals, 10.0) as (federation, reflown):
        federation.until_us(reflown.epoch_us + 24 * S)
    for unit, name in (("one", DATAFLASH), ("two", PX4)):
        assert isinstance(open_recording(first / f"{unit}.mcap"), JournalRecording), name
        before, after = fixes(flown.reports[unit], SOURCES[name]), fixes(reflown.reports[unit], SOURCES[name])
        assert len(after[0]) >= 0.95 * len(before[0]) > 50
        assert after[1] == before[1][: len(after[1])]
        steps = [b - a for a, b in zip(before[0], after[0], strict=False)]
        assert max(steps) == min(steps), "moved as a whole"
        assert set(reflown.live[unit]) <= set(reflown.offline[unit])
        assert len(reflown.live[unit]) > 150


@pytest.mark.parametrize("speed", [10.0, pytest.param(1.0, marks=pytest.mark.full)])
def test_a_px4_log_federates_with_itself_three_seconds_later(tmp_path, speed) -> None:
    with flying(tmp_path, {"one": recorded(PX4, 0), "two": recorded(PX4, 3)}, speed) as (federation, flown):
        flown.ends_us = flown.epoch_us + 17 * S
        federation.until_us(flown.epoch_us + 10 * S)
        ask_both(federation, flown)
        fly_out(federation, flown, 2 * S)
    as_offline(flown, "one", "two", least=100)
    with_the_edges_of_the_filter(flown, "one", "two")
    queried(flown)
    again_offline(tmp_path, flown, "one")
    tracks = {unit: fixes(flown.reports[unit], "vehicle_global_position") for unit in ("one", "two")}
    near(flown, "one", "two", lambda unit, at_us: interpolated(tracks[unit], at_us))


@pytest.mark.parametrize(
    "speed", [4.0, pytest.param(1.0, marks=pytest.mark.full), pytest.param(10.0, marks=pytest.mark.full)]
)
def test_a_simulated_vehicle_meets_a_recorded_one(tmp_path, speed) -> None:
    """It hovers in the air where the recorded one passes."""
    times, places = raw(DATAFLASH, 0)
    met = places[min(range(len(times)), key=lambda k: abs(times[k] - EPOCH_US - 128 * S))]
    origin = (met.latitude_deg, met.longitude_deg, met.altitude_m - 40.0)
    simulated = {"kind": "simulated", "scenario": "hover", "origin": origin}
    with flying(tmp_path, {"fla": recorded(DATAFLASH, 110), "sim": simulated}, speed) as (federation, flown):
        flown.ends_us = flown.epoch_us + 38 * S
        federation.until_us(flown.epoch_us + 20 * S)
        ask_both(federation, flown)
        fly_out(federation, flown, 3 * S)
    as_offline(flown, "fla", "sim", least=250)
    with_the_edges_of_the_filter(flown, "fla", "sim")
    assert [event for event, _ in crossings(flown.offline_apart("fla", "sim"))][:2] == ["opened", "closed"]
    assert min(flown.live_apart("fla", "sim").values()) < 5.0
    queried(flown)
    seen = fixes(flown.reports["sim"], "GLOBAL_POSITION_INT")
    shift_us = EPOCH_US - flown.epoch_us
    near(
        flown,
        "fla",
        "sim",
        lambda unit, at_us: interpolated(
            *((raw(DATAFLASH, 110 * S), at_us + shift_us) if unit == "fla" else (seen, at_us))
        ),
    )
