"""States of a mission from streams: the domains' `east`, `north`, `height`, `airborne`, `load` and `attached`, of each
vehicle that takes part. The load on a line is the object that the vehicle took hold of last.

The streams of other platforms are imported while the mission lasts. Heights are above each vehicle's home; places are
metres east and north of the mission's origin.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Final

from dyknow import NO_VALUE, Value
from dyknow.agents.capabilities.flight.vehicle_streams import LOAD
from dyknow.agents.exchange.gateway import Gateway
from dyknow.agents.exchange.local_instance import LocalInstance
from dyknow.agents.exchange.subscription_keeper import SubscriptionKeeper
from dyknow.model.errors import DyknowError
from dyknow.navigation.geodesy import LocalFrame

POSITION: Final = "heli-position"
HEIGHT: Final = "heli-height"
PERIOD_US: Final = 200_000
MAX_DELAY_US: Final = 1_000_000
STALE_US: Final = 1_500_000
"""An older sample is no part of the present state."""
FLYING_M: Final = 1.0
"""Above its home a vehicle that does not say whether it flies does."""
HELD_KG: Final = 0.3
"""A load on a line weighs so much at least."""
_LABEL_OF: Final = {
    "east": POSITION,
    "north": POSITION,
    "height": HEIGHT,
    "airborne": HEIGHT,
    "attached": LOAD,
    "load": LOAD,
}


class UnitSensors:
    """The sensed values of vehicles now.

    Args:
        frame: of the mission's origin.
        platforms: by unit of the problem, the platform that has the vehicle.
        sensors: by feature, its sensor.
        airborne: whether the platform's own vehicle says that it flies.
    """

    def __init__(
        self,
        own: str,
        frame: LocalFrame,
        platforms: Mapping[str, str],
        sensors: Mapping[str, str],
        gateway: Gateway,
        local: LocalInstance,
        keeper: SubscriptionKeeper,
        airborne: Callable[[], bool | None],
    ) -> None:
        self._own, self.frame, self._platforms, self._sensors = own, frame, dict(platforms), dict(sensors)
        self._gateway, self._local, self._keeper, self._airborne = gateway, local, keeper, airborne
        labels = {_LABEL_OF[sensor] for sensor in self._sensors.values() if sensor in _LABEL_OF}
        self._taken: dict[str, dict[str, None]] = {}
        self._needs = tuple(
            (platform, (label, PERIOD_US, MAX_DELAY_US))
            for platform in sorted(set(self._platforms.values()) - {own})
            for label in sorted(labels)
        )

    def begin(self, now_us: int) -> None:
        """Have the streams of other platforms come (node clock)."""
        for platform, need in self._needs:
            self._local.source(need[0], platform)
            self._keeper.need(platform, need, now_us, wanted=True)

    def end(self, now_us: int) -> None:
        """Release the streams: they are no longer needed."""
        for platform, need in self._needs:
            self._keeper.need(platform, need, now_us, wanted=False)

    def sample(self, federation_us: int) -> dict[str, Value]:
        """The value of each sensed feature of each unit, `NO_VALUE` where there is none that is new enough."""
        found: dict[str, Value] = {}
        for feature, sensor in self._sensors.items():
            for unit, platform in self._platforms.items() if sensor in _LABEL_OF else ():
                value = self._value(sensor, platform, federation_us)
                if sensor == "attached":
                    found |= {f"{feature}[{unit}, {thing}]": each for thing, each in self._held(unit, value)}
                else:
                    found[f"{feature}[{unit}]"] = value
        return found

    def take(self, unit: str, thing: str) -> None:
        """An action of the unit takes hold of an object."""
        taken = self._taken.setdefault(unit, {})
        taken.pop(thing, None)
        taken[thing] = None

    def _held(self, unit: str, value: Value) -> Iterable[tuple[str, Value]]:
        """The load on the line is the object taken last; earlier ones do not hang on it."""
        *before, last = self._taken.get(unit) or (None,)
        if last is not None:
            yield last, value
        for thing in before:
            yield str(thing), value if value is NO_VALUE else False

    def _value(self, sensor: str, platform: str, federation_us: int) -> Value:
        if sensor == "airborne" and platform == self._own and (airborne := self._airborne()) is not None:
            return airborne
        try:
            sample = self._gateway.latest(_LABEL_OF[sensor], platform)
        except DyknowError:
            return NO_VALUE
        if sample.value is NO_VALUE or federation_us - sample.valid_us > STALE_US:
            return NO_VALUE
        if sensor == "attached":
            return bool(sample.value[0] >= HELD_KG)
        if sensor in {"height", "load"}:
            return float(sample.value[0])
        if sensor == "airborne":
            return bool(sample.value[0] > FLYING_M)
        north_m, east_m, _ = self.frame.to_ned(sample.value[0], sample.value[1], 0.0)
        return float(east_m if sensor == "east" else north_m)
