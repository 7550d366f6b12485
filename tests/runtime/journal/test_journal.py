import json
import math
import random
import subprocess
import sys
import threading
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from dyknow.agents.effects import Event, HostEvent, LeaveRequested, Reported
from dyknow.federation.transport import Arrived, AskEnded, Put, TokenChanged, Urgency, WireEvent
from dyknow.model.errors import DecodeError
from dyknow.model.instants import LATEST_US
from dyknow.model.sample import Sample
from dyknow.model.values import NO_VALUE
from dyknow.navigation.vehicle import PositionReport, Report, StatusReport
from dyknow.proxies.recordings import journal_file
from dyknow.proxies.recordings.journal_file import Lost, Stepped, decode_event, encode_event, read_about, read_journal
from dyknow.runtime.journal import journal as journal_module
from dyknow.runtime.journal.journal import Journal, Journalled, replayed

ABOUT = {"unit": "0", "boot": "7"}
NOW_US = 1_795_000_000_000_123
POSITION = PositionReport(NOW_US, "GLOBAL_POSITION_INT", 58.4, 15.6, None, horizontal_sd_m=0.3)
FIELDS = {
    int: st.integers(-(2**63), 2**63 - 1),
    float: st.floats(-3.4e38, 3.4e38) | st.sampled_from([math.nan, math.inf, -math.inf]),
    bool: st.booleans(),
    str: st.text(st.characters(exclude_categories=["Cs"])),
    bytes: st.binary(),
}
INSTANTS = st.integers(-LATEST_US, LATEST_US)


def of(hint: Any, name: str = "") -> st.SearchStrategy[Any]:
    """Values of a field."""
    if hint is int and name.endswith("_us"):
        return INSTANTS
    if get_origin(hint) is tuple:
        parts = get_args(hint)
        each = st.lists(of(parts[0]), max_size=3) if parts[-1] is ... else st.tuples(*map(of, parts))
        return each.map(tuple)
    if isinstance(hint, UnionType):
        return st.one_of(of(each, name) for each in get_args(hint))
    if hint is type(None):
        return st.none()
    if isinstance(hint, type) and issubclass(hint, Enum):
        return st.sampled_from(list(hint))
    return FIELDS[hint] if hint in FIELDS else made(hint)


def made(kind: type) -> st.SearchStrategy[Any]:
    """Values of a named tuple."""
    return st.builds(kind, **{name: of(hint, name) for name, hint in get_type_hints(kind).items()})


REPORTS = st.one_of(*map(made, get_args(Report)))
EVENTS = st.one_of(
    *map(made, get_args(WireEvent)),
    *map(made, get_args(HostEvent)),
    st.builds(LeaveRequested, INSTANTS),
    st.builds(Reported, INSTANTS, REPORTS),
)


@dataclass
class Tally:
    """A node whose effects depend on everything it saw, and when."""

    seen: int = 0
    deadline_us: int | None = None
    done: list[object] = field(default_factory=list)

    def on_event(self, event: object, now_us: int) -> list[Put]:
        self.seen = hash((self.seen, str(event), now_us)) % 1_000_003
        self.deadline_us = now_us + 10
        return self._said()

    def on_time(self, now_us: int) -> list[Put]:
        self.seen = hash((self.seen, now_us)) % 1_000_003
        self.deadline_us = None
        return self._said()

    def _said(self) -> list[Put]:
        said = [Put("hb/0", str(self.seen).encode(), Urgency.CONTROL)] * (self.seen % 3)
        self.done += said
        return said


@given(EVENTS)
def test_every_event_is_the_same_after_writing_and_reading(event: object) -> None:
    again = decode_event(encode_event(event))
    assert type(again) is type(event)
    assert repr(again) == repr(event), "by what it says, since NaN is not equal to itself"


def test_a_journal_replays_to_the_same_effects(tmp_path: Path) -> None:
    path, node = tmp_path / "0.mcap", Tally()
    with Journal(path, ABOUT) as journal:
        live = Journalled(node, journal)
        for number in range(300):
            live.on_event(Arrived("hb/1", NOW_US + number, b"%d" % number), NOW_US + number)
            live.on_event(Reported(NOW_US + number, POSITION), NOW_US + number)
            if number % 7 == 0:
                assert live.deadline_us is not None
                live.on_time(live.deadline_us)
    assert journal.lost == 0
    fresh = Tally()
    effects = [effect for _, said in replayed(read_journal(path), fresh) for effect in said]
    assert effects == node.done
    assert (fresh.seen, fresh.deadline_us) == (node.seen, node.deadline_us)
    assert read_about(path) == ABOUT


def test_samples_open_in_other_tools_as_json(tmp_path: Path) -> None:
    path = tmp_path / "0.mcap"
    with Journal(path, ABOUT) as journal:
        journal.on_sample("heli-position", ("latitude_deg", "longitude_deg"), Sample(NOW_US, NOW_US - 5, (58.4, 15.6)))
        journal.on_sample("heli-position", ("latitude_deg", "longitude_deg"), Sample(NOW_US + 1, NOW_US, NO_VALUE))
        journal.on_event(AskEnded(1, 2), 3)
    with path.open("rb") as stream:
        found = [
            (message.log_time, json.loads(message.data))
            for _, _, message in make_reader(stream).iter_messages(topics="x/heli-position")
        ]
    assert found == [
        (
            NOW_US * 1000,
            {"valid_us": NOW_US - 5, "available_us": NOW_US, "latitude_deg": 58.4, "longitude_deg": 15.6},
        ),
        ((NOW_US + 1) * 1000, {"valid_us": NOW_US, "available_us": NOW_US + 1, "value": None}),
    ]
    assert list(read_journal(path)) == [Stepped(3, AskEnded(1, 2))]


