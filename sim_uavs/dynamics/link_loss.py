"""An autopilot's reaction, by its parameters, when its ground station is no longer heard. Pure.

ArduCopter waits for the heartbeats of one system (`station_id`) and acts after `link_loss_s`, in every mode unless its
options say otherwise; it continues its reaction when the station is heard again. PX4 waits for those of any ground
station, holds for `link_loss_wait_s` and acts then; a mission that it only held continues when a station is heard
again. Its Hold is the mode in which it flies to places: to hold there stops nothing. A link that was never there is not
lost.

PX4's Offboard has a stream of targets to lose as well: two targets within `offboard_loss_s` are one.
"""

from enum import Enum, auto
from typing import Final

from dyknow.navigation.vehicle import FailsafeReport, LinkLossAction
from dyknow.sim_uavs.dynamics.flight import Flight, GoingTo, Mode, StatusText
from dyknow.sim_uavs.dynamics.settings import PersonaName

_A = LinkLossAction
_ARDUCOPTER: Final = {1: _A.RETURN, 2: _A.RETURN, 3: _A.RETURN, 4: _A.LAND, 5: _A.LAND, 6: _A.RETURN, 7: _A.LAND}
"""FS_GCS_ENABLE; 3 and 4 without a way back that it has kept, 6 without a landing sequence."""
_UNLESS_IN_MISSION: Final = 2
"""FS_GCS_ENABLE: a mission continues."""
_PX4: Final = {1: _A.HOLD, 2: _A.RETURN, 3: _A.LAND, 5: _A.TERMINATE, 6: _A.TERMINATE}
"""NAV_DLL_ACT."""
_PX4_OFFBOARD: Final = {3: _A.RETURN, 4: _A.LAND, 5: _A.HOLD, 6: _A.TERMINATE, 7: _A.TERMINATE}
"""COM_OBL_RC_ACT; the others need a remote control, and it lands without one."""
_MISSION_CONTINUES, _LANDING_CONTINUES, _PILOT_CONTINUES = 1 << 1, 1 << 3, 1 << 4
"""FS_OPTIONS."""
_PILOTED: Final = frozenset({Mode.STABILIZE, Mode.LOITER})
_CRITICAL, _WARNING = 2, 4
OWN_STATION: Final = 254
"""The system id of a platform that is joined to a vehicle."""


class _Stage(Enum):
    HEARD = auto()
    WAITS = auto()
    ACTED = auto()


