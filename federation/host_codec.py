"""Bytes <-> what platform and host say to each other: strict, what is malformed is a DecodeError and nothing else.

A message is a msgpack array: version, kind, fields. Samples are packed one by one where they arise, so that one that
cannot be said harms no other.
"""

import re
from collections.abc import Callable, Iterable
from operator import index
from typing import Any, Final, NoReturn

import msgpack

from dyknow.errors import ContentError, DecodeError, DyknowError
from dyknow.labels import Label
from dyknow.policy import Policy
from dyknow.sample import SURE, Quality, Sample, Value
from dyknow.sampling import Grid
from dyknow.values import NO_VALUE
from federation.hosting import (
    SAMPLES_BYTES,
    Beat,
    Begin,
    Chain,
    End,
    Fault,
    FromHost,
    FromPlatform,
    Input,
    Inputs,
    Made,
    Refuse,
    Register,
    SourceOffer,
    UnitOffer,
    Want,
    Welcome,
)
from federation.unpacking import MAX_BYTES, VERSION, count, fail, instant, items, qualified, sampled, unpack

MAX_TEXT: Final = 300
MAX_INPUTS: Final = 64
_SMALL: Final = 256
"""Bytes to begin with: the usual buffer takes longer to be got than what is said to be written."""
_NAME = re.compile(r"\??[A-Za-z_][A-Za-z0-9_.-]{0,63}")

_KINDS: Final[tuple[type[Any], ...]] = (
    Register, Made, Fault, Beat, Welcome, Refuse, Begin, Want, Inputs, Chain, End,
)  # fmt: skip
_NUMBERS: Final = {kind: number for number, kind in enumerate(_KINDS)}
_FROM_HOST: Final = {_NUMBERS[kind] for kind in (Register, Made, Fault, Beat)}


def encode(message: FromHost | FromPlatform) -> bytes:
    """A message as bytes.

    Raises:
        ContentError: it cannot be said, or is too long.
    """
    match message:
        case Made():
            return made_of(*message[:4], [pack_sample(each) for each in message.samples])
        case Inputs():
            return inputs_of(
                message.process, [pack_sample(each.sample, each.i) for each in message.inputs], message.past
            )
        case Fault(process, said):
            message = Fault(process, _shortened(said))
        case Refuse(reason):
            message = Refuse(_shortened(reason))
    packed: bytes = msgpack.packb((VERSION, _NUMBERS[type(message)], *message))
    if len(packed) > MAX_BYTES:
        raise ContentError(f"{type(message).__name__}: {len(packed)} bytes, at most {MAX_BYTES} can be said at once")
    return packed


def made_of(process: int, taken: int, serial: int, past: bool, packed: Iterable[bytes]) -> bytes:
    """`Made` of samples that are packed already, with as many as `Backlog.take` puts together."""
    return _with_samples((VERSION, _NUMBERS[Made], process, taken, serial, past), list(packed))


def inputs_of(process: int, packed: Iterable[bytes], past: bool) -> bytes:
    """`Inputs`, likewise."""
    return _with_samples((VERSION, _NUMBERS[Inputs], process, past), list(packed))


def _with_samples(fields: tuple[Any, ...], packed: list[bytes]) -> bytes:
    packer = msgpack.Packer(buf_size=_SMALL)
    head = [packer.pack_array_header(len(fields) + 1), *map(packer.pack, fields)]
    return b"".join([*head, packer.pack_array_header(len(packed)), *packed])


def _shortened(text: str) -> str:
    return text[:MAX_TEXT].encode(errors="replace").decode()


def decode_from_host(payload: bytes) -> FromHost:
    """What a host said; raises DecodeError."""
    number, fields = _opened(payload)
    found: FromHost = _READERS[number](*fields) if number in _FROM_HOST else fail("kind")
    return found


def decode_from_platform(payload: bytes) -> FromPlatform:
    """What the platform said; raises DecodeError."""
    number, fields = _opened(payload)
    found: FromPlatform = fail("kind") if number in _FROM_HOST else _READERS[number](*fields)
    return found


def _opened(payload: bytes) -> tuple[int, tuple[Any, ...]]:
    found = unpack(payload)
    if type(found) is not tuple or len(found) < 2:
        fail("shape")
    if type(found[0]) is not int or found[0] != VERSION:
        fail("version")
    number = found[1]
    if type(number) is not int or not 0 <= number < len(_KINDS):
        fail("kind")
    if len(found) != 2 + len(_KINDS[number]._fields):
        fail("shape")
    return number, found[2:]


