"""A platform's journal says what its specification brought forth, since it replays to the same effects."""

import pytest

from dyknow.agents.effects import Fed, LeaveRequested, Specify
from dyknow.agents.platform import Platform
from dyknow.federation.members.clock import FederationClock
from dyknow.model.errors import DecodeError
from dyknow.proxies.recordings.journal_file import CLOCK_EPOCH, CLOCK_SPEED
from dyknow.runtime.configuration.config import NodeConfig
from dyknow.runtime.configuration.resolved import platform_config
from dyknow.runtime.journal.journal import Journal, Journalled
from dyknow.runtime.journal.recorded_runs import recorded_streams

START_US = 1_700_000_000_000_000
TEXT = """
source pos gps
strmgen pos[self] = gps
stream kept = pos[self] with max delay 100
stream sparse = pos[self] with sample every 200
"""


@pytest.fixture
def journal(tmp_path):
    """Of a platform that was given a specification and ten samples, every third of them late."""
    config, clock = NodeConfig(unit="7"), FederationClock(START_US, 1.0)
    about = {"config": config.model_dump_json(), CLOCK_EPOCH: str(START_US), CLOCK_SPEED: "1.0"}
    path = tmp_path / "7.mcap"
    platform = Platform(platform_config(config, clock, START_US, ""), START_US)
    platform.start(START_US)
    with Journal(path, about) as written:
        node = Journalled(platform, written)
        node.on_event(Specify(START_US, TEXT, "seven.kpl"), START_US)
        for number in range(10):
            valid_us = START_US + 100_000 * number
            at_us = valid_us + (150_000 if number % 3 == 2 else 20_000)
            node.on_event(Fed(at_us, "gps", valid_us, float(number)), at_us)
        node.on_event(LeaveRequested(START_US + 2_000_000), START_US + 2_000_000)
    return path


def test_the_streams_of_a_journal_are_those_that_were_told(journal):
    found = recorded_streams(journal)
    assert [sample.value for sample in found["kept"]] == [0, 1, 3, 4, 6, 7, 9]
    assert [sample.value for sample in found["sparse"]] == [0, 2, 4, 6, 8]
    assert found["kept"][1].valid_us == START_US + 100_000
    assert found["kept"][1].available_us == START_US + 120_000


def test_what_is_no_journal_is_refused(tmp_path, journal):
    path = tmp_path / "no.mcap"
    path.write_bytes(b"no journal at all")
    with pytest.raises(DecodeError):
        recorded_streams(path)
    with Journal(tmp_path / "bare.mcap", {"config": "{}"}):
        pass
    with pytest.raises(DecodeError, match="does not say what it is of"):
        recorded_streams(tmp_path / "bare.mcap")


def test_a_unit_of_another_module_may_be_named(journal):
    assert recorded_streams(journal, ["examples/flights.py"]).keys() == {"kept", "sparse"}


def test_a_journal_that_lost_entries_is_refused_with_their_number(tmp_path):
    about = {"config": NodeConfig(unit="7").model_dump_json(), CLOCK_EPOCH: str(START_US), CLOCK_SPEED: "1.0"}
    with Journal(tmp_path / "7.mcap", about) as written:
        written._lost += 5
        written.on_time(START_US)
    with pytest.raises(DecodeError, match="5 entries were lost"):
        recorded_streams(tmp_path / "7.mcap")
