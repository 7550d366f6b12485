"""What is a valid message, said apart from the product: an own reader of msgpack, and plain predicates over it."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from struct import unpack_from
from typing import Any

LOWER = frozenset("abcdefghijklmnopqrstuvwxyz")
DIGITS = frozenset("0123456789")
HEX = DIGITS | frozenset("abcdef")
SCHEME = {"acl", "all", "df", "hb", "q", "time", "x"}
PERFORMATIVES = {
    "accept-proposal",
    "agree",
    "cancel",
    "cfp",
    "confirm",
    "disconfirm",
    "failure",
    "inform",
    "inform-if",
    "inform-ref",
    "not-understood",
    "propagate",
    "propose",
    "proxy",
    "query-if",
    "query-ref",
    "refuse",
    "reject-proposal",
    "request",
    "request-when",
    "request-whenever",
    "subscribe",
}


class Invalid(Exception):
    pass


@dataclass
class Map:
    pairs: list[tuple[Any, Any]]


class _Reader:
    """msgpack, from its specification: no extension, nothing left over, UTF-8 strings, bounded lengths."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def take(self, count: int) -> bytes:
        if self.at + count > len(self.data):
            raise Invalid("cut off")
        self.at += count
        return self.data[self.at - count : self.at]

    def number(self, code: str, size: int) -> Any:
        return unpack_from(">" + code, self.take(size))[0]

    def read(self, depth: int = 0) -> Any:
        if depth > 40:
            raise Invalid("deep")
        tag = self.take(1)[0]
        if tag < 0x80:
            return tag
        if tag >= 0xE0:
            return tag - 256
        if tag < 0x90:
            return self.map(tag & 15, depth)
        if tag < 0xA0:
            return self.array(tag & 15, depth)
        if tag < 0xC0:
            return self.text(tag & 31)
        simple = {0xC0: None, 0xC2: False, 0xC3: True}
        if tag in simple:
            return simple[tag]
        numbers = {
            0xCA: "f4",
            0xCB: "d8",
            0xCC: "B1",
            0xCD: "H2",
            0xCE: "I4",
            0xCF: "Q8",
            0xD0: "b1",
            0xD1: "h2",
            0xD2: "i4",
            0xD3: "q8",
        }
        if tag in numbers:
            return self.number(numbers[tag][0], int(numbers[tag][1]))
        sized: dict[int, tuple[str, int, Callable[[int], Any]]] = {
            0xC4: ("B", 1, self.take), 0xC5: ("H", 2, self.take), 0xC6: ("I", 4, self.take),
            0xD9: ("B", 1, self.text), 0xDA: ("H", 2, self.text), 0xDB: ("I", 4, self.text),
            0xDC: ("H", 2, lambda n: self.array(n, depth)), 0xDD: ("I", 4, lambda n: self.array(n, depth)),
            0xDE: ("H", 2, lambda n: self.map(n, depth)), 0xDF: ("I", 4, lambda n: self.map(n, depth)),
        }  # fmt: skip
        if tag not in sized:
            raise Invalid("extension or unused tag")
        code, size, then = sized[tag]
        return then(self.number(code, size))

    def text(self, length: int) -> str:
        if length > 32_768:
            raise Invalid("long")
        try:
            return self.take(length).decode()
        except UnicodeDecodeError:
            raise Invalid("not UTF-8") from None

    def array(self, length: int, depth: int) -> list[Any]:
        if length > 1024:
            raise Invalid("many")
        return [self.read(depth + 1) for _ in range(length)]

    def map(self, length: int, depth: int) -> Map:
        if length > 1024:
            raise Invalid("many")
        pairs = [(self.read(depth + 1), self.read(depth + 1)) for _ in range(length)]
        names = [name for name, _ in pairs]
        if not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
            raise Invalid("keys")
        return Map(pairs)


def read(data: bytes) -> Any:
    if len(data) > 65_536:
        raise Invalid("oversized")
    reader = _Reader(data)
    found = reader.read()
    if reader.at < len(data):
        raise Invalid("something behind it")
    return found


def _is(kind: type, value: Any) -> bool:
    return type(value) is kind


def count(value: Any, least: int = 0) -> bool:
    return _is(int, value) and least <= value <= 2**62


def whole(value: Any) -> bool:
    return _is(int, value) and -(2**63) <= value < 2**63


def instant(value: Any) -> bool:
    """From the year 69 to 3871, in microseconds."""
    return whole(value) and abs(value) <= 60_000_000 * 10**9