def _register(pid: Any, module: Any, train: Any, units: Any, sources: Any) -> Register:
    offered: list[UnitOffer] = [UnitOffer(*_fields(each, 7)) for each in items(units)]
    own: list[SourceOffer] = [SourceOffer(*_fields(each, 3)) for each in items(sources)]
    for unit in offered:
        for name in (unit.name, unit.sort, *items(unit.inputs, MAX_INPUTS)):
            _name(name)
        if not unit.inputs or (_flag(unit.samplewise) and len(unit.inputs) != 1):
            fail("shape")
        count(unit.history_us)
        if _text(unit.cheaper):
            _name(unit.cheaper)
        instant(unit.priority)
    for source in own:
        _name(source.name)
        _name(source.sort)
        if _text(source.label):
            _checked(Label.parse, source.label)
    names = [*(each.name for each in offered), *(each.name for each in own)]
    if len(set(names)) < len(names):
        fail("duplicate name")
    return Register(count(pid), _text(module), _flag(train), tuple(offered), tuple(own))


def _made(process: Any, taken: Any, serial: Any, past: Any, samples: Any) -> Made:
    found = tuple([_sample(each).sample for each in items(samples)])
    return Made(count(process), count(taken), count(serial), _flag(past), found)


def _welcome(unit: Any, labels: Any, epoch_us: Any, speed: Any, offset_us: Any) -> Welcome:
    if type(speed) is not float or not 0 < speed < 1e9:
        fail("number")
    return Welcome(_text(unit), tuple(map(_text, items(labels))), instant(epoch_us), speed, instant(offset_us))


def _begin(process: Any, prototype: Any, label: Any, now_us: Any, output: Any, grid: Any) -> Begin:
    _checked(Label.parse, label)
    if _text(output):
        _checked(Policy.parse, output)
    return Begin(count(process), _name(prototype), label, instant(now_us), output, _grid(grid))


def _grid(found: Any) -> Grid | None:
    if found is None:
        return None
    period_us, anchor_us = _fields(found, 2)
    if not count(period_us):
        fail("number")
    return Grid(period_us, None if anchor_us is None else instant(anchor_us))


def _inputs(process: Any, past: Any, inputs: Any) -> Inputs:
    return Inputs(count(process), _flag(past), tuple([_sample(each) for each in items(inputs)]))


def _chain(process: Any, i: Any, maker: Any, serial: Any) -> Chain:
    return Chain(count(process), count(i), count(maker), count(serial))


_READERS: Final[tuple[Callable[..., Any], ...]] = (
    _register,
    _made,
    lambda process, said: Fault(count(process), _text(said)),
    lambda dropped: Beat(count(dropped)),
    _welcome,
    lambda reason: Refuse(_text(reason)),
    _begin,
    lambda process, grid: Want(count(process), _grid(grid)),
    _inputs,
    _chain,
    lambda process: End(count(process)),
)


def _fields(found: Any, number: int) -> tuple[Any, ...]:
    if type(found) is not tuple or len(found) != number:
        fail("shape")
    return found


def _flag(found: Any) -> bool:
    return found if type(found) is bool else fail("flag")


def _text(found: Any) -> str:
    return found if type(found) is str and len(found) <= MAX_TEXT else _not_text(found)


def _not_text(found: Any) -> NoReturn:
    fail("text", repr(found)[:80])


def _name(found: Any) -> str:
    return found if type(found) is str and _NAME.fullmatch(found) else _not_text(found)


def _checked(parse: Callable[[str], object], found: Any) -> None:
    try:
        parse(_text(found))
    except (DyknowError, ValueError) as wrong:
        raise DecodeError("text", str(wrong)[:80]) from None


def pack_sample(sample: Sample, i: int = 0) -> bytes:
    """A sample as part of a message; raises ContentError if it cannot be said."""
    available_us, valid_us, value, quality = sample
    try:
        plain = _plain(value)
        sampled(plain)
        times = instant(index(available_us)), instant(index(valid_us))
        said = () if quality is SURE or quality == SURE else (_plainly(quality),)
        fields = (i, *times, plain, *said)
        packed: bytes = msgpack.Packer(buf_size=_SMALL).pack(fields)
    except (DecodeError, ValueError, TypeError, OverflowError, RecursionError) as wrong:
        raise ContentError(f"{value!r:.80} cannot be handed to another process: {wrong}") from None
    if len(packed) > SAMPLES_BYTES // 2:
        raise ContentError(f"a sample has at most {SAMPLES_BYTES // 2} bytes, this one {len(packed)}")
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


def _plainly(quality: Quality) -> tuple[float, tuple[tuple[float, ...], ...]]:
    """A quality of plain floats, checked."""
    rows = tuple([tuple(map(float, row)) for row in quality.covariance])
    return qualified(float(quality.certainty), rows)


def _sample(found: Any) -> Input:
    if type(found) is not tuple or not 4 <= len(found) <= 5:
        fail("shape")
    i, available_us, valid_us, value = found[:4]
    if count(i) >= MAX_INPUTS:
        fail("number")
    quality = SURE if len(found) == 4 else _quality(found[4])
    return Input(i, Sample(instant(available_us), instant(valid_us), sampled(value), quality))


def _quality(found: Any) -> Quality:
    return Quality(*qualified(*_fields(found, 2)))
