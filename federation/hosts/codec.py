"""Bytes <-> what platform and host say to each other: strict, what is malformed is a DecodeError and nothing else.

A message is a msgpack array: version, kind, fields. Samples are packed one by one where they arise, so that one that
cannot be encoded harms no other.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from operator import index
from typing import Any, Final

import msgpack

from dyknow.federation.hosts import messages
from dyknow.federation.messages.unpacking import (
    MAX_BYTES,
    VERSION,
    Check,
    count,
    fail,
    instant,
    many,
    optional,
    qualified,
    quality_of,
    record,
    sampled,
    unpack,
)
from dyknow.model.errors import ContentError, DecodeError, DyknowError
from dyknow.model.labels import Label
from dyknow.model.sample import SURE, Quality, Sample, Value
from dyknow.model.values import NO_VALUE
from dyknow.policies.policy import Policy
from dyknow.policies.sampling import Grid

MAX_TEXT: Final = 300
MAX_INPUTS: Final = 64
_SMALL: Final = 256
"""Bytes to begin with: the usual buffer takes longer to allocate than a message to write."""
_NAME = re.compile(r"\??[A-Za-z_][A-Za-z0-9_.-]{0,63}")


def encode(message: messages.FromHost | messages.FromPlatform) -> bytes:
    """A message as bytes.

    Raises:
        ContentError: it cannot be encoded, or is too long.
    """
    match message:
        case messages.HostOutput():
            return made_of(*message[:4], [pack_sample(each) for each in message.samples])
        case messages.HostInputs():
            return inputs_of(
                message.process, [pack_sample(each.sample, each.i) for each in message.inputs], message.past
            )
        case messages.HostFault(process, said):
            message = messages.HostFault(process, _shortened(said))
        case messages.Refuse(reason):
            message = messages.Refuse(_shortened(reason))
    packed: bytes = msgpack.packb((VERSION, _NUMBERS[type(message)], *message))
    if len(packed) > MAX_BYTES:
        raise ContentError(f"{type(message).__name__}: {len(packed)} bytes, at most {MAX_BYTES} fit one message")
    return packed


def made_of(process: int, taken: int, serial: int, past: bool, packed: Iterable[bytes]) -> bytes:
    """`Made` of samples that are packed already, with as many as `Backlog.take` puts together."""
    return _with_samples((VERSION, _NUMBERS[messages.HostOutput], process, taken, serial, past), list(packed))


def inputs_of(process: int, packed: Iterable[bytes], past: bool) -> bytes:
    """`Inputs`, likewise."""
    return _with_samples((VERSION, _NUMBERS[messages.HostInputs], process, past), list(packed))


def _with_samples(others: tuple[Any, ...], packed: list[bytes]) -> bytes:
    packer = msgpack.Packer(buf_size=_SMALL)
    head = [packer.pack_array_header(len(others) + 1), *map(packer.pack, others)]
    return b"".join([*head, packer.pack_array_header(len(packed)), *packed])


def _shortened(text: str) -> str:
    return text[:MAX_TEXT].encode(errors="replace").decode()


def pack_sample(sample: Sample, i: int = 0) -> bytes:
    """A sample as part of a message; raises ContentError if it cannot be encoded."""
    available_us, valid_us, value, quality = sample
    try:
        plain = _plain(value)
        sampled(plain)
        times = instant(index(available_us)), instant(index(valid_us))
        said = () if quality is SURE or quality == SURE else (_plainly(quality),)
        packed: bytes = msgpack.Packer(buf_size=_SMALL).pack((i, *times, plain, *said))
    except (DecodeError, ValueError, TypeError, OverflowError, RecursionError) as wrong:
        raise ContentError(f"{value!r:.80} cannot be handed to another process: {wrong}") from None
    if len(packed) > messages.SAMPLES_BYTES // 2:
        raise ContentError(f"a sample has at most {messages.SAMPLES_BYTES // 2} bytes, this one {len(packed)}")
    return packed


def _plain(value: Value) -> Any:
    """A value of plain types; sets of objects are in order."""
    kind = type(value)
    if kind is tuple:
        return value if all(type(member) is float for member in value) else tuple([_plain(member) for member in value])
    if kind in {float, int, str, bool}:
        return value
    if value is NO_VALUE:
        return None
    if isinstance(value, frozenset):
        return tuple(sorted(map(_plain, value), key=str))
    for plain in (bool, int, float, str):
        if isinstance(value, plain):
            return plain(value)
    raise TypeError(f"it is {kind.__name__}")


def _plainly(quality: Quality) -> tuple[Any, ...]:
    """A quality of plain floats, checked; when it was made, branch and weight of one that is predicted."""
    rows = tuple([tuple(map(float, row)) for row in quality.covariance])
    plain = qualified(float(quality.certainty), rows)
    return plain if quality.prediction is None else (*plain, *quality.prediction)


def _flag(found: Any) -> bool:
    return found if type(found) is bool else fail("flag")


def _text(found: Any) -> str:
    return found if type(found) is str and len(found) <= MAX_TEXT else fail("text", repr(found)[:80])


def _name(found: Any) -> str:
    return found if type(found) is str and _NAME.fullmatch(found) else fail("text", repr(found)[:80])


def _empty_or(check: Check) -> Check:
    """Check of a text that may be empty."""
    return lambda found: check(found) if _text(found) else found


def _parsed(parse: Callable[[str], object]) -> Check:
    """Check of a text that `parse` takes."""

    def check(found: Any) -> str:
        try:
            parse(_text(found))
        except (DyknowError, ValueError) as wrong:
            raise DecodeError("text", str(wrong)[:80]) from None
        return str(found)

    return check


def _period(found: Any) -> int:
    return count(found) or fail("number")


def _speed(found: Any) -> float:
    return found if type(found) is float and 0 < found < 1e9 else fail("number")


def _unit(found: Any) -> messages.UnitOffer:
    offer = _UNIT(found)
    if not offer.inputs or (offer.samplewise and len(offer.inputs) != 1):
        fail("shape")
    return offer


def _sample(found: Any) -> messages.HostInput:
    if type(found) is not tuple or not 4 <= len(found) <= 5:
        fail("shape")
    i, available_us, valid_us, value = found[:4]
    if count(i) >= MAX_INPUTS:
        fail("number")
    quality = SURE if len(found) == 4 else quality_of(found[4])
    return messages.HostInput(i, Sample(instant(available_us), instant(valid_us), sampled(value), quality))


def _output(found: Any) -> Sample:
    return _sample(found).sample


_GRID: Final = optional(record(Grid, _period, optional(instant)))
_LABEL: Final = _parsed(Label.parse)
_UNIT: Final = record(
    messages.UnitOffer, _name, _name, many(_name, MAX_INPUTS), _flag, count, _empty_or(_name), instant
)
_SOURCE: Final = record(messages.SourceOffer, _name, _name, _empty_or(_LABEL))
_SORT: Final = record(messages.SortOffer, _name, _text, many(record(messages.FieldOffer, _name, _text), MAX_INPUTS))
_FROM_HOST: Final[dict[type[Any], Check]] = {
    messages.Register: record(messages.Register, count, _text, _flag, many(_unit), many(_SOURCE), many(_SORT)),
    messages.HostOutput: record(messages.HostOutput, count, count, count, _flag, many(_output)),
    messages.HostFault: record(messages.HostFault, count, _text),
    messages.Beat: record(messages.Beat, count),
}
_FROM_PLATFORM: Final[dict[type[Any], Check]] = {
    messages.Welcome: record(messages.Welcome, _text, many(_text), instant, _speed, instant),
    messages.Refuse: record(messages.Refuse, _text),
    messages.Begin: record(messages.Begin, count, _name, _LABEL, instant, _empty_or(_parsed(Policy.parse)), _GRID),
    messages.Want: record(messages.Want, count, _GRID),
    messages.HostInputs: record(messages.HostInputs, count, _flag, many(_sample)),
    messages.Chain: record(messages.Chain, count, count, count, count),
    messages.End: record(messages.End, count),
}
"""The fields of each message; a message's kind is its place in the two tables, one behind the other."""
_NUMBERS: Final = {kind: number for number, kind in enumerate((*_FROM_HOST, *_FROM_PLATFORM))}
_HOST_READERS: Final = dict(enumerate(_FROM_HOST.values()))
_PLATFORM_READERS: Final = dict(enumerate(_FROM_PLATFORM.values(), len(_FROM_HOST)))


def decode_from_host(payload: bytes) -> messages.FromHost:
    """Decode a message of a host; raises DecodeError."""
    message: messages.FromHost = _read(payload, _HOST_READERS)
    if isinstance(message, messages.Register):
        names = [*(unit.name for unit in message.units), *(source.name for source in message.sources)]
        if len(set(names)) < len(names):
            fail("duplicate name")
    return message


def decode_from_platform(payload: bytes) -> messages.FromPlatform:
    """Decode a message of the platform; raises DecodeError."""
    message: messages.FromPlatform = _read(payload, _PLATFORM_READERS)
    return message


def _read(payload: bytes, readers: Mapping[int, Check]) -> Any:
    found = unpack(payload)
    if type(found) is not tuple or len(found) < 2:
        fail("shape")
    if type(found[0]) is not int or found[0] != VERSION:
        fail("version")
    if type(found[1]) is not int or found[1] not in readers:
        fail("kind")
    return readers[found[1]](found[2:])
