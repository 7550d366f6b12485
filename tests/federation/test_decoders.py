"""Every decoder of the wire against mutants and bombs: its declared error or a message, at once, also for the largest input."""

import contextlib
import json
import os
from collections.abc import Callable
from random import Random
from time import thread_time_ns
from typing import Any

import msgpack
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.federation import keys
from dyknow.federation.hosts import codec as hosts
from dyknow.federation.messages import codec, receipts
from dyknow.federation.messages.sexpr import MAX_TEXT, ExprReader
from dyknow.federation.messages.unpacking import MAX_BYTES
from dyknow.model.errors import ContentError, DecodeError, NameRefused, TextError
from dyknow.proxies.mavlink.frames import Cutter, decoded
from tests.federation.mutants import HOSTILE_NAMES, encode, mutate_bytes, mutate_tree
from tests.federation.test_hostile import act_mutants, sample_tree

COUNT = 1_000_000 if os.environ.get("DYKNOW_FULL") else 20_000
MOST_P99_MS, MOST_MS = 1.0, 250.0
BOMBS = [
    b"\xdd\xff\xff\xff\xff",
    b"\x91" * 60_000,
    b"\xdf\xff\xff\xff\xff",
    b"\xc6\xff\xff\xff\xff",
    b"\x81\x01" * 30_000,
    b"\xc7\xff\x00" * 200,
    b"\xdc\xff\xff" + b"\xc0" * 65_000,
    b"\xdc\x04\x00" * 21_000,
    (b"\xdc\x04\x00" + b"\x90" * 1000) * 64,
    b"\xde\x04\x00" + b"\xa1a\x01" * 1024,
    msgpack.packb([1, *["a" * 32_000] * 2]),
]


def _text(payload: bytes) -> object:
    reader = ExprReader(payload.decode("latin-1"))
    found = reader.value()
    reader.end()
    return found


def _key(payload: bytes) -> object:
    return keys.parse_key(payload.decode("latin-1"))


def _frames(payload: bytes) -> object:
    reader = mavlink.MAVLink(None)
    return [decoded(reader, frame) for frame in Cutter().cut(payload)]


DECODERS: dict[str, Callable[[bytes], object]] = {
    "act": codec.decode_act,
    "heartbeat": codec.decode_heartbeat,
    "samples": codec.decode_samples,
    "range": codec.decode_range,
    "recovered": codec.decode_recovered,
    "ping": codec.decode_ping,
    "pong": codec.decode_pong,
    "description": codec.decode_description,
    "receipt": receipts.decode_receipt,
    "host": hosts.decode_from_host,
    "platform": hosts.decode_from_platform,
    "text": _text,
    "key": _key,
    "frames": _frames,
}
DECLARED = (DecodeError, TextError, ContentError)


def _trees(name: str, rng: Random) -> list[Any]:
    """A message that is nearly right."""
    entries: dict[str, list[Any]] = {
        "heartbeat": [1, "1", 5, 1, 1, 1, ["0"], [["heli-position", "ab12cd34", 4]]],
        "range": [1, "ab12cd34", 5, [[1, 2]]],
        "recovered": [1, 5, 1, 9, []],
        "ping": [1, 2],
        "pong": [1, 2, 3, 4, 5],
        "description": [1, "1", 1, 1, "uav", 1.0, None, [], []],
        "receipt": [1, 1, [1, 2, 3]],
        "host": [1, 0, 1, "host", False, [], [], []],
        "platform": [1, 8, 1, True, [[0, 1, 2, 3.0]]],
    }
    return entries.get(name) or sample_tree(rng)


def _mutant(name: str, rng: Random, acts: Any) -> bytes:
    if rng.random() < 0.01:
        return bytes(rng.choice(BOMBS))
    if name == "act":
        act: bytes = next(acts)
        return act
    if name == "text":
        parts = ["(", ")", "sequence", "record", "a:", '"', "\\", '"x"', "1e999", "-5", " ", "done", "\n", "é"]
        return "".join(rng.choice(parts) for _ in range(rng.randrange(1, 40))).encode()
    if name == "key":
        parts = ["/", "@df", "v1", "acl", "x", "hb", "df", "0", "*", "$*", "L", "P", "heli-position", "ab12cd34", "7"]
        return "/".join(rng.choice(parts) for _ in range(rng.randrange(1, 9))).encode()
    if name == "frames":
        head = bytes(
            [rng.choice([0xFE, 0xFD]), rng.randrange(256), rng.randrange(4), 0, 1, 1, 1, rng.choice([0, 33]), 0, 0]
        )
        return head + rng.randbytes(rng.randrange(60))
    tree = mutate_tree(_trees(name, rng), rng)
    return mutate_bytes(encode(tree), rng) if rng.random() < 0.5 else encode(tree)