def stamp(value: Any) -> bool:
    return instant(value) and value >= 0


def number(value: Any) -> bool:
    return _is(float, value) and abs(value) <= 1e30


def unit(value: Any) -> bool:
    if not _is(str, value) or not 1 <= len(value) <= 32 or value in SCHEME:
        return False
    if value[0] in DIGITS:
        return set(value) <= DIGITS and (value == "0" or value[0] != "0")
    parts = value.split("-")
    return value[0] in LOWER and all(part and set(part) <= LOWER | DIGITS | {"_"} for part in parts)


def label(value: Any) -> bool:
    if not _is(str, value) or not 1 <= len(value) <= 64 or value[0] not in LOWER:
        return False
    return all(part and set(part) <= LOWER | DIGITS for part in value.split("-"))


def speaker(value: Any, *, everybody: bool = False) -> bool:
    if not _is(str, value) or value.count("@") != 1:
        return False
    agent, name = value.split("@")
    return label(agent) and (unit(name) or (everybody and name == "all"))


def identifier(value: Any) -> bool:
    if not _is(str, value) or not 1 <= len(value) <= 96 or not value.isascii():
        return False
    return value[0].isalnum() and all(char.isalnum() or char in "_.-" for char in value)


def eight_hex(value: Any) -> bool:
    return _is(str, value) and len(value) == 8 and set(value) <= HEX


def argument(value: str) -> bool:
    parts = value.replace("_", "-").split("-")
    return 1 <= len(value) <= 64 and value[0] in LOWER and all(part and set(part) <= LOWER | DIGITS for part in parts)


def content(value: Any, depth: int = 0) -> bool:
    if value is None or _is(bool, value) or _is(str, value):
        return True
    if _is(float, value):
        return isfinite(value)
    if _is(int, value):
        return whole(value)
    if _is(bytes, value):
        try:
            value.decode()
        except UnicodeDecodeError:
            return False
        return len(value) <= 32_768
    if depth >= 16:
        return False
    if _is(list, value):
        return all(content(member, depth + 1) for member in value)
    named = dict(value.pairs)
    if not all(content(member, depth + 1) for name, member in named.items() if name):
        return False
    if "" not in named:
        return all(len(name) <= 256 for name in named)
    words = [named.pop(""), *named]
    return all(_is(str, word) and argument(word) and word not in {"sequence", "record"} for word in words)


def _message(payload: bytes, fields: int, most: int = 0) -> list[Any]:
    found = read(payload)
    if (
        not _is(list, found)
        or not fields < len(found) <= max(most, fields) + 1
        or not _is(int, found[0])
        or found[0] != 1
    ):
        raise Invalid("not a message of that kind")
    return found[1:]


def valid(check: Callable[[bytes], bool]) -> Callable[[bytes], bool]:
    def checked(payload: bytes) -> bool:
        try:
            return check(payload)
        except Invalid:
            return False

    return checked


@valid
def act(payload: bytes) -> bool:
    envelope = read(payload)
    if not _is(list, envelope) or len(envelope) != 2 or not _is(bytes, envelope[0]):
        return False
    body, signature = envelope
    if signature is not None and not (_is(bytes, signature) and len(signature) == 64):
        return False
    fields = _message(body, 17, 18)
    (kind, sender, receiver, said, *words, language, encoding, ontology, reply_to, boot, seq, created, acks) = fields[
        :17
    ]
    *words, reply_by = words
    return (
        _is(str, kind) and kind in PERFORMATIVES
        and speaker(sender) and speaker(receiver, everybody=True) and (reply_to is None or speaker(reply_to))
        and (said is None or (isinstance(said, Map) and "" in dict(said.pairs) and content(said)))
        and all(word is None or identifier(word) for word in (*words, language, encoding, ontology))
        and (reply_by is None or stamp(reply_by))
        and count(boot) and count(seq) and stamp(created)
        and _is(list, acks) and len(acks) <= 256 and all(count(ack) for ack in acks)
        and all(_is(bytes, evidence) and 0 < len(evidence) <= 16_384 for evidence in fields[17:])
    )  # fmt: skip


def value(found: Any, depth: int = 0) -> bool:
    if found is None or _is(bool, found):
        return True
    if _is(str, found):
        return len(found) <= 16_384
    if _is(float, found):
        return number(found)
    if _is(int, found):
        return whole(found)
    return _is(list, found) and depth < 4 and all(value(member, depth + 1) for member in found)


