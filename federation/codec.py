"""Bytes <-> messages. The only way in is strict: what decodes is well formed, and no other error than DecodeError.

Every message is a msgpack array that begins with its version. What `federation.unpacking` lets through is checked field
by field: names, finite numbers of 64 bits, nesting of at most 16. Acts and samples are checked by hand, which is several
times faster than a general validator; the tests compare with a schema that was written apart from this.

A content travels as: expression = map with the head under the empty key, record = map, sequence = array, symbol = str,
quoted text = bin, `no_value` = nil.
"""

import re
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, Final, NamedTuple, TypeAlias

from pydantic import ValidationError

from dyknow.errors import ContentError, DecodeError, NameRefused
from dyknow.sample import SURE, Quality, Value
from dyknow.values import NO_VALUE
from federation import keys
from federation.acts import PERFORMATIVES, Act, AgentName
from federation.sexpr import MAX_DEPTH, MAX_INTEGER, MIN_INTEGER, Expr, ExprValue, Text, is_name
from federation.unpacking import (
    MAX_BYTES,
    MAX_STRING,
    VERSION,
    array,
    count,
    digest,
    fail,
    instant,
    items,
    named,
    pack,
    qualified,
    sampled,
    unpack,
)
from federation.wire import Description

MAX_ACKS: Final = 256

Signature: TypeAlias = bytes
"""Ed25519 over the body of an act, 64 bytes."""

_IDENTIFIER = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")


class StreamSample(NamedTuple):
    """One sample on the wire: its number in the stream (from 1), when it held, and its value."""

    seq: int
    valid_us: int
    value: Value

    @property
    def quality(self) -> Quality:
        """Nothing is said of it."""
        return SURE


class QualifiedSample(NamedTuple):
    """The same, with what its maker says of it: probability that it is right, and covariance of its components."""

    seq: int
    valid_us: int
    value: Value
    certainty: float
    covariance: tuple[tuple[float, ...], ...]

    @property
    def quality(self) -> Quality:
        """As the local instance has it."""
        return Quality(self.certainty, self.covariance)


WireSample: TypeAlias = StreamSample | QualifiedSample


class Range(NamedTuple):
    """A receiver asks for the samples it misses, as (first, last) numbers, both inclusive."""

    policy_hash: str
    boot: int
    ranges: Sequence[tuple[int, int]]


class Recovered(NamedTuple):
    """The owner's answer: what it holds of them, and the oldest and newest number it has."""

    boot: int
    oldest: int
    tail: int
    samples: Sequence[WireSample]


class Heartbeat(NamedTuple):
    """Five times a second: I live, I hear these units, my streams have come so far.

    Attributes:
        unit: whose heartbeat it is.
        boot: which life of that platform; greater in each later one.
        seq: number of the heartbeat in that life.
        wall_us: the sender's node clock.
        description: version of the sender's description, so that a change is noticed.
        hears: the units whose heartbeats reach the sender.
        tails: (semantic label, policy hash, number of the newest sample) of the exported streams.
    """

    unit: str
    boot: int
    seq: int
    wall_us: int
    description: int
    hears: Sequence[str] = ()
    tails: Sequence[tuple[str, str, int]] = ()


class Ping(NamedTuple):
    """Clock question: sent at `sent_us` of the asker's node clock."""

    sent_us: int


class Pong(NamedTuple):
    """Clock answer: the question's stamp, and when it was received and answered by the answerer's node clock."""

    boot: int
    sent_us: int
    received_us: int
    answered_us: int


# Acts


def encode_act(act: Act, sign: Callable[[bytes], Signature] | None = None) -> bytes:
    """An act as bytes, signed over its body if `sign` is given.

    Raises:
        ContentError: it cannot be said: too large, or a value that no act carries.
    """
    try:
        body = pack(
            (
                VERSION,
                act.performative,
                str(act.sender),
                str(act.receiver),
                None if act.content is None else _plain(act.content),
                act.conversation_id,
                act.protocol,
                act.reply_with,
                act.in_reply_to,
                act.reply_by_us,
                act.language,
                act.encoding,
                act.ontology,
                None if act.reply_to is None else str(act.reply_to),
                act.boot,
                act.seq,
                act.created_us,
                act.acks,
            )
        )
        payload = pack((body, None if sign is None else sign(body)))
    except (ValueError, TypeError, OverflowError) as wrong:
        raise ContentError(f"an act cannot carry this: {wrong}") from None
    if len(payload) > MAX_BYTES:
        raise ContentError(f"an act has at most {MAX_BYTES} bytes, this one {len(payload)}: say less, or in parts")
    return payload