@pytest.mark.parametrize("name", DECODERS)
def test_a_mutant_is_a_message_or_the_declared_error_within_a_millisecond(name: str) -> None:
    rng = Random(2)
    acts, decode, took_ms = act_mutants(rng), DECODERS[name], list[float]()
    for _ in range(COUNT // len(DECODERS)):
        payload = _mutant(name, rng, acts)
        began_ns = thread_time_ns()
        with contextlib.suppress(*DECLARED):
            decode(payload)
        took_ms.append((thread_time_ns() - began_ns) / 1e6)
    took_ms.sort()
    p99 = took_ms[int(len(took_ms) * 0.99)]
    print(
        json.dumps({"decoder": name, "mutants": len(took_ms), "p99_ms": round(p99, 3), "max_ms": round(took_ms[-1], 2)})
    )
    assert p99 <= MOST_P99_MS


def _largest() -> dict[str, bytes]:
    """Messages of the most bytes, of what takes an unpacker, a reader of texts or a cutter of frames longest."""
    inside = [b"\x90", b"\x80", b"\xa0", b"\x01", b"\xcb" + bytes(8), b"\xc0", b"\xc1", b"\xa1\xff", b"\x91\x90"]
    arrays = {f"array of {one.hex()}": b"\xdc\x04\x00" + one * 1024 for one in inside}
    deep = {
        f"{head.hex()} in one another": (head * MAX_BYTES)[:MAX_BYTES]
        for head in (b"\x91", b"\xdc\x04\x00", b"\x81\xa1a")
    }
    texts = ['"', "(", "a ", "()", '\\"', "(a ", "(sequence ", "1", "(record a: ", " ", '"x" ', "\u00e9", "é:"]
    said = {f"text of {one!r}": (one * MAX_TEXT)[:MAX_TEXT].encode("latin-1") for one in texts}
    frames = {
        f"frames of {one.hex()}": (one * MAX_BYTES)[:MAX_BYTES]
        for one in (b"\xfe", b"\xfd", b"\xfd\xff\0", b"\xfe\0\0")
    }
    return arrays | deep | said | frames | {f"bomb {at}": bomb for at, bomb in enumerate(BOMBS)}


@pytest.mark.parametrize("name", DECODERS)
def test_the_largest_inputs_take_no_more_than_a_quarter_of_a_second(name: str) -> None:
    slowest = (0.0, "")
    for what, payload in _largest().items():
        began_ns = thread_time_ns()
        with contextlib.suppress(*DECLARED):
            DECODERS[name](payload)
        slowest = max(slowest, ((thread_time_ns() - began_ns) / 1e6, what))
    print(json.dumps({"decoder": name, "slowest_ms": round(slowest[0], 2), "input": slowest[1]}))
    assert slowest[0] <= MOST_MS, slowest


ALPHABET = [
    *"a0/*@?#.-_ ~{}\\\0\n",
    "**",
    "$*",
    "..",
    "é",
    "\u202e",
    "%2f",
    "acl",
    "hb",
    "x",
    "df",
    "state",
    "٣",
    *HOSTILE_NAMES[:40],
]
BUILT: dict[str, tuple[Callable[[str], str], int]] = {
    "hb/": (keys.heartbeat, 2),
    "x/0/": (lambda name: keys.stream("0", name, "ab12cd34"), 4),
    "acl/1/0/": (lambda name: keys.act("1", "0", name), 4),
    "q/0/": (lambda name: keys.history("0", name), 3),
    "acl/": (lambda name: keys.act(name, "0", "interface"), 4),
}


def test_a_name_makes_a_key_of_its_own_subtree_or_none() -> None:
    rng, outside, made = Random(1), list[str](), 0
    for _ in range(COUNT):
        name = "".join(rng.choice(ALPHABET) for _ in range(rng.randint(1, 6)))
        for begin, (build, chunks) in BUILT.items():
            try:
                key = build(name)
            except NameRefused:
                continue
            made += 1
            inside = key.startswith(begin) and key.count("/") == chunks - 1 and not set("*$#?") & set(key)
            if not inside or not key.isascii() or not key.isprintable():
                outside.append(key)
        try:
            space = keys.namespace(name)
        except NameRefused:
            continue
        if set("*$#?\0\n ") & set(space) or space.startswith("/"):
            outside.append(space)
    print(json.dumps({"names": COUNT, "made": made, "outside": len(outside)}))
    assert made
    assert outside == []