def entries(found: Any) -> bool:
    return _is(list, found) and all(
        _is(list, entry)
        and len(entry) in {3, 5, 8}
        and count(entry[0], 1)
        and instant(entry[1])
        and value(entry[2])
        and (len(entry) == 3 or quality(*entry[3:5]))
        and (len(entry) < 8 or prediction(*entry[5:]))
        for entry in found
    )


def prediction(made_us: Any, branch: Any, weight: Any) -> bool:
    is_branch = _is(str, branch) and len(branch) <= 64 and branch.isprintable()
    return instant(made_us) and is_branch and _is(float, weight) and 0.0 <= weight <= 1.0


def quality(certainty: Any, covariance: Any) -> bool:
    return (
        _is(float, certainty)
        and 0.0 <= certainty <= 1.0
        and _is(list, covariance)
        and len(covariance) <= 16
        and all(
            _is(list, row) and len(row) == len(covariance) and all(number(each) for each in row) for row in covariance
        )
    )


@valid
def samples(payload: bytes) -> bool:
    riders: list[Any] = []
    every = 1
    try:
        boot, found = _message(payload, 2)
    except Invalid:
        try:
            boot, found, riders = _message(payload, 3)
        except Invalid:
            boot, found, riders, every = _message(payload, 4)
    return (
        count(every)
        and 1 <= every <= 16
        and count(boot)
        and entries(found)
        and _is(list, riders)
        and len(riders) <= 16
        and all(_is(list, r) and len(r) == 3 and label(r[0]) and eight_hex(r[1]) and entries(r[2]) for r in riders)
    )


@valid
def recovered(payload: bytes) -> bool:
    boot, oldest, tail, found = _message(payload, 4)
    return count(boot) and count(oldest) and count(tail) and entries(found)


@valid
def wanted(payload: bytes) -> bool:
    policy, boot, ranges = _message(payload, 3)
    pairs = _is(list, ranges) and all(
        _is(list, pair) and len(pair) == 2 and count(pair[0], 1) and count(pair[1]) and pair[0] <= pair[1]
        for pair in ranges
    )
    return eight_hex(policy) and count(boot) and pairs


@valid
def heartbeat(payload: bytes) -> bool:
    name, boot, seq, wall, version, hears, tails = _message(payload, 7)
    return (
        unit(name) and all(count(each) for each in (boot, seq, version)) and stamp(wall)
        and _is(list, hears) and all(unit(heard) for heard in hears)
        and _is(list, tails)
        and all(_is(list, t) and len(t) == 3 and label(t[0]) and eight_hex(t[1]) and count(t[2]) for t in tails)
    )  # fmt: skip


@valid
def pong(payload: bytes) -> bool:
    boot, *stamps = _message(payload, 4)
    return count(boot) and all(map(instant, stamps))


def table(found: Any, needed: dict[str, Callable[[Any], bool]], optional: dict[str, Callable[[Any], bool]]) -> bool:
    if not isinstance(found, Map):
        return False
    named = dict(found.pairs)
    checks = {**needed, **optional}
    return needed.keys() <= named.keys() <= checks.keys() and all(
        checks[name](member) for name, member in named.items()
    )


def tables(found: Any, needed: dict[str, Callable[[Any], bool]], optional: dict[str, Callable[[Any], bool]]) -> bool:
    return _is(list, found) and len(found) <= 256 and all(table(member, needed, optional) for member in found)


def _one_of(*words: str) -> Callable[[Any], bool]:
    return lambda found: _is(str, found) and found in words


@valid
def description(payload: bytes) -> bool:
    (found,) = _message(payload, 1)
    service = {"agent": label, "service": label, "visibility": _one_of("public", "protected")}
    stream = {"label": label, "sort": label, "type_hash": eight_hex}
    return table(
        found,
        {"unit": unit, "boot": count, "version": count, "kind": _one_of("uav", "command-centre")},
        {
            "clock_epoch_us": stamp,
            "clock_speed": lambda speed: (_is(float, speed) or _is(int, speed)) and 0 < speed <= 1e6,
            "roster": lambda mark: mark is None or (_is(str, mark) and len(mark) == 16 and set(mark) <= HEX),
            "services": lambda rows: tables(rows, service, {"version": count}),
            "labels": lambda rows: tables(rows, stream, {"period_us": stamp}),
        },
    )
