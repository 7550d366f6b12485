"""A running federation in Foxglove: the channels of a recording, positions at the truth, and nothing that changes anything."""

import json
import socket
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
pytest.importorskip("websockets", reason="websockets is not installed")

from mcap.reader import make_reader

from dyknow.model.errors import EndpointFailed, UnitError
from dyknow.runtime.client import Client, command_centre
from dyknow.runtime.configuration.settings import Settings
from dyknow.runtime.recorder.live import MOST_KEPT, LiveServer
from dyknow.runtime.recorder.recorder import Recorder
from dyknow.runtime.recordings.recording_file import LONGEST_MESSAGE, PLATFORM, RecordingFile
from tests.box import EPOCH, METRE_DEG, Box
from tests.console.commands.recordings.encounter import encounter
from tests.runtime.recorder.foxglove_client import FoxgloveClient

PATIENCE_S = 10.0


def until(condition: Callable[[], object]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.01)


@pytest.fixture
def served() -> Iterator[tuple[Box, Client, LiveServer]]:
    world = encounter()
    client = Client(world.client_ports(), command_centre(Settings(), "cc-9"))
    client.settle()
    server = LiveServer("127.0.0.1", 0, "dyknow default", client.federation_us)
    yield world, client, server
    server.close()


def run(client: Client, recorder: Recorder, seconds: float) -> None:
    end_us = client.now_us() + round(seconds * 1e6)
    while client.now_us() < end_us:
        recorder.step()


def test_a_client_sees_positions_where_the_truth_is_and_the_alarm_that_was_open_when_it_came(
    served: tuple[Box, Client, LiveServer],
) -> None:
    _, client, server = served
    recorder = Recorder(client, server)
    run(client, recorder, 11.0)
    with FoxgloveClient(f"ws://127.0.0.1:{server.port}") as foxglove:
        until(lambda: foxglove.messages["/alarms"] and foxglove.messages["/directory"])
        assert {each["event"] for _, each in foxglove.messages["/alarms"]} == {"opened"}
        assert {each["unit"] for _, each in foxglove.messages["/directory"]} == {"0", "1"}
        run(client, recorder, 4.0)
        until(lambda: len(foxglove.messages["/1/fix"]) >= 35)
        until(lambda: foxglove.times_us and abs(foxglove.times_us[-1] - client.federation_us()) < 200_000)
        assert foxglove.info["name"] == "dyknow default"
        assert foxglove.info["capabilities"] == ["time"]
        for unit, start_m, speed_m_s in (("0", 0.0, 4.0), ("1", 100.0, -4.0)):
            for _, fix in foxglove.messages[f"/{unit}/fix"]:
                passed_s = fix["timestamp"]["sec"] + fix["timestamp"]["nsec"] / 1e9 - EPOCH / 1e6
                north_deg = 58.0 + (start_m + speed_m_s * passed_s) * METRE_DEG
                assert fix["latitude"] == pytest.approx(north_deg, abs=0.5 * METRE_DEG)
        assert not foxglove.statuses


def test_channels_and_schemas_are_those_of_a_recording(served: tuple[Box, Client, LiveServer], tmp_path: Path) -> None:
    _, client, server = served
    with RecordingFile(tmp_path / "a.mcap", {}, client.now_us) as file:
        run(client, Recorder(client, file), 3.0)
    run(client, Recorder(client, server), 8.0)  # long enough for an act
    with file.path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        assert summary is not None
        recorded = {
            channel.topic: (channel.message_encoding, schema.name, schema.encoding, schema.data.decode())
            for channel in summary.channels.values()
            for schema in [summary.schemas[channel.schema_id]]
        }
    with FoxgloveClient(f"ws://127.0.0.1:{server.port}") as foxglove:
        until(lambda: len(foxglove.channels) >= len(recorded))
        live = {
            topic: tuple(each[name] for name in ("encoding", "schemaName", "schemaEncoding", "schema"))
            for topic, each in foxglove.channels.items()
        }
    assert live == recorded
    assert {"/0/fix", "/scene", "/log", "/directory", "/0/heli-position"} <= live.keys()


def test_what_a_client_sends_changes_nothing_and_harms_no_other(served: tuple[Box, Client, LiveServer]) -> None:
    _, client, server = served
    recorder = Recorder(client, server, ["heli-position"])
    run(client, recorder, 1.0)
    url = f"ws://127.0.0.1:{server.port}"
    with FoxgloveClient(url) as honest, FoxgloveClient(url) as hostile:
        for words in (
            {"op": "advertise", "channels": [{"id": 1, "topic": "/0/fix", "encoding": "json", "schemaName": ""}]},
            {"op": "setParameters", "parameters": [{"name": "x", "value": 1}]},
            {"op": "subscribe", "subscriptions": [{"id": 7, "channelId": 4_000_000_000}] * 100},
            {"op": "nothing"},
        ):
            hostile.socket.send(json.dumps(words))
        hostile.socket.send(b"\x01\x01\x00\x00\x00{}")
        hostile.socket.send("{" * 10_000)
        count = len(honest.messages["/0/fix"])
        run(client, recorder, 2.0)
        until(lambda: len(honest.messages["/0/fix"]) >= count + 15)


def test_what_is_kept_for_clients_to_come_and_the_number_of_topics_have_bounds(
    served: tuple[Box, Client, LiveServer],
) -> None:
    _, _, server = served
    for at in range(MOST_KEPT + 10):
        assert server.add("/directory", PLATFORM, {"unit": f"u{at}", "labels": []}, at)
    assert len(server._kept) == MOST_KEPT
    assert not server.add("/x", "dyknow.X", {"text": "x" * LONGEST_MESSAGE}, 1)
    assert not server.add("/x", "dyknow.X", {"number": float("nan")}, 1)
    assert server.lost == 2


def test_a_port_that_is_taken_and_a_library_that_is_missing_are_told(
    served: tuple[Box, Client, LiveServer], monkeypatch: pytest.MonkeyPatch
) -> None:
    _, _, server = served
    with pytest.raises(EndpointFailed, match=f"{server.port} cannot be served.*--port"):
        LiveServer("127.0.0.1", server.port, "x", lambda: 0)
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(UnitError, match=r"\[foxglove\]"):
        LiveServer("127.0.0.1", 0, "x", lambda: 0)


@pytest.mark.parametrize(
    ("origin", "host", "is_let_in"),
    [
        (None, None, True),
        ("https://app.foxglove.dev", None, True),
        ("https://evil.example", None, False),
        ("http://127.0.0.1:8765", None, False),
        ("null", None, False),
        (None, "evil.example:8765", False),
    ],
)
def test_pages_that_are_not_foxglove_and_names_that_are_not_ours_are_refused(
    served: tuple[Box, Client, LiveServer], origin: str | None, host: str | None, is_let_in: bool
) -> None:
    from websockets.exceptions import InvalidStatus

    _, _, server = served
    headers = {"Host": host} if host else {}
    options = {"origin": origin} if origin else {}
    if is_let_in:
        with FoxgloveClient(f"ws://127.0.0.1:{server.port}", **options) as foxglove:
            until(lambda: foxglove.info)
        assert server.refused == 0
        return
    if host:
        with socket.create_connection(("127.0.0.1", server.port), 5) as raw:
            raw.sendall(f"GET / HTTP/1.1\r\nHost: {headers['Host']}\r\n\r\n".encode())
            assert raw.recv(100).startswith(b"HTTP/1.1 421")
    else:
        with pytest.raises(InvalidStatus), FoxgloveClient(f"ws://127.0.0.1:{server.port}", **options):
            pass
    assert server.refused == 1
