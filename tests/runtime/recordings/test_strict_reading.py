"""The recording of the documentation as others read it: every checksum, the index, every schema, positions at the truth.

The `mcap` command is a Go program and foxglove-sdk reads no files, so that the format's own library reads it, in its
strictest way, and the SDK's messages take what the messages have.
"""

import json
from itertools import pairwise
from typing import Any

import pytest
from mcap.reader import NonSeekingReader, SeekingReader

from tests.box import EPOCH, METRE_DEG
from tests.console.commands.recordings.encounter import EXAMPLE


def read(kind: Any) -> tuple[list[tuple[str, str, int, dict[str, Any]]], Any]:
    with EXAMPLE.open("rb") as stream:
        reader = kind(stream, validate_crcs=True)
        found = [
            (channel.topic, schema.name, message.log_time, json.loads(message.data))
            for schema, channel, message in reader.iter_messages(log_time_order=kind is SeekingReader)
        ]
    with EXAMPLE.open("rb") as stream:
        return found, kind(stream, validate_crcs=True).get_summary()


def test_every_checksum_holds_and_the_index_has_every_message() -> None:
    streamed, _ = read(NonSeekingReader)
    indexed, summary = read(SeekingReader)
    assert len(streamed) == len(indexed) == summary.statistics.message_count > 500
    assert all(one[2] <= other[2] for one, other in pairwise(indexed))
    counts = summary.statistics.channel_message_counts
    for number, channel in summary.channels.items():
        assert counts[number] == sum(topic == channel.topic for topic, *_ in streamed)
    assert {schema.encoding for schema in summary.schemas.values()} == {"jsonschema"}


def test_every_message_is_of_its_schema() -> None:
    messages, summary = read(SeekingReader)
    schemas = {each.name: json.loads(each.data) for each in summary.schemas.values()}
    for topic, name, _, message in messages:
        assert fits(message, schemas[name]), (topic, message)


def fits(value: Any, schema: dict[str, Any]) -> bool:
    kinds = {"object": dict, "array": list, "string": str, "boolean": bool, "integer": int, "number": (int, float)}
    if not isinstance(value, kinds[schema["type"]]):
        return False
    if isinstance(value, dict):
        wanted = schema.get("properties", {})
        return all(name in value and fits(value[name], each) for name, each in wanted.items())
    return not isinstance(value, list) or all(fits(each, schema["items"]) for each in value)


def test_positions_are_at_the_truth_and_the_sdk_takes_them() -> None:
    messages_of = pytest.importorskip("foxglove.messages", reason="foxglove-sdk is not installed")
    fixes = [each for each in read(SeekingReader)[0] if each[1] == "foxglove.LocationFix"]
    assert len(fixes) > 150
    types = messages_of.LocationFixPositionCovarianceType
    kinds = {0: types.Unknown, 1: types.Approximated, 2: types.DiagonalKnown, 3: types.Known}
    for topic, _, _, fix in fixes:
        passed_s = fix["timestamp"]["sec"] + fix["timestamp"]["nsec"] / 1e9 - EPOCH / 1e6
        north_m = 4.0 * passed_s if topic == "/0/fix" else 100.0 - 4.0 * passed_s
        assert fix["latitude"] == pytest.approx(58.0 + north_m * METRE_DEG, abs=0.5 * METRE_DEG)
        taken = {**fix, "timestamp": messages_of.Timestamp(**fix["timestamp"])}
        taken["position_covariance_type"] = kinds[fix["position_covariance_type"]]
        assert messages_of.LocationFix(**taken)
