"""Bytes <-> messages. The only way in is strict: a message that decodes is well formed, and there is no other error
than DecodeError.

Every message is a msgpack array that begins with its version. Values from `dyknow.federation.messages.unpacking` are
checked field by field: names, finite numbers of 64 bits, nesting of at most 16. Acts and samples are checked by hand,
which is several times faster than a general validator; the tests compare with a schema that was written apart from
this.

A content travels as: expression = map with the head under the empty key, record = map, sequence = array, symbol = str,
quoted text = bin, `no_value` = nil.
"""

import re
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias

from pydantic import ValidationError

from dyknow.federation import keys
from dyknow.federation.messages import unpacking
from dyknow.federation.messages.acts import PERFORMATIVES, Act, AgentName
from dyknow.federation.messages.beats import MAX_BEAT, heard_of, tails_of
from dyknow.federation.messages.descriptions import Description
from dyknow.federation.messages.sexpr import MAX_COUNT, MAX_DEPTH, Expr, ExprValue, QuotedText, is_name
from dyknow.federation.messages.unpacking import named, pack
from dyknow.model.errors import ContentError, DecodeError, NameRefused
from dyknow.model.instants import LATEST_US
from dyknow.model.sample import SURE, Quality, Value
from dyknow.model.values import NO_VALUE

MAX_ACKS, MAX_RIDERS, MAX_EVERY = 256, 16, 16
SHORT = 8192
"""Bytes of samples that are kept as they were read, in 256 messages at most."""

Signature: TypeAlias = bytes
"""Ed25519 over the body of an act, 64 bytes."""

_IDENTIFIER = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,95}")


class StreamSample(NamedTuple):
    """One sample of a stream: its number there (from 1), its valid time, its value, and its quality.

    On the wire a quality is two fields more, certainty and covariance, unless it is the default; of a predicted value three
    more, when it was made, branch and weight: an earlier version refuses their form.
    """

    seq: int
    valid_us: int
    value: Value
    quality: Quality = SURE


class Rider(NamedTuple):
    """Samples of another stream of the same owner that travel in one message, since the same receivers get both."""

    label: str
    policy_hash: str
    samples: Sequence[StreamSample]


class StreamedSamples(NamedTuple):
    """The message on the key of a stream: its owner's incarnation, samples, riders; one of `every` samples is sent."""

    boot: int
    samples: Sequence[StreamSample]
    riders: Sequence[Rider]
    every: int = 1


class Range(NamedTuple):
    """A receiver asks for the samples it misses, as (first, last) numbers, both inclusive."""

    policy_hash: str
    boot: int
    ranges: Sequence[tuple[int, int]]