def decode_act(payload: bytes) -> tuple[Act, Signature | None, bytes]:
    """The act, its signature if it has one, and the bytes that the signature is over.

    Raises:
        DecodeError: anything is not as `encode_act` would have written it.
    """
    envelope = unpack(payload)
    if type(envelope) is not tuple or len(envelope) != 2 or type(envelope[0]) is not bytes:
        fail("shape")
    body, signature = envelope
    if signature is not None and (type(signature) is not bytes or len(signature) != 64):
        fail("signature")
    (
        performative, sender, receiver, content, conversation, protocol, reply_with, in_reply_to, reply_by,
        language, encoding, ontology, reply_to, boot, seq, created, acks,
    ) = array(body, 17)  # fmt: skip
    if type(performative) is not str or performative not in PERFORMATIVES:
        fail("performative")
    if content is not None:
        content = _value(content, 0)
        if type(content) is not Expr:
            fail("content", "not an expression")
    for word in (conversation, protocol, reply_with, in_reply_to, language, encoding, ontology):
        if word is not None and (type(word) is not str or not _IDENTIFIER.fullmatch(word)):
            fail("name")
    for seq_heard in items(acks, MAX_ACKS):
        count(seq_heard)
    act = Act(
        PERFORMATIVES[performative],
        _speaker(sender),
        _agent(receiver),
        content,
        conversation,
        protocol,
        reply_with,
        in_reply_to,
        None if reply_by is None else count(reply_by),
        language,
        encoding,
        ontology,
        None if reply_to is None else _speaker(reply_to),
        count(boot),
        count(seq),
        count(created),
        acks,
    )
    return act, signature, body


def _agent(value: Any) -> AgentName:
    if type(value) is not str:
        fail("name")
    try:
        return AgentName.parse(value)
    except NameRefused:
        fail("name")


def _speaker(value: Any) -> AgentName:
    """One agent, not the same agent everywhere."""
    name = _agent(value)
    if name.unit == keys.EVERYBODY:
        fail("name")
    return name


def _plain(value: ExprValue) -> Any:
    """A content as msgpack says it."""
    kind = type(value)
    if kind is Expr:
        named = {name: _plain(member) for name, member in value.arguments.items()}  # type: ignore[union-attr]
        return {"": value.head, **named}  # type: ignore[union-attr]
    if kind is Text:
        return value.encode()  # type: ignore[union-attr]
    if kind is tuple:
        return [_plain(member) for member in value]  # type: ignore[union-attr]
    if kind is dict:
        return {name: _plain(member) for name, member in value.items()}  # type: ignore[union-attr]
    return value


def _value(value: Any, depth: int) -> Any:
    """A content back from msgpack, checked."""
    kind = type(value)
    if kind is str or kind is bool:
        return value
    if kind is float:
        return value if value - value == 0.0 else fail("not finite")
    if kind is int:
        return value if MIN_INTEGER <= value <= MAX_INTEGER else fail("number")
    if kind is bytes:
        return _text(value)
    if value is None:
        return NO_VALUE
    if depth >= MAX_DEPTH:
        fail("nesting")
    if kind is tuple:
        return tuple([_value(member, depth + 1) for member in value])
    return _mapping(value, depth) if kind is dict else fail("type")


def _mapping(found: dict[Any, Any], depth: int) -> Expr | dict[str, Any]:
    is_expr = "" in found
    head = found.pop("", None)
    if is_expr and (type(head) is not str or not is_name(head)):
        fail("head")
    members: dict[str, Any] = {}
    for name, member in found.items():
        if type(name) is not str or len(name) > 256 or (is_expr and not is_name(name)):
            fail("name")
        members[name] = _value(member, depth + 1)
    return Expr(head, members) if is_expr else members


def _text(value: bytes) -> Text:
    if len(value) > MAX_STRING:
        fail("oversized")
    try:
        return Text(value.decode())
    except UnicodeDecodeError:
        fail("malformed")


