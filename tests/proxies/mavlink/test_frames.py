"""Bytes before they are messages: what is cut from them, and that nothing forged is decoded."""

import os
import random
import time

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.proxies.mavlink.frames import WANTED, Cutter, decoded
from tests.proxies.vehicle import heartbeat, position, unknown_frame

KEY = bytes(range(32))
MUTANTS = 60_000 if "DYKNOW_FULL" in os.environ else 6_000


def codec(key: bytes | None = None) -> mavlink.MAVLink:
    made = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    if key is not None:
        made.signing.secret_key, made.signing.sign_outgoing = key, True
        made.signing.timestamp = int((time.time() - 1_420_070_400) * 1e5)
    return made


@given(
    st.lists(st.integers(0, 2), max_size=6),
    st.binary(max_size=40).filter(lambda b: b"\xfd" not in b and b"\xfe" not in b),
)
def test_frames_are_found_between_whatever_else_a_datagram_holds(kinds, junk) -> None:
    sender = codec()
    packed = [bytes((heartbeat(), position(5), position(6))[kind].pack(sender)) for kind in kinds]
    found = list(Cutter().cut(junk.join([b"", *packed, b""])))
    assert [frame.data for frame in found] == packed
    assert all((frame.system, frame.component) == (1, 1) for frame in found)


def test_both_versions_of_the_protocol_are_read() -> None:
    sender = codec()
    for old in (True, False):
        (frame,) = Cutter().cut(bytes(position(7).pack(sender, force_mavlink1=old)))
        assert decoded(codec(), frame).time_boot_ms == 7


@given(st.binary(max_size=400))
def test_no_bytes_make_the_cutter_raise_or_invent(data) -> None:
    for frame in Cutter().cut(data):
        assert frame.data in data
        decoded(codec(), frame)


def test_no_mutant_of_a_signed_frame_is_accepted_and_the_honest_ones_still_are() -> None:
    sender, receiver, rng = codec(KEY), codec(KEY), random.Random(11)
    accepted = 0
    for k in range(MUTANTS):
        honest = bytes(position(k).pack(sender))
        mutant = bytearray(honest)
        for _ in range(rng.randint(1, 3)):
            mutant[rng.randrange(len(mutant))] ^= rng.randrange(1, 256)
        if bytes(mutant) != honest:
            accepted += sum(decoded(receiver, frame) is not None for frame in Cutter().cut(bytes(mutant)))
        if k % 1000 == 0:
            (frame,) = Cutter().cut(honest)
            assert decoded(receiver, frame) is not None, "no mutant has spoilt the stream for those that follow"
            assert decoded(receiver, frame) is None, "a replayed frame is refused"
    assert accepted == 0


def test_a_frame_signed_with_another_key_or_not_at_all_is_refused() -> None:
    receiver = codec(KEY)
    for sender in (codec(), codec(bytes(32))):
        (frame,) = Cutter().cut(bytes(position(1).pack(sender)))
        assert decoded(receiver, frame) is None


def test_a_type_that_is_not_wanted_is_never_decoded() -> None:
    assert Cutter().cut(unknown_frame(1)) == []
    (known,) = Cutter().cut(bytes(mavlink.MAVLink_ping_message(1, 1, 0, 0).pack(codec())))
    assert known.message_id not in WANTED
    assert decoded(codec(), known) is None


def test_a_frame_cut_short_is_none() -> None:
    whole = bytes(position(1).pack(codec()))
    for length in range(len(whole)):
        assert not any(decoded(codec(), frame) for frame in Cutter().cut(whole[:length]))


@given(st.data())
def test_frames_in_pieces_are_put_together_whatever_comes_between(data) -> None:
    sender = codec()
    sent = [bytes(position(k).pack(sender, force_mavlink1=data.draw(st.booleans()))) for k in range(4)]
    noise = st.binary(max_size=12)
    stream = b"".join(data.draw(noise) + frame for frame in sent) + data.draw(noise)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    cutter = Cutter()
    pieces = [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    found = [frame.data for piece in pieces for frame in cutter.cut(piece)]
    assert [frame for frame in found if frame in sent] == sent


def test_what_looks_like_the_beginning_of_a_frame_holds_up_none_that_follows() -> None:
    cutter, honest = Cutter(), bytes(position(1).pack(codec()))
    false_start = bytes((0xFD, 255, 0, 0, 0, 1, 1, 33, 0, 0))
    assert cutter.cut(false_start) == []
    assert [frame.data for frame in cutter.cut(honest)] == [honest]


def test_a_flood_of_false_frames_is_given_up_and_what_comes_next_is_heard() -> None:
    cutter, honest = Cutter(), bytes(position(1).pack(codec()))
    assert not [frame for frame in cutter.cut(b"\xfe\x01\x00\x01\x01\x00" * 10_000) if frame.is_intact]
    assert cutter.damaged <= 100
    assert [frame.data for frame in cutter.cut(honest)] == [honest]