class Recovered(NamedTuple):
    """The owner's answer: its held samples of these numbers, and the oldest and newest number it has."""

    boot: int
    oldest: int
    tail: int
    samples: Sequence[StreamSample]


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
    """Clock question: sent at `sent_us` of the requester's node clock."""

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
        ContentError: it cannot be encoded: too large, or a value that no act carries.
    """
    try:
        body = pack(
            (
                unpacking.VERSION,
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
                *((act.evidence,) if act.evidence else ()),
            )
        )
        payload = pack((body, None if sign is None else sign(body)))
    except (ValueError, TypeError, OverflowError) as wrong:
        raise ContentError(f"an act cannot carry this: {wrong}") from None
    if len(payload) > unpacking.MAX_BYTES:
        raise ContentError(
            f"an act has at most {unpacking.MAX_BYTES} bytes, this one {len(payload)}: say less, or in parts"
        )
    return payload


def decode_act(payload: bytes) -> tuple[Act, Signature | None, bytes]:
    """The act, its signature if it has one, and the bytes that the signature is over.

    Raises:
        DecodeError: anything is not as `encode_act` would have written it.
    """
    body, signature = unpacking.fields(unpacking.unpack(payload), 2)
    if type(body) is not bytes:
        unpacking.fail("shape")
    if signature is not None and (type(signature) is not bytes or len(signature) != 64):
        unpacking.fail("signature")
    (
        performative, sender, receiver, content, conversation, protocol, reply_with, in_reply_to, reply_by,
        language, encoding, ontology, reply_to, boot, seq, created, acks, *more,
    ) = unpacking.versioned(unpacking.unpack(body), 17, 18)  # fmt: skip
    if type(performative) is not str or performative not in PERFORMATIVES:
        unpacking.fail("performative")
    if content is not None:
        content = _value(content, 0)
        if type(content) is not Expr:
            unpacking.fail("content", "not an expression")
    for word in (conversation, protocol, reply_with, in_reply_to, language, encoding, ontology):
        if word is not None and (type(word) is not str or not _IDENTIFIER.fullmatch(word)):
            unpacking.fail("name")
    for seq_heard in unpacking.items(acks, MAX_ACKS):
        unpacking.count(seq_heard)
    act = Act(
        PERFORMATIVES[performative],
        _speaker(sender),
        _agent(receiver),
        content,
        conversation,
        protocol,
        reply_with,
        in_reply_to,
        None if reply_by is None else unpacking.stamp(reply_by),
        language,
        encoding,
        ontology,
        None if reply_to is None else _speaker(reply_to),
        unpacking.count(boot),
        unpacking.count(seq),
        unpacking.stamp(created),
        acks,
        unpacking.evidence(more[0]) if more else b"",
    )
    return act, signature, body


def _agent(value: Any) -> AgentName:
    if type(value) is not str:
        unpacking.fail("name")
    try:
        return AgentName.parse(value)
    except NameRefused:
        unpacking.fail("name")


def _speaker(value: Any) -> AgentName:
    """One agent, not the same agent everywhere."""
    name = _agent(value)
    if name.unit == keys.EVERYBODY:
        unpacking.fail("name")
    return name


def _plain(value: ExprValue) -> Any:
    """A content as msgpack says it."""
    kind = type(value)
    if kind is Expr:
        named = {name: _plain(member) for name, member in value.arguments.items()}  # type: ignore[union-attr]
        return {"": value.head, **named}  # type: ignore[union-attr]
    if kind is QuotedText:
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
        return value if value - value == 0.0 else unpacking.fail("not finite")
    if kind is int:
        return unpacking.whole(value)
    if kind is bytes:
        return _text(value)
    if value is None:
        return NO_VALUE
    if depth >= MAX_DEPTH:
        unpacking.fail("nesting")
    if kind is tuple:
        return tuple([_value(member, depth + 1) for member in value])
    return _mapping(value, depth) if kind is dict else unpacking.fail("type")


def _mapping(found: dict[Any, Any], depth: int) -> Expr | dict[str, Any]:
    is_expr = "" in found
    head = found.pop("", None)
    if is_expr and (type(head) is not str or not is_name(head)):
        unpacking.fail("head")
    members: dict[str, Any] = {}
    for name, member in found.items():
        if type(name) is not str or len(name) > 256 or (is_expr and not is_name(name)):
            unpacking.fail("name")
        members[name] = _value(member, depth + 1)
    return Expr(head, members) if is_expr else members


def _text(value: bytes) -> QuotedText:
    if len(value) > unpacking.MAX_STRING:
        unpacking.fail("oversized")
    try:
        return QuotedText(value.decode())
    except UnicodeDecodeError:
        unpacking.fail("malformed")


# Samples: the hot path

_new = tuple.__new__  # makes a NamedTuple in half the time


def encode_samples(
    boot: int,
    samples: Sequence[StreamSample],
    pack: Callable[[object], bytes] = pack,
    riders: Sequence[Rider] = (),
    every: int = 1,
) -> bytes:
    """Samples of one stream, which the key they are put on names, and of others of that owner that travel with it."""
    if every == 1 and not riders:
        return pack((unpacking.VERSION, boot, _packed(samples)))
    carried = [(label, policy_hash, _packed(entries)) for label, policy_hash, entries in riders]
    return pack((unpacking.VERSION, boot, _packed(samples), carried, *((every,) if every > 1 else ())))


def _packed(samples: Sequence[StreamSample]) -> list[tuple[Any, ...]]:
    return [
        sample[:3] if sample.quality is SURE else (*sample[:3], *unpacking.plain_quality(sample.quality))
        for sample in samples
    ]


def decode_samples(payload: bytes) -> StreamedSamples:
    """The message on the key of a stream; raises DecodeError. Read once for all in a process, if it is not long."""
    return _short_samples(payload) if len(payload) <= SHORT else _read_samples(payload)


def _read_samples(payload: bytes) -> StreamedSamples:
    boot, samples, *more = unpacking.versioned(unpacking.unpack(payload), 2, 4)
    riders = _riders(more[0]) if more else ()
    if not 1 <= (every := unpacking.count(more[1]) if len(more) > 1 else 1) <= MAX_EVERY:
        unpacking.fail("number")
    return _new(StreamedSamples, (unpacking.count(boot), tuple(_samples(samples)), riders, every))


_short_samples = lru_cache(maxsize=256)(_read_samples)


def _riders(found: Any) -> tuple[Rider, ...]:
    riders = []
    for rider in unpacking.items(found, MAX_RIDERS):
        label, policy_hash, samples = unpacking.fields(rider, 3)
        if type(label) is not str or type(policy_hash) is not str:
            unpacking.fail("name")
        riders.append(Rider(*_stream(label, policy_hash), tuple(_samples(samples))))
    return tuple(riders)


@lru_cache(maxsize=1024)
def _stream(label: str, policy_hash: str) -> tuple[str, str]:
    """The names of a stream, checked; repeated names are checked once."""
    return named(keys.label, label), unpacking.digest(policy_hash)


def _samples(found: Any) -> list[StreamSample]:
    samples: list[StreamSample] = []
    for entry in unpacking.items(found):
        if type(entry) is not tuple or len(entry) not in (3, 5, 8):
            unpacking.fail("shape")
        seq, valid_us, value = entry if len(entry) == 3 else entry[:3]
        if type(seq) is not int or type(valid_us) is not int:
            unpacking.fail("number")
        if not (0 < seq <= MAX_COUNT and -LATEST_US <= valid_us <= LATEST_US):
            unpacking.fail("number")
        quality = SURE if len(entry) == 3 else unpacking.quality_of(entry[3:])
        samples.append(_new(StreamSample, (seq, valid_us, unpacking.sampled(value), quality)))
    return samples


def _numbers(pair: Any) -> tuple[int, int]:
    first, last = unpacking.fields(pair, 2)
    return (first, last) if 0 < unpacking.count(first) <= unpacking.count(last) else unpacking.fail("shape")


encode_range, decode_range = unpacking.codec(Range, unpacking.digest, unpacking.count, unpacking.many(_numbers))
decode_recovered = unpacking.codec(Recovered, unpacking.count, unpacking.count, unpacking.count, _samples)[1]


def encode_recovered(answer: Recovered) -> bytes:
    return pack((unpacking.VERSION, *answer[:3], _packed(answer.samples)))


# The directory and the clock


def encode_heartbeat(heartbeat: Heartbeat) -> bytes:
    return pack((unpacking.VERSION, *heartbeat))


def decode_heartbeat(payload: bytes) -> Heartbeat:
    """A heartbeat; parts equal to those of its unit's last one, above all the units it hears, are the same objects."""
    if len(payload) > MAX_BEAT:
        unpacking.fail("oversized", f"{len(payload)} bytes")
    unit, boot, seq, wall_us, description, hears, tails = unpacking.array(payload, 7)
    unit = named(keys.unit, unit)
    numbers = unpacking.count(boot), unpacking.count(seq), unpacking.stamp(wall_us), unpacking.count(description)
    return Heartbeat(unit, *numbers, heard_of(unit, hears), tails_of(unit, boot, tails))


def encode_description(description: Description) -> bytes:
    return pack((unpacking.VERSION, description.model_dump()))


def decode_description(payload: bytes) -> Description:
    (found,) = unpacking.array(payload, 1)
    try:
        return Description.model_validate(found)
    except ValidationError as wrong:
        first = wrong.errors(include_url=False, include_input=False)[0]
        raise DecodeError("description", f"{first['loc']}: {first['msg']}"[:120]) from None


encode_ping, decode_ping = unpacking.codec(Ping, unpacking.instant)
encode_pong, decode_pong = unpacking.codec(
    Pong, unpacking.count, unpacking.instant, unpacking.instant, unpacking.instant
)
