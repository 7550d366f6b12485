"""Seeded mutants of messages: of their fields, of their structure and of their bytes."""

from collections.abc import Iterator
from dataclasses import dataclass
from random import Random
from typing import Any

import msgpack


@dataclass
class Raw:
    """Bytes to put where a value should be."""

    data: bytes


HOSTILE_NAMES = [
    "", "*", "**", "$*", "a$*b", "a*b", "a/b", "/", "a//b", "..", ".", "#", "?", "@x", "a b", "a\0b", "a\nb", "0\n", "heli-position\n",
    "{x}", "a%2f", "ä", "\u202eabc", "\ud7ff", "all", "x", "df", "-a", "a-", "a--b", "00", "01", "A", "Uav1", "a_b", "a-b_c", "9a",
    "a" * 32, "a" * 33, "a" * 64, "a" * 65, "a" * 128, "a" * 256, "a" * 257, "a" * 32_768, "a" * 32_769, "a" * 70_000,
    "interface@0", "interface@all", "interface@", "@0", "a@b@c", "interface@0/1", "Interface@0", "interface@x",
]  # fmt: skip
NASTY = [
    None, True, False, 0, 1, -1, 2**31, 2**53, 2**63 - 1, 2**63, 2**64 - 1, -(2**63), 0.0, -0.0, 1.0, 1e308, float("nan"), float("inf"),
    float("-inf"), b"", b"x", b"\xff", b"a" * 64, b"a" * 32_769, [], [[]], {}, {"": "done"}, {"": "sequence"}, {"": 1}, {"": None, "a": 1}, {"a": 1},
    {"": "done", "text": b"ok"}, {"": "Done"}, {"": "done", "Text": 1}, [0] * 300, [0] * 1025, ["0"] * 1024,
    Raw(b"\xc1"), Raw(b"\xd4\x01\x00"), Raw(b"\xc7\x00\x01"), Raw(b"\xd6\xff\x00\x00\x00\x01"), Raw(b"\xa1\xff"), Raw(b"\x81\x01\x02"),
    Raw(b"\x82\xa1a\x01\xa1a\x01"), Raw(b"\x82\xa0\xa4done\xa0\xa4done"), Raw(b"\x81\xc4\x01a\x01"), Raw(b"\x81\xc0\x01"),
    Raw(b"\xdd\xff\xff\xff\xff"), Raw(b"\xdc\xff\xff"), Raw(b"\xdf\xff\xff\xff\xff"), Raw(b"\xdb\xff\xff\xff\xff"), Raw(b"\xc6\xff\xff\xff\xff"),
    Raw(b"\xcf\x00\x00\x00\x00\x00\x00\x00\x01"), Raw(b"\xca\x7f\xc0\x00\x00"), Raw(b"\xd9\x010"), Raw(b"\xdc\x00\x00"),
    Raw(b"\x91" * 15 + b"\x90"), Raw(b"\x91" * 16 + b"\x90"), Raw(b"\x91" * 17 + b"\x90"), Raw(b"\x91" * 900 + b"\x90"), Raw(b"\x91" * 5000 + b"\x90"),
    Raw(b"\x81\xa1a" * 15 + b"\xc0"), Raw(b"\x81\xa1a" * 17 + b"\xc0"), Raw(b"\x91" * 3 + b"\x90"), Raw(b"\x91" * 4 + b"\x90"),
]  # fmt: skip


def encode(value: Any) -> bytes:
    """msgpack of a tree that may hold Raw."""
    if isinstance(value, Raw):
        return value.data
    packer = msgpack.Packer()
    if isinstance(value, list):
        return packer.pack_array_header(len(value)) + b"".join(map(encode, value))
    if isinstance(value, dict):
        return packer.pack_map_header(len(value)) + b"".join(
            encode(name) + encode(member) for name, member in value.items()
        )
    packed: bytes = packer.pack(value)
    return packed


def _spots(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Every (container, index) in the tree."""
    stack = [tree]
    while stack:
        node = stack.pop()
        members = list(enumerate(node)) if isinstance(node, list) else list(node.items())
        for at, member in members:
            yield node, at
            if isinstance(member, list | dict):
                stack.append(member)


def _copy(tree: Any) -> Any:
    if isinstance(tree, list):
        return [_copy(member) for member in tree]
    if isinstance(tree, dict):
        return {name: _copy(member) for name, member in tree.items()}
    return tree


def mutate_tree(tree: Any, rng: Random) -> Any:
    """One field replaced, removed, doubled, swapped or added."""
    tree = _copy(tree)
    node, at = rng.choice(list(_spots(tree)))
    way = rng.randrange(8)
    if way <= 2:
        node[at] = _copy(rng.choice(NASTY))
    elif way <= 4:
        node[at] = rng.choice(HOSTILE_NAMES)
    elif way == 5:
        del node[at]
    elif isinstance(node, list):
        node.insert(at, _copy(rng.choice([node[at], *NASTY])))
    else:
        node[rng.choice([*HOSTILE_NAMES, "", "extra", "unit"])] = _copy(rng.choice([node[at], *NASTY]))
    return tree


def mutate_bytes(data: bytes, rng: Random) -> bytes:
    """Bits flipped, cut, spliced, lengthened."""
    way = rng.randrange(6)
    at = rng.randrange(len(data)) if data else 0
    if way == 0:
        return data[:at]
    if way == 1:
        return data + rng.randbytes(rng.choice([1, 2, 16]))
    if way == 2:
        return data[:at] + rng.randbytes(1) + data[at:]
    if way == 3 and rng.random() < 0.05:
        return data + bytes(rng.choice([65_537, 70_000]))
    if way == 4:
        return data[:at] + data[at + 1 :]
    return data[:at] + bytes([data[at] ^ (1 << rng.randrange(8))]) + data[at + 1 :] if data else b""