# Samples: the hot path


def encode_samples(boot: int, samples: Sequence[WireSample], pack: Callable[[object], bytes] = pack) -> bytes:
    """Samples of one stream; the key they are put on says which."""
    return pack((VERSION, boot, samples))


@lru_cache(maxsize=256)
def decode_samples(payload: bytes) -> tuple[int, Sequence[WireSample]]:
    """Which life of the owner sent them, and the samples; raises DecodeError. Read once for all in a process."""
    boot, samples = array(payload, 2)
    return count(boot), tuple(_samples(samples))


def _samples(found: Any) -> list[WireSample]:
    samples: list[WireSample] = []
    for entry in items(found):
        if type(entry) is not tuple or len(entry) not in (3, 5):
            fail("shape")
        seq, valid_us, value = entry[:3]
        if type(seq) is not int or type(valid_us) is not int:
            fail("number")
        if not (0 < seq <= MAX_INTEGER and MIN_INTEGER <= valid_us <= MAX_INTEGER):
            fail("number")
        if len(entry) == 3:
            samples.append(StreamSample(seq, valid_us, sampled(value)))
        else:
            samples.append(QualifiedSample(seq, valid_us, sampled(value), *qualified(*entry[3:])))
    return samples


def encode_range(question: Range) -> bytes:
    return pack((VERSION, *question))


def decode_range(payload: bytes) -> Range:
    policy_hash, boot, ranges = array(payload, 3)
    for pair in items(ranges):
        if type(pair) is not tuple or len(pair) != 2 or not 0 < count(pair[0]) <= count(pair[1]):
            fail("shape")
    return Range(digest(policy_hash), count(boot), ranges)


def encode_recovered(answer: Recovered) -> bytes:
    return pack((VERSION, *answer))


def decode_recovered(payload: bytes) -> Recovered:
    boot, oldest, tail, samples = array(payload, 4)
    return Recovered(count(boot), count(oldest), count(tail), _samples(samples))


# The directory and the clock


def encode_heartbeat(heartbeat: Heartbeat) -> bytes:
    return pack((VERSION, *heartbeat))


def decode_heartbeat(payload: bytes) -> Heartbeat:
    """A heartbeat; what one has in common with that before it, whom it hears above all, is the same object in both."""
    unit, boot, seq, wall_us, description, hears, tails = array(payload, 7)
    if not all(type(name) is str for name in items(hears)):
        fail("name")
    for tail in items(tails):
        if type(tail) is not tuple or len(tail) != 3:
            fail("shape")
        if type(tail[0]) is not str or type(tail[1]) is not str:
            fail("name")
        count(tail[2])
    numbers = count(boot), count(seq), count(wall_us), count(description)
    return Heartbeat(named(keys.unit, unit), *numbers, _heard(hears), _tails(boot, tails))


@lru_cache(maxsize=1024)
def _heard(units: tuple[str, ...]) -> tuple[str, ...]:
    for name in units:
        named(keys.unit, name)
    return units


@lru_cache(maxsize=1024)
def _tails(_boot: int, tails: tuple[tuple[str, str, int], ...]) -> tuple[tuple[str, str, int], ...]:
    """Those of another life are another object."""
    for label, policy_hash, _ in tails:
        named(keys.label, label)
        digest(policy_hash)
    return tails


def encode_description(description: Description) -> bytes:
    return pack((VERSION, description.model_dump()))


@lru_cache(maxsize=1024)
def decode_description(payload: bytes) -> Description:
    (found,) = array(payload, 1)
    try:
        return Description.model_validate(found)
    except ValidationError as wrong:
        first = wrong.errors(include_url=False, include_input=False)[0]
        raise DecodeError("description", f"{first['loc']}: {first['msg']}"[:120]) from None


def encode_ping(ping: Ping) -> bytes:
    return pack((VERSION, *ping))


def decode_ping(payload: bytes) -> Ping:
    (sent_us,) = array(payload, 1)
    return Ping(instant(sent_us))


def encode_pong(pong: Pong) -> bytes:
    return pack((VERSION, *pong))


def decode_pong(payload: bytes) -> Pong:
    boot, *stamps = array(payload, 4)
    return Pong(count(boot), *map(instant, stamps))
