"""What is kept of others' payloads is bounded in bytes: a flood of long ones leaves no memory behind."""

import tracemalloc

import pytest

from dyknow.federation.messages.beats import MAX_TAILS
from dyknow.federation.messages.codec import (
    SHORT,
    Heartbeat,
    StreamSample,
    decode_description,
    decode_heartbeat,
    decode_samples,
    encode_description,
    encode_heartbeat,
    encode_samples,
)
from dyknow.federation.messages.descriptions import Description, LabelEntry
from dyknow.model.errors import DecodeError

MOST_BYTES = 20_000_000


def heartbeat(number: int) -> None:
    hears = tuple(f"u{(number * 7 + each) % 3000}" for each in range(900))
    tails = [(f"l{number}-{each}", "0a1b2c3d", each) for each in range(MAX_TAILS)]
    decode_heartbeat(encode_heartbeat(Heartbeat("3", 5, number, 1, 1, hears, tails)))


def description(number: int) -> None:
    labels = tuple(
        LabelEntry(label=f"l{number}-{each}", sort="position", type_hash="0a1b2c3d", period_us=100_000)
        for each in range(150)
    )
    found = Description(
        unit="3", boot=5, version=number + 1, kind="uav", clock_epoch_us=0, clock_speed=1.0, roster=None,
        services=(), labels=labels,
    )  # fmt: skip
    decode_description(encode_description(found))


def samples(number: int) -> None:
    decode_samples(encode_samples(number, [StreamSample(seq, seq, "x" * 30) for seq in range(1, 1000)]))


@pytest.mark.parametrize(("flood", "count"), [(heartbeat, 400), (description, 150), (samples, 300)])
def test_a_flood_of_long_payloads_leaves_little(flood, count):
    flood(0)
    tracemalloc.start()
    for number in range(1, count):
        flood(number)
    kept, _peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert kept < MOST_BYTES


def test_a_short_payload_is_decoded_once_and_a_long_one_each_time():
    short = encode_samples(1, [StreamSample(1, 1, 0.5)])
    long = encode_samples(1, [StreamSample(1, 1, "x" * SHORT)])
    assert decode_samples(short) is decode_samples(short)
    assert decode_samples(long) is not decode_samples(long)
    assert decode_samples(long) == decode_samples(long)


def test_a_heartbeat_with_too_many_tails_is_malformed():
    tails = [(f"l{each}", "0a1b2c3d", each) for each in range(MAX_TAILS + 1)]
    with pytest.raises(DecodeError):
        decode_heartbeat(encode_heartbeat(Heartbeat("3", 5, 1, 1, 1, (), tails)))