def test_a_disk_that_is_too_slow_costs_entries_not_the_node(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(journal_module, "_WAITING", 100)
    path, stuck, may_go = tmp_path / "0.mcap", threading.Event(), threading.Event()

    def slow(_part: object) -> None:
        stuck.set()
        may_go.wait(30)

    journal = Journal(path, ABOUT)
    journal._queue.put(slow)
    assert stuck.wait(30)
    for number in range(1000):
        journal.on_time(number)
    assert journal.lost == 900
    may_go.set()
    journal.close()
    assert [entry.now_us for entry in read_journal(path)] == list(range(100))


def test_what_was_lost_is_written_where_it_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "0.mcap"
    with Journal(path, ABOUT) as journal:
        journal.on_time(1)
        journal._lost += 5
        journal.on_time(2)
    assert list(read_journal(path)) == [Stepped(1, None), Lost(2, 5), Stepped(2, None)]


def test_a_part_that_is_full_is_ended_and_old_ones_are_deleted(tmp_path: Path) -> None:
    with Journal(tmp_path / "0.mcap", ABOUT, part_bytes=1_000_000, parts=2) as journal:
        noise = random.Random(1)
        for number in range(400):
            journal.on_event(Arrived("x/0/a/0123abcd", number, noise.randbytes(16_000)), number)
    parts = sorted(path.name for path in tmp_path.iterdir())
    assert len(parts) == 2
    assert "0.mcap" not in parts
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) < 3_000_000
    assert all(read_about(path) == ABOUT for path in tmp_path.iterdir())


def test_an_entry_that_cannot_be_written_is_counted_and_the_rest_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "0.mcap"
    with Journal(path, ABOUT) as journal:
        journal.on_event(object(), 1)
        journal.on_time(2)
    assert journal.unwritable == 1
    assert list(read_journal(path)) == [Stepped(2, None)]


CRASH = """
import os, signal, sys, time
from pathlib import Path
from dyknow.federation.transport import TokenChanged
from dyknow.runtime.journal.journal import Journal
journal = Journal(Path(sys.argv[1]), {"unit": "0"})
journal.on_event(TokenChanged("@df/v1/a", 5, alive=True), 5)
while b"@df/v1/a" not in Path(sys.argv[1]).read_bytes():
    time.sleep(0.01)
journal.on_time(6)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_node_leaves_what_it_saw_until_a_second_before(tmp_path: Path) -> None:
    path = tmp_path / "0.mcap"
    subprocess.run([sys.executable, "-c", CRASH, str(path)], check=False, timeout=60)
    assert list(read_journal(path))[:1] == [Stepped(5, TokenChanged("@df/v1/a", 5, alive=True))]


@pytest.mark.parametrize("content", [b"", b"not a journal at all, but long enough to be one", bytes(200)])
def test_what_is_no_journal_is_said_so(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "0.mcap"
    path.write_bytes(content)
    with pytest.raises(DecodeError):
        list(read_journal(path))


@given(EVENTS, st.data())
def test_a_damaged_event_is_a_decode_error_or_another_value(event: object, draw: st.DataObject) -> None:
    data = encode_event(event)
    cut = draw.draw(st.integers(0, len(data) - 1))
    with pytest.raises(DecodeError):
        decode_event(data[:cut])
    with pytest.raises(DecodeError):
        decode_event(data + draw.draw(st.binary(min_size=1, max_size=20)))
    changed = bytes([draw.draw(st.integers(0, 255).filter(lambda byte: byte != data[cut]))])
    try:
        other = decode_event(data[:cut] + changed + data[cut + 1 :])
    except DecodeError:
        return
    assert repr(other) != repr(event) or "nan" in repr(event)  # bits of what is no number are not told apart


def test_closing_twice_is_closing_once(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "0.mcap", ABOUT)
    journal.on_event(Reported(1, StatusReport(1, True, True, None, "GUIDED")), 1)
    journal.close()
    journal.close()
    assert list(read_journal(tmp_path / "0.mcap")) == [
        Stepped(1, Reported(1, StatusReport(1, True, True, None, "GUIDED")))
    ]


def parts_of(hint: Any) -> set[type]:
    """The named tuples and enumerations that a value of this type may have in it."""
    if get_args(hint):
        return set[type]().union(*(parts_of(each) for each in get_args(hint)))
    is_part = isinstance(hint, type) and (hasattr(hint, "_fields") or issubclass(hint, Enum))
    if not is_part or hint in SEEN:
        return set()
    SEEN.add(hint)
    return {hint}.union(*(parts_of(each) for each in get_type_hints(hint).values()))


SEEN: set[type] = set()


def test_the_format_knows_each_type_that_an_event_may_have_in_it() -> None:
    known = {*journal_file._KINDS.values(), *journal_file._WORDS.values()}
    assert {kind.__name__ for kind in parts_of(Event) - known} <= {"NoValue"}
