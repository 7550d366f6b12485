"""Monitors over the own vehicle and each aircraft that is no member: the profile `traffic-well-clear`, one state for both at a time.

An altitude that is known within some metres only is taken as near our own as that allows, and an unknown one as our own.
An aircraft of unknown velocity is taken to stay where it is.
"""

from collections.abc import Callable, Iterable
from typing import Final

from dyknow import NO_VALUE, Value
from dyknow.agents.capabilities.traffic.echoes import MemberState
from dyknow.kpl import profile_formula
from dyknow.model.errors import UnitError
from dyknow.navigation.traffic import TrafficState
from dyknow.reasoning import AlarmEvent, Derivation, Monitor, instantiate, required_labels, split_growing
from dyknow.reasoning.monitoring.profiles import AIRCRAFT, Profile

PROFILE: Final = "traffic-well-clear"


class AircraftWatch:
    """One monitor for each aircraft, while it is there. Federation time.

    Args:
        unit: this platform.
        profile: its formula is `always forall other in traffic growing: ...`.
        on_alarm: called with each opening, closing and end.
    """

    def __init__(self, unit: str, profile: Profile, on_alarm: Callable[[AlarmEvent], None]) -> None:
        self._unit, self._profile, self._on_alarm = unit, profile, on_alarm
        split = split_growing(profile_formula(profile, unit))
        if split is None or split[1].base != AIRCRAFT:
            raise UnitError(f"{profile.name}: expected a formula always forall other in {AIRCRAFT} growing: ...")
        self._variable, _, self._body = split
        self._watched: dict[str, tuple[Monitor, Derivation]] = {}

    @property
    def open(self) -> list[str]:
        """The aircraft with an open alarm."""
        return [name for name, (monitor, _) in self._watched.items() if monitor.alarm_id is not None]

    def step(self, own: MemberState, aircraft: Iterable[TrafficState], valid_us: int, now_us: int) -> None:
        """The states of one instant: that of the own vehicle, and of each aircraft; the others' monitors end."""
        there = {one.identity: one for one in aircraft}
        for name in [name for name in self._watched if name not in there]:
            self.end(name, now_us)
        mine = _quantities(own.latitude_deg, own.longitude_deg, own.altitude_m, _velocity(own))
        for name, one in there.items():
            monitor, derivation = self._watched.get(name) or self._begin(name, now_us)
            altitude_m = _nearest_m(one, own.altitude_m)
            theirs = _quantities(one.latitude_deg, one.longitude_deg, altitude_m, _velocity(one))
            state = [(mine if unit == self._unit else theirs).get(label, NO_VALUE) for label, unit in derivation.inputs]
            values, lacks = derivation.values(state), derivation.lacks(state)
            for event in monitor.on_state(valid_us, now_us, values, lacks=lacks):
                self._on_alarm(event)

    def end(self, name: str, now_us: int) -> None:
        """End the watch of an aircraft that is no longer heard, or is none: its alarm ends."""
        found = self._watched.pop(name, None)
        for event in found[0].end(now_us) if found else ():
            self._on_alarm(event)

    def end_all(self, now_us: int) -> None:
        """End the watches of all aircraft."""
        for name in list(self._watched):
            self.end(name, now_us)

    def _begin(self, name: str, now_us: int) -> tuple[Monitor, Derivation]:
        profile = self._profile
        formula = instantiate(self._body, self._variable, name)
        derivation = Derivation(
            required_labels(formula), profile.vertical, profile.fence, first=self._unit, volume=profile.volume
        )
        monitor = Monitor(
            profile.name, formula, (self._unit, name), profile.sample_us, profile.max_delay_us, profile.no_value,
            profile.close_after, inputs=derivation.input_names, since_us=now_us,
        )  # fmt: skip
        self._watched[name] = monitor, derivation
        return monitor, derivation


def _nearest_m(one: TrafficState, own_m: float | None) -> float | None:
    """The altitude nearest to our own that the aircraft may have."""
    if one.altitude_m is None or own_m is None:
        return own_m
    apart_m = one.altitude_m - own_m
    return own_m + (0.0 if abs(apart_m) <= one.altitude_error_m else apart_m - _signed(one.altitude_error_m, apart_m))


def _signed(value: float, like: float) -> float:
    return value if like >= 0.0 else -value


def _velocity(one: MemberState | TrafficState) -> tuple[float, float, float]:
    return one.north_m_s or 0.0, one.east_m_s or 0.0, one.down_m_s or 0.0


def _quantities(
    latitude_deg: float, longitude_deg: float, altitude_m: float | None, velocity: tuple[float, float, float]
) -> dict[str, Value]:
    found: dict[str, Value] = {"heli-position": (latitude_deg, longitude_deg), "heli-velocity": velocity}
    if altitude_m is not None:
        found["heli-altitude"] = found["heli-height"] = (altitude_m,)
    return found
