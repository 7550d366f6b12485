"""What is kept of what units say: two entries of each, and a limited number of bytes, whoever floods."""

from random import Random

import pytest

from dyknow.federation.members import member, replicas
from dyknow.federation.messages import beats
from dyknow.federation.messages.beats import MAX_TAILS
from dyknow.federation.messages.codec import Heartbeat, decode_heartbeat, encode_description, encode_heartbeat
from dyknow.federation.messages.descriptions import Description, LabelEntry
from dyknow.federation.messages.newest import KEPT, Newest
from dyknow.model.errors import DecodeError


def test_what_a_unit_says_again_is_made_once_and_what_it_said_long_ago_is_made_again() -> None:
    made: list[bytes] = []

    def make(said: bytes) -> list[bytes]:
        made.append(said)
        return [said]

    newest = Newest(make, len)
    first = newest("1", b"a")
    assert newest("1", b"a") is first
    newest("1", b"b")
    assert newest("1", b"a") is first
    newest("1", b"c")
    newest("1", b"d")
    newest("1", b"a")
    assert made == [b"a", b"b", b"c", b"d", b"a"]


@pytest.mark.parametrize("seed", range(3))
def test_the_bytes_are_bounded_and_the_newest_of_who_speaks_last_is_kept(seed: int) -> None:
    random = Random(seed)
    newest = Newest(bytes, len, most_bytes=10_000)
    for _ in range(3000):
        unit, said = str(random.randrange(200)), random.randbytes(random.randrange(1, 500))
        kept = newest(unit, said)
        assert newest(unit, said) is kept
        assert newest.bytes == sum(len(known) for entries in newest._entries.values() for known, _ in entries) <= 10_000
        assert max(map(len, newest._entries.values())) <= KEPT


def test_a_flood_of_heartbeats_and_descriptions_is_kept_within_its_bytes() -> None:
    for number in range(1, 1500):
        unit = f"n{number % 300}"
        tails = [(f"label-{number}-{one}", "ab12cd34", one) for one in range(MAX_TAILS)]
        member.heartbeat_of(f"hb/{unit}", encode_heartbeat(Heartbeat(unit, 1, number, 1, 1, [unit], tails)))
        labels = tuple(LabelEntry(label=f"lab-{number}-{one}", sort="x", type_hash="0" * 8) for one in range(20))
        replicas._described(
            unit, encode_description(Description(unit=unit, boot=1, version=number, kind="uav", labels=labels))
        )
    for cache in (member._beats, beats._tails, beats._heard, replicas._described):
        assert 0 < cache.bytes <= 1 << 20


def test_a_heartbeat_names_64_tails_and_a_longer_one_is_refused() -> None:
    tails = [("heli-position", "ab12cd34", number) for number in range(MAX_TAILS + 1)]
    beat = Heartbeat("1", 1, 1, 1, 1, (), tails)
    assert len(decode_heartbeat(encode_heartbeat(beat._replace(tails=tails[1:]))).tails) == MAX_TAILS
    with pytest.raises(DecodeError, match="shape"):
        decode_heartbeat(encode_heartbeat(beat))
    with pytest.raises(DecodeError, match="oversized"):
        decode_heartbeat(encode_heartbeat(beat._replace(tails=(), hears=["n" * 40] * 1000)))
