"""The lists of a heartbeat, checked: the units that its sender hears, and the newest numbers of its streams.

Both change rarely: a list equal to the last one of the same unit is the same object.
"""

from typing import Any, Final, TypeAlias

from dyknow.federation import keys
from dyknow.federation.messages import unpacking
from dyknow.federation.messages.newest import Newest

MAX_TAILS: Final = 64
"""Streams whose newest numbers one heartbeat names; a platform that exports more names them in turn."""
MAX_BEAT: Final = 32_768
"""Bytes of a heartbeat: a thousand members that are heard, and the tails."""

_Tails: TypeAlias = tuple[tuple[str, str, int], ...]


def heard_of(unit: str, hears: Any) -> tuple[str, ...]:
    """The units that `unit` hears; raises DecodeError."""
    if not all(type(name) is str for name in unpacking.items(hears)):
        unpacking.fail("name")
    return _heard(unit, hears)


def tails_of(unit: str, boot: int, tails: Any) -> _Tails:
    """Label, policy hash and newest number of streams; those of another life are another object. Raises DecodeError."""
    for tail in unpacking.items(tails, MAX_TAILS):
        unpacking.fields(tail, 3)
        if type(tail[0]) is not str or type(tail[1]) is not str:
            unpacking.fail("name")
        unpacking.count(tail[2])
    return _tails(unit, (boot, tails))[1]


def _checked_units(units: tuple[str, ...]) -> tuple[str, ...]:
    for name in units:
        unpacking.named(keys.unit, name)
    return units


def _checked_tails(tails: tuple[int, _Tails]) -> tuple[int, _Tails]:
    for label, policy_hash, _ in tails[1]:
        unpacking.named(keys.label, label)
        unpacking.digest(policy_hash)
    return tails


_heard = Newest(_checked_units, lambda units: 64 + sum(map(len, units)))
_tails = Newest(_checked_tails, lambda tails: 64 * (1 + len(tails[1])))
