"""The traffic heard at an endpoint, and in words why it is not the expected vehicle.

No socket and no clock: times are arguments, in seconds.
"""

from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.proxies.mavlink.endpoints import Endpoint
from dyknow.proxies.mavlink.frames import Frame
from dyknow.proxies.mavlink.reports import is_autopilot

LATELY_S = 5.0
_SETTLES_S = 1.2
"""An autopilot is component 1; another component that alone says it is one is taken after more than one heartbeat."""
_MOST_VOICES = 256
_AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1


@dataclass(slots=True)
class _Voice:
    """One component of one system; `beats_s` is when its first and its last HEARTBEAT of an autopilot came."""

    heard_s: float
    version: int
    is_signed: bool
    beats_s: tuple[float, float] | None = None
    station_s: float | None = None


def _listed(what: str, names: list[str]) -> str:
    return f"{what}{'s' if len(names) > 1 else ''} {', '.join(names)}"


class Hearing:
    """The systems and components that speak at one endpoint.

    Args:
        endpoint: as users write it.
        has_key: only signed frames count.
    """

    def __init__(self, endpoint: Endpoint, *, has_key: bool = False) -> None:
        self.endpoint = endpoint
        self._has_key = has_key
        self._voices: dict[tuple[int, int], _Voice] = {}
        self._bytes_s: float | None = None

    def on_bytes(self, now_s: float) -> None:
        """Bytes have come, whatever they are."""
        self._bytes_s = now_s

    def on_frame(self, frame: Frame, now_s: float) -> None:
        """An intact frame has come; whether it is signed with our key is not known yet."""
        who = frame.system, frame.component
        voice = self._voices.get(who)
        if voice is None:
            if len(self._voices) >= _MOST_VOICES:
                self._voices = {each: v for each, v in self._voices.items() if now_s - v.heard_s <= LATELY_S}
            if len(self._voices) < _MOST_VOICES:
                self._voices[who] = _Voice(now_s, frame.version, frame.is_signed)
        else:
            voice.heard_s, voice.version, voice.is_signed = now_s, frame.version, frame.is_signed

    def on_heartbeat(self, frame: Frame, message: Any, now_s: float) -> None:
        """That frame was a HEARTBEAT which may be believed."""
        voice = self._voices.get((frame.system, frame.component))
        if voice is None:
            return
        if is_autopilot(message):
            first_s, last_s = voice.beats_s or (now_s, now_s)
            voice.beats_s = (first_s if now_s - last_s <= LATELY_S else now_s), now_s
        elif message.type == mavlink.MAV_TYPE_GCS:
            voice.station_s = now_s

    def autopilots(self, now_s: float, system: int | None = None) -> dict[tuple[int, int], float]:
        """The components that say they are autopilots, and since when."""
        return {
            who: voice.beats_s[0]
            for who, voice in self._voices.items()
            if voice.beats_s is not None and now_s - voice.beats_s[1] <= LATELY_S and system in (None, who[0])
        }

    def autopilot(self, system: int, wanted: int | None, now_s: float) -> int | None:
        """The component of `system` that is its autopilot; None while that is open.

        Args:
            system: MAVLink system id.
            wanted: take this component only; None: component 1, or the only one that says it is an autopilot.
            now_s: the time.
        """
        since_s = {component: at_s for (_, component), at_s in self.autopilots(now_s, system).items()}
        if wanted is not None or _AUTOPILOT in since_s:
            component = _AUTOPILOT if wanted is None else wanted
            return component if component in since_s else None
        if len(since_s) != 1:
            return None
        ((component, at_s),) = since_s.items()
        return component if now_s - at_s >= _SETTLES_S else None

    def is_signed(self, system: int) -> bool:
        """Whether the system's frames carry signatures."""
        return any(voice.is_signed for (each, _), voice in self._voices.items() if each == system)

    def systems(self, now_s: float) -> list[int]:
        """The systems in which an autopilot speaks."""
        return sorted({system for system, _ in self.autopilots(now_s)})

    def absence(self, system: int | None, component: int | None, now_s: float) -> str:
        """Why no vehicle of this system and component (None: any) is heard."""
        voices = {who: voice for who, voice in self._voices.items() if now_s - voice.heard_s <= LATELY_S}
        if not voices:
            return self._silence(now_s)
        if system is not None and not any(who[0] == system for who in voices):
            there = sorted({who[0] for who in voices})
            return f"heard {_listed('system', [str(each) for each in there])}; not {system} (--sysid)"
        voices = {who: voice for who, voice in voices.items() if system in (None, who[0])}
        autopilots = sorted(who for who in self.autopilots(now_s, system))
        if autopilots:
            named = ", ".join(f"{each}/{part}" for each, part in autopilots)
            taken = 1 if component is None else component
            return f"heard HEARTBEAT from {named}; only component {taken} is taken (--compid)"
        if self._has_key and not all(voice.is_signed for voice in voices.values()):
            if all(voice.version == 1 for voice in voices.values()):
                return (
                    "heard MAVLink 1, which cannot be signed: set the vehicle to MAVLink 2, or leave out --signing-key"
                )
            return "heard frames without a signature: set up the same key in the vehicle (--signing-key)"
        if self._has_key:
            return "heard frames that are signed with another key (--signing-key)"
        stations = sorted(who for who, voice in voices.items() if voice.station_s is not None)
        if stations:
            return f"heard a ground station, {stations[0][0]}/{stations[0][1]}, and no vehicle"
        named = ", ".join(f"{each}/{part}" for each, part in sorted(voices)[:4])
        return f"heard {named}, but no HEARTBEAT of an autopilot"

    def _silence(self, now_s: float) -> str:
        if self._bytes_s is not None and now_s - self._bytes_s <= LATELY_S:
            hint = f"; is {self.endpoint.number} its baud rate?" if self.endpoint.kind == "serial" else ""
            return f"hears bytes at {self.endpoint}, but no MAVLink{hint}"
        return f"waiting for a HEARTBEAT at {self.endpoint}"