class LinkFailsafe:
    """Watches the link of one flight. Times are those of the flight, microseconds."""

    def __init__(self, flight: Flight, persona: PersonaName) -> None:
        self._flight, self._is_px4 = flight, persona == "px4"
        self._heard_us: int | None = None
        self._stage = _Stage.HEARD
        self._held: GoingTo | None = None
        self._streams_us: int | None = None
        self._setpoint_us: int | None = None

    @property
    def has_acted(self) -> bool:
        """Whether it has done what it does without its ground station, and has not heard it since."""
        return self._stage is _Stage.ACTED

    def on_heartbeat(self, system: int, now_us: int, *, is_station: bool = True) -> None:
        """A heartbeat of this system id was heard; `is_station`: its type is that of a ground station."""
        if is_station if self._is_px4 else system == int(self._flight.settings.station_id):
            self._heard_us = now_us

    def on_setpoint(self, now_us: int) -> None:
        """A target was streamed (SET_POSITION_TARGET)."""
        before_us, self._setpoint_us = self._setpoint_us, now_us
        if before_us is not None and now_us - before_us <= self._flight.settings.offboard_loss_s * 1e6:
            self._streams_us = now_us

    def report(self, valid_us: int) -> FailsafeReport:
        """Its reaction, by the settings as they are now."""
        s = self._flight.settings
        actions, value = _PX4 if self._is_px4 else _ARDUCOPTER, int(s.link_loss_action)
        action = actions.get(value, _A.CARRY_ON)
        if self._is_px4:
            guided = _A.CARRY_ON if action is _A.HOLD else action
            offboard = _PX4_OFFBOARD.get(int(s.offboard_loss_action), _A.LAND)
            delay_s = s.link_loss_s + s.link_loss_wait_s
            return FailsafeReport(valid_us, guided, delay_s, action, offboard, s.return_m, None, None)
        continues = int(s.link_loss_options) & _MISSION_CONTINUES or value == _UNLESS_IN_MISSION
        mission, station = _A.CARRY_ON if continues else action, int(s.station_id)
        return FailsafeReport(valid_us, action, s.link_loss_s, mission, action, s.return_m, s.final_m, station)

    def on_time(self, now_us: int) -> None:
        """Act when what is waited for has not come."""
        if self._is_px4:
            self._watch_stream(now_us)
        settings = self._flight.settings
        if self._heard_us is None or not settings.link_loss_action:
            return
        silent_s = (now_us - self._heard_us) / 1e6
        if silent_s < settings.link_loss_s:
            if self._stage is not _Stage.HEARD:
                self._on_heard_again()
            return
        if self._stage is _Stage.HEARD:
            self._stage = _Stage.WAITS
            if self._is_px4 and self._flight.armed:
                self._say("Connection to ground station lost", _CRITICAL)
                self._hold_mission()
        waits_s = settings.link_loss_wait_s if self._is_px4 else 0.0
        if self._stage is _Stage.WAITS and silent_s >= settings.link_loss_s + waits_s:
            self._stage = _Stage.ACTED
            self._act()

    def _on_heard_again(self) -> None:
        flight, held = self._flight, self._held
        self._stage, self._held = _Stage.HEARD, None
        if not self._is_px4:
            self._say("GCS Failsafe Cleared", _WARNING)
        elif held is not None and flight.mode is Mode.GUIDED and flight.target is held:
            flight.set_mode(Mode.AUTO)

    def _hold_mission(self) -> None:
        """A place in Hold is flown to as before; a mission, or a stream, is held."""
        flight = self._flight
        if flight.mode in {Mode.AUTO, Mode.OFFBOARD} and flight.airborne:
            is_mission = flight.mode is Mode.AUTO
            flight.set_mode(Mode.GUIDED)
            self._held = flight.target if is_mission and isinstance(flight.target, GoingTo) else None

    def _act(self) -> None:
        flight, settings = self._flight, self._flight.settings
        if not flight.armed:
            return
        if self._is_px4:
            if flight.mode is not Mode.LAND:
                self._perform(_PX4.get(int(settings.link_loss_action)))
            return
        self._say("GCS Failsafe", _CRITICAL)
        options, is_excepted = int(settings.link_loss_options), settings.link_loss_action == _UNLESS_IN_MISSION
        if not flight.airborne:
            flight.disarm()
        elif not (
            (flight.landing and options & _LANDING_CONTINUES)
            or (flight.mode is Mode.AUTO and (options & _MISSION_CONTINUES or is_excepted))
            or (flight.mode in _PILOTED and options & _PILOT_CONTINUES)
        ):
            self._perform(_ARDUCOPTER.get(int(settings.link_loss_action)))

    def _perform(self, action: LinkLossAction | None) -> None:
        flight = self._flight
        if action is not _A.HOLD:
            self._held = None
        match action:
            case _A.RETURN if flight.airborne:
                flight.set_mode(Mode.RTL)
            case _A.LAND if flight.airborne:
                flight.set_mode(Mode.LAND)
            case _A.HOLD if flight.airborne:
                self._hold_mission()
            case _A.TERMINATE:
                self._say("Flight terminated", _CRITICAL)
                flight.disarm(force=True)

    def _watch_stream(self, now_us: int) -> None:
        settings, since_us = self._flight.settings, self._streams_us
        if since_us is None or now_us - since_us < settings.offboard_loss_s * 1e6:
            return
        self._streams_us = None
        if self._flight.mode is Mode.OFFBOARD and self._flight.armed:
            self._say("Offboard control lost", _CRITICAL)
            self._perform(_PX4_OFFBOARD.get(int(settings.offboard_loss_action), _A.LAND))

    def _say(self, text: str, severity: int) -> None:
        self._flight.events.append(StatusText(severity, text))
