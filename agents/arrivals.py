"""Heartbeats and samples: nearly all of what arrives, and nearly always nothing follows from it but a note."""

from functools import lru_cache
from typing import TYPE_CHECKING

from dyknow.errors import DecodeError
from federation import keys
from federation.codec import Heartbeat, decode_heartbeat
from federation.transport import Arrived

if TYPE_CHECKING:
    from agents.platform import Platform

_HEARTBEATS = keys.HEARTBEATS.removesuffix("**")


@lru_cache(maxsize=256)
def _beat(key: str, payload: bytes) -> Heartbeat | None:
    """The heartbeat that was put on `key`, of the unit that the key names; None if it is no heartbeat's key.

    Many platforms in one process hear the same: it is read once.
    """
    name = keys.parse_key(key)
    if type(name) is not keys.HeartbeatKey:
        return None
    beat = decode_heartbeat(payload)
    if beat.unit != name.unit:
        raise DecodeError("key")
    return beat


class Arrivals:
    """Takes them; what else arrives is the platform's."""

    def __init__(self, platform: "Platform") -> None:
        self._p = platform
        self._unit = platform.unit

    def take(self, event: Arrived) -> bool:
        """Whether it was a heartbeat or samples, and nothing follows from it for now.

        Raises:
            DecodeError: it is malformed.
        """
        if event.key.startswith(_HEARTBEATS):
            beat = _beat(event.key, event.payload)
            return beat is not None and self._is_quiet(beat, event.at_us)
        key = keys.parse_key(event.key)
        if type(key) is not keys.StreamKey:
            return False
        platform = self._p
        platform.importer.on_arrived(event, key)
        if platform.is_owing:
            return False
        timetable = platform.timetable
        timetable.hasten(platform.importer)
        timetable.hasten_federation(platform.monitors)
        timetable.hasten_federation(platform.network)
        return True

    def _is_quiet(self, beat: Heartbeat, at_us: int) -> bool:
        platform, unit = self._p, beat.unit
        if unit == self._unit and not platform.membership.is_twin(beat.boot, at_us):
            return True
        outcome = platform.directory.on_heartbeat(beat, at_us)
        if beat.tails and platform.importer.on_tails(unit, beat.boot, beat.tails, at_us):
            platform.timetable.hasten(platform.importer)
        if not outcome:
            return True
        platform.take(outcome)
        return False
