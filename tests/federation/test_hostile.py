"""Bytes from outside: what is accepted is exactly what a schema written apart from the codec calls valid."""

import gc
from collections import Counter
from collections.abc import Callable, Iterator
from random import Random
from typing import Any

import psutil
import pytest

from dyknow.federation import keys
from dyknow.federation.messages import codec, contents, unpacking
from dyknow.model.errors import ContentError, DecodeError
from tests.federation import schema
from tests.federation.mutants import HOSTILE_NAMES, NASTY, encode, mutate_bytes, mutate_tree

PROFILES = [pytest.param(10_000, id="tenth"), pytest.param(100_000, id="bar", marks=pytest.mark.full)]
LABELS = ["heli-position", "heli-altitude", "battery", "a" * 64]
UNITS = ["0", "7", "uav1", "cc-4711", "a_b-c"]


def _content(rng: Random, depth: int = 0) -> Any:
    kind = rng.randrange(8 if depth < 4 else 5)
    if kind < 5:
        return rng.choice(["symbol", b"some words", 5, -1.5, True, None, rng.random(), rng.getrandbits(60)])
    if kind == 5:
        return [_content(rng, depth + 1) for _ in range(rng.randrange(4))]
    names = ["a", "to-units", "latitude_deg", "x1"][: rng.randrange(5)]
    return {**({"": "done"} if kind == 7 else {}), **{name: _content(rng, depth + 1) for name in names}}


def act_tree(rng: Random) -> list[Any]:
    """The body of a valid act."""
    conversation = f"1-{rng.getrandbits(40)}-{rng.randrange(100)}"
    arguments = {"semantic-labels": ["heli-position"], "delay": 1.0, "x": _content(rng)}
    return [
        1,
        rng.choice(sorted(schema.PERFORMATIVES)),
        f"interface@{rng.choice(UNITS)}",
        f"{rng.choice(['interface', 'alarms'])}@{rng.choice([*UNITS, 'all'])}",
        rng.choice([None, {"": "create-multicast", **arguments}, {"": "done"}]),
        rng.choice([None, conversation]),
        rng.choice([None, "fipa-request"]),
        rng.choice([None, "r1"]),
        rng.choice([None, "r0"]),
        rng.choice([None, rng.getrandbits(50)]),
        None,
        None,
        rng.choice([None, "dyknow"]),
        rng.choice([None, "interface@3"]),
        rng.getrandbits(50),
        rng.getrandbits(20),
        rng.getrandbits(50),
        [rng.getrandbits(20) for _ in range(rng.randrange(3))],
    ]


def envelope(body: bytes, rng: Random) -> bytes:
    return encode([body, rng.choice([None, bytes(64)])])


def act_mutants(rng: Random) -> Iterator[bytes]:
    """Half of them reach what is behind the envelope."""
    while True:
        tree, way = act_tree(rng), rng.randrange(8)
        if way == 0:
            yield envelope(encode(tree), rng)
        elif way <= 4:
            for _ in range(rng.randrange(1, 3)):
                tree = mutate_tree(tree, rng)
            yield envelope(encode(tree), rng)
        elif way == 5:
            yield envelope(mutate_bytes(encode(tree), rng), rng)
        elif way == 6:
            yield mutate_bytes(envelope(encode(tree), rng), rng)
        else:
            yield encode(mutate_tree([encode(tree), rng.choice([None, bytes(64)])], rng))


def _entries(rng: Random) -> list[Any]:
    values = [[58.4, 15.6], [rng.random()], 5, None, "on", True, [None, 1.5], [[1.0, 2.0], 3.0]]
    return [[rng.randrange(1, 10**6), rng.getrandbits(50), rng.choice(values)] for _ in range(rng.randrange(4))]


def sample_tree(rng: Random) -> list[Any]:
    return [1, rng.getrandbits(50), _entries(rng)]


def recovered_tree(rng: Random) -> list[Any]:
    return [1, rng.getrandbits(50), rng.randrange(5), rng.randrange(5), _entries(rng)]


def range_tree(rng: Random) -> list[Any]:
    return [1, "ab12cd34", rng.getrandbits(50), [[1, 5], [7, 7]]]


