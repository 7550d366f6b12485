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
        self._importer, self._timetable = platform.importer, platform.timetable
        self._told = platform.importer.told
        self._goes_on = platform.directory.goes_on

    def take(self, event: Arrived) -> bool:
        """Whether it was a heartbeat or samples, and nothing follows from it for now.

        Raises:
            DecodeError: it is malformed.
        """
        key, at_us, payload = event
        if not key.startswith(_HEARTBEATS):
            return self._importer.on_arrived(event) and self._is_settled()
        beat = _beat(key, payload)
        if beat is None:
            return False
        if not self._goes_on(beat, at_us):
            return self._is_quiet(beat, at_us)
        if self._told.get(beat.unit) is not beat.tails:
            self._follow(beat, at_us)
        return True

    def _is_settled(self) -> bool:
        """Whether samples that came are all dealt with; what they made due earlier is seen to."""
        platform, timetable = self._p, self._timetable
        if platform.is_owing:
            return False
        timetable.hasten(self._importer)
        timetable.hasten_federation(platform.monitors)
        timetable.hasten_federation(platform.network)
        return True

    def _is_quiet(self, beat: Heartbeat, at_us: int) -> bool:
        """The same of a heartbeat that may tell of a change."""
        platform = self._p
        if beat.unit == self._unit and not platform.membership.is_twin(beat.boot, at_us):
            return True
        outcome = platform.directory.on_heartbeat(beat, at_us)
        self._follow(beat, at_us)
        if not outcome:
            return True
        platform.take(outcome)
        return False

    def _follow(self, beat: Heartbeat, at_us: int) -> None:
        if self._importer.on_tails(beat.unit, beat.boot, beat.tails, at_us):
            self._timetable.hasten(self._importer)
