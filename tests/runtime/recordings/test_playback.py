"""A recording that is played gives its platforms what they had: labels, samples, alarms, all moved by one amount."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.agents.capabilities.flight.options import AvoidanceOptions
from dyknow.agents.config import PlatformConfig
from dyknow.agents.monitoring.alarm_log import AlarmLog
from dyknow.agents.options import Chosen
from dyknow.agents.playback.recorded_platform import OffersPlayed, Played, PlayedSample, RecordedPlatform
from dyknow.federation.messages.contents import MonitorProximity, Query, Samples
from dyknow.runtime.configuration.config import RecordedVehicle
from dyknow.runtime.recordings.playback import Playback, schedule, shift_us
from dyknow.runtime.recordings.recorded import FederationRecording
from dyknow.runtime.recordings.recording_file import ACT, ALARM, PLATFORM, SAMPLE, RecordingFile
from dyknow.runtime.recordings.summary import summary_of
from tests.box import Box, P
from tests.console.commands.recordings.encounter import EXAMPLE

Edge = tuple[str, str, str, tuple[str, ...], int]
FOUND = summary_of(FederationRecording(EXAMPLE))
FIRST_US = FOUND.first_us
LABELS = ("heli-position", "heli-altitude", "heli-velocity")


def recorded(begin_us: int, from_us: int = 0, **more: Any) -> RecordedVehicle:
    return RecordedVehicle(
        first_us=FIRST_US, from_us=from_us, begin_us=begin_us, **{"file": EXAMPLE, "labels": LABELS, **more}
    )


def join(world: Box, unit: str) -> None:
    """A platform that is played back: without a vehicle."""
    config = PlatformConfig(
        unit, 0, clock=world.clock, options=Chosen(AvoidanceOptions(avoidance=False)), extensions=(RecordedPlatform,)
    )
    world.add(unit, config)


def play(world: Box, played: RecordedVehicle, units: tuple[str, ...] = ("0", "1")) -> None:
    """Platforms of the recording live in the world, and all is played to its end."""
    happen: list[tuple[int, str, Any]] = []
    for unit in units:
        join(world, unit)
        for at_us, what in schedule(FederationRecording(played.file), unit, played):
            event = what if isinstance(what, OffersPlayed) else Played(0, (what,))
            happen.append((at_us, unit, event))
    world.run(1.0)
    for at_us, unit, event in sorted(happen, key=lambda each: each[0]):
        world.at(max(at_us, world.now_us), lambda unit=unit, event=event: world.happens(unit, event))  # type: ignore[misc]
    world.run((FOUND.last_us - FIRST_US) / 1e6 + 4.0)


def edges(world: Box, moved_us: int) -> list[Edge]:
    return sorted(
        (each.event, each.monitor, unit, each.units, each.valid_us - moved_us)
        for unit, platform in world.platforms.items()
        for each in platform.part(AlarmLog).events
    )


def edges_recorded() -> list[Edge]:
    return sorted(
        (event, each.monitor, each.by, each.units, valid_us)
        for each in FOUND.alarms.values()
        for event, valid_us in each.edges
    )


def test_the_same_alarms_are_raised_with_the_same_edges_and_streams_have_the_same_values() -> None:
    world = Box()
    played = recorded(world.now_us + 2_000_000)
    play(world, played)
    moved_us = shift_us(played.first_us, 0, played.begin_us)
    assert moved_us % 1_000_000 == 0
    assert edges(world, moved_us) == edges_recorded()
    wanted = {
        each.message["valid_us"]: each.message["value"]["altitude_m"]
        for each in FederationRecording(EXAMPLE).messages(lambda topic: topic == "/1/heli-altitude")
    }
    world.centre()
    world.run(0.5)
    between = Query(semantic_label="heli-altitude", op="between", from_us=0, to_us=world.now_us)
    answers = world.asked("cc", "1", between, P.QUERY_REF).contents
    samples = [each for page in answers if isinstance(page, Samples) for each in page.samples]
    assert {each.valid_us - moved_us: each.value["altitude_m"] for each in samples} == pytest.approx(wanted)


def test_speech_acts_are_in_the_log_again_marked_as_recorded_and_nothing_is_done_on_them() -> None:
    world = Box()
    play(world, recorded(world.now_us + 3_000_000))
    acts = [each for each in FederationRecording(EXAMPLE).messages() if each.schema == ACT]
    assert len(acts) > 20
    for unit in ("0", "1"):
        audit_log = world.platforms[unit].part(RecordedPlatform)._audit_log
        played = [entry for entry in audit_log.entries if entry.outcome.startswith("recorded: ")]
        told = [each.message for each in acts if each.message["by"] == unit]
        assert [(entry.direction, entry.peer, entry.outcome.removeprefix("recorded: ")) for entry in played] == [
            (each["direction"], each["peer"], each["outcome"]) for each in told
        ]
        whole = [each["act"] for each in told if "act" in each and not each["act"].endswith("...")]
        assert [str(entry.act) for entry in played if entry.act is not None] == whole
        assert not audit_log.refused["recorded"]


def test_from_a_time_on_the_alarms_that_were_open_come_first_and_the_newest_samples_with_them() -> None:
    world = Box()
    from_us = 10_000_000
    played = recorded(world.now_us + 2_000_000, from_us)
    play(world, played)
    moved_us = shift_us(FIRST_US, from_us, played.begin_us)
    kept = [
        edge
        for edge in edges_recorded()
        if edge[4] >= FIRST_US + from_us - 500_000
        or (edge[0] == "opened" and edge[1] in {"proximity-warn", "proximity"})
    ]
    assert edges(world, moved_us) == sorted(set(kept))
    due = [*schedule(FederationRecording(EXAMPLE), "0", played)]
    assert isinstance(due[0].what, OffersPlayed), "also before anything is played"
    assert due[0].at_us == 0
    before = [each for each in due if each.at_us == played.begin_us]
    assert {each.what.label for each in before if isinstance(each.what, PlayedSample)} == set(LABELS)


def test_without_its_alarms_a_recording_is_monitored_again_to_the_same_edges_on_its_grid() -> None:
    world = Box()
    played = recorded(world.now_us + 2_000_000, alarms=False)
    world.centre()
    world.at(
        world.now_us + 1_500_000,
        lambda: world.ask("cc", "0", MonitorProximity(sample_period_s=0.2)),
    )
    play(world, played)
    moved_us = shift_us(FIRST_US, 0, played.begin_us)
    again = {edge[:4]: edge[4] for edge in edges(world, moved_us)}
    for event, monitor, by, units, valid_us in edges_recorded():
        assert again[event, monitor, by, units] == pytest.approx(valid_us, abs=600_000), (event, monitor)


def test_what_is_played_comes_when_it_is_due_and_its_end_is_told_once() -> None:
    now = [0]
    got: list[Any] = []
    ended: list[bool] = []
    playback = Playback(
        recorded(0),
        "0",
        got.append,
        lambda: now[0],
        lambda: 0,
        speed=1000.0,
        on_end=lambda problem: ended.append(not problem),
    )

    def far() -> int:
        now[0] += 3_600_000_000
        return now[0]

    playback._now_us = far
    playback.start()
    playback._thread.join(20)
    assert ended == [True]
    assert isinstance(got[0], OffersPlayed)
    samples = [each for event in got[1:] for each in event.happened if isinstance(each, PlayedSample)]
    assert len(samples) == sum(each.samples for each in FOUND.streams.values() if each.unit == "0")


DIRECTORY = [*FederationRecording(EXAMPLE).messages(lambda topic: topic == "/directory")]
WORLD = Box()
join(WORLD, "0")
ODD: st.SearchStrategy[Any] = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=5) | st.sampled_from(["0", "heli-altitude", "opened"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)
FIELDS = (
    "unit",
    "label",
    "labels",
    "definitions",
    "valid_us",
    "value",
    "by",
    "id",
    "event",
    "covariance",
    "certainty",
    "prediction",
    "direction",
    "peer",
    "outcome",
    "act",
)


@given(
    st.lists(
        st.tuples(st.sampled_from([SAMPLE, ALARM, PLATFORM, ACT]), st.dictionaries(st.sampled_from(FIELDS), ODD)),
        max_size=8,
    )
)
def test_no_message_of_a_hostile_recording_ends_a_platform(
    tmp_path_factory: pytest.TempPathFactory, hostile: list[tuple[str, dict[str, Any]]]
) -> None:
    path = tmp_path_factory.mktemp("hostile") / "a.mcap"
    with RecordingFile(path, {}, lambda: 0) as file:
        for each in DIRECTORY:
            file.add("/directory", PLATFORM, each.message, 0)
        for schema, message in hostile:
            file.add(
                "/0/x", schema, {"unit": "0", "label": "heli-altitude", "valid_us": 1, "value": None, **message}, 1
            )
    world = WORLD
    for _, what in schedule(FederationRecording(path), "0", recorded(0, file=path)):
        world.happens("0", what if isinstance(what, OffersPlayed) else Played(0, (what,)))
    world.run(0.2)
    before_us = world.now_us
    world.run(0.2)
    assert "0" in world.platforms, "it continues"
    assert world.now_us == before_us + 200_000