def heartbeat_tree(rng: Random) -> list[Any]:
    numbers = [rng.getrandbits(50) for _ in range(4)]
    tails = [[rng.choice(LABELS), "ab12cd34", rng.getrandbits(20)] for _ in range(rng.randrange(3))]
    return [1, rng.choice(UNITS), *numbers, rng.sample(UNITS, rng.randrange(4)), tails]


def pong_tree(rng: Random) -> list[Any]:
    return [1, *(rng.getrandbits(50) for _ in range(4))]


def description_tree(rng: Random) -> list[Any]:
    services = [
        {"agent": "interface", "service": "alarms", "visibility": rng.choice(["public", "protected"]), "version": 1}
    ]
    labels = [{"label": rng.choice(LABELS), "sort": "position", "type_hash": "ab12cd34", "period_us": 100_000}]
    clock = {
        "clock_epoch_us": rng.getrandbits(50),
        "clock_speed": rng.choice([1.0, 1, 10.0]),
        "roster": rng.choice([None, "0" * 16]),
    }
    known = {
        "unit": rng.choice(UNITS),
        "boot": rng.getrandbits(50),
        "version": 3,
        "kind": rng.choice(["uav", "command-centre"]),
    }
    return [1, {**known, **rng.choice([{}, clock]), **rng.choice([{}, {"services": services * 2, "labels": labels}])}]


def mutants(tree_of: Callable[[Random], list[Any]]) -> Callable[[Random], Iterator[bytes]]:
    def made(rng: Random) -> Iterator[bytes]:
        while True:
            tree, way = tree_of(rng), rng.randrange(8)
            if 0 < way <= 5:
                for _ in range(rng.randrange(1, 3)):
                    tree = mutate_tree(tree, rng)
            yield mutate_bytes(encode(tree), rng) if way > 5 else encode(tree)

    return made


def _act_again(payload: bytes) -> None:
    act, signature, body = codec.decode_act(payload)
    again = codec.encode_act(act, None if signature is None else lambda _: signature)
    assert codec.decode_act(again)[0] == act
    assert keys.parse_key(act.key) == (act.receiver.unit, act.sender.unit, act.receiver.agent)
    assert body in payload


def _samples_again(payload: bytes) -> None:
    boot, samples, riders, every = codec.decode_samples(payload)
    again = codec.encode_samples(boot, samples, riders=riders, every=every)
    assert codec.decode_samples(again) == (boot, samples, riders, every)


def _again(decode: Callable[[bytes], Any], encode_it: Callable[[Any], bytes]) -> Callable[[bytes], None]:
    def check(payload: bytes) -> None:
        assert decode(encode_it(decode(payload))) == decode(payload)

    return check


KINDS: dict[str, tuple[Callable[[Random], Iterator[bytes]], Callable[[bytes], bool], Callable[[bytes], None]]] = {
    "acts": (act_mutants, schema.act, _act_again),
    "samples": (mutants(sample_tree), schema.samples, _samples_again),
    "recovered samples": (
        mutants(recovered_tree),
        schema.recovered,
        _again(codec.decode_recovered, codec.encode_recovered),
    ),
    "questions for samples": (mutants(range_tree), schema.wanted, _again(codec.decode_range, codec.encode_range)),
    "heartbeats": (mutants(heartbeat_tree), schema.heartbeat, _again(codec.decode_heartbeat, codec.encode_heartbeat)),
    "clock answers": (mutants(pong_tree), schema.pong, _again(codec.decode_pong, codec.encode_pong)),
    "descriptions": (
        mutants(description_tree),
        schema.description,
        _again(codec.decode_description, codec.encode_description),
    ),
}


def _rss() -> int:
    gc.collect()
    found: int = psutil.Process().memory_info().rss
    return found


@pytest.mark.parametrize("inputs", PROFILES)
def test_accepted_messages_are_exactly_the_valid_ones(inputs: int) -> None:
    rng = Random(2)
    sources = {name: (made(rng), is_valid, again) for name, (made, is_valid, again) in KINDS.items()}
    names = ["acts"] * 6 + list(KINDS)
    verdicts: Counter[tuple[str, bool]] = Counter()
    reasons: Counter[str] = Counter()
    early = 0
    for number in range(inputs):
        if number == inputs // 10:
            early = _rss()
        name = names[number % len(names)]
        source, is_valid, again = sources[name]
        payload = next(source)
        try:
            again(payload)
            accepted = True
        except DecodeError as refused:
            reasons[refused.reason] += 1
            accepted = False
        assert accepted == is_valid(payload), (name, number, payload[:200])
        verdicts[name, accepted] += 1
    assert _rss() - early < 8 * 2**20, f"{(_rss() - early) / 2**20:.1f} MB more than after the first tenth"
    assert all(verdicts[name, accepted] > inputs // 400 for name in KINDS for accepted in (True, False)), verdicts
    assert sum(reasons.values()) == sum(found for (_, accepted), found in verdicts.items() if not accepted)
    assert len(reasons) >= 10, reasons


@pytest.mark.parametrize("inputs", PROFILES)
def test_hostile_contents_are_understood_or_not_but_never_crash(inputs: int) -> None:
    rng = Random(3)
    understood, refused = 0, list[str]()
    for _ in range(inputs // 10):
        tree = rng.choice(CONTENTS)
        for _ in range(rng.randrange(3)):
            tree = mutate_tree(tree, rng)
        try:
            act, _, _ = codec.decode_act(envelope(encode([*ACT[:4], tree, *ACT[5:]]), rng))
        except DecodeError:
            continue
        if act.content is None:
            continue
        try:
            found = contents.read(act.content)
        except ContentError as error:
            refused.append(str(error))
            continue
        understood += 1
        assert contents.read(found.expr()) == found
    assert understood > inputs // 100
    assert len(refused) > inputs // 100
    assert all(refused), "each is refused in words"


ACT = act_tree(Random(1))
CONTENTS: list[dict[str, Any]] = [
    {"": "monitor-proximity", "profile": "proximity", "avoidance": True},
    {"": "create-monitor", "name": "proximity", "task": "1-2-3", "coordinator": 0, "parameters": {"xy": 15.0}},
    {
        "": "create-multicast",
        "semantic-labels": ["heli-position"],
        "sample-period": 1.0,
        "delay": 1,
        "to-units": [0, "uav1"],
    },
    {"": "query", "semantic-label": "heli-position", "op": "between", "from": 5, "to": 7},
    {
        "": "samples",
        "unit": 0,
        "semantic-label": "battery",
        "samples": [{"": "reading", "valid": 1, "available": 2, "value": None}],
    },
    {
        "": "alarm",
        "id": "a/1",
        "event": "opened",
        "monitor": "m",
        "by": 0,
        "units": [0],
        "valid": 1,
        "detected": 2,
        "values": {"x[0, 1]": 1.5},
    },
    {"": "task-list", "tasks": [{"": "task", "conversation": "c", "task": "t", "unit": 1, "state": "running"}]},
    {"": "goto", "latitude_deg": 58.0, "longitude_deg": 15, "altitude_m": 100.5},
    {"": "fault", "kind": "gps-loss", "duration": 5.0, "value": 3},
    {"": "reason", "text": b"no"},
]


@pytest.mark.parametrize("name", HOSTILE_NAMES + [found for found in NASTY if isinstance(found, str)])
def test_a_name_becomes_part_of_a_key_only_if_the_key_means_it(name: str) -> None:
    for check, is_valid, build in [
        (keys.unit, schema.unit, keys.heartbeat),
        (keys.label, schema.label, lambda found: keys.stream("0", found, "ab12cd34")),
    ]:
        if is_valid(name):
            assert check(name) == name
            parsed = keys.parse_key(build(name))
            assert parsed is not None
            assert name in parsed
        else:
            with pytest.raises(keys.NameRefused):
                build(name)


def test_lying_lengths_cost_no_memory() -> None:
    bombs = [
        b"\xdd\x00\x00\xff\xff" * 1000,
        b"\xdc\x04\x00" * 1020,
        b"\x90" * 65_536,
        b"\xdf\x00\x00\xff\xff" * 1000,
        b"\xdc\xff\xff" + b"\x80" * 65_000,
    ]
    before = _rss()
    for bomb in bombs * 20:
        with pytest.raises(DecodeError):
            unpacking.unpack(bomb)
    assert _rss() - before < 16 * 2**20
