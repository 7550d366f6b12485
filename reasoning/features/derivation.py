"""Features the engine derives from federated streams: which semantic labels each needs, and its value.

A `Derivation` is made for the features of one formula; it names the inputs a state must bring, in order, and turns the
values of such a state into values by label. A feature that lacks an input is `NO_VALUE`. Times are microseconds, as
durations are in formulas.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import hypot, isfinite, sqrt
from typing import Final, Literal, NamedTuple, TypeAlias

from dyknow.model.errors import UnknownLabel
from dyknow.model.instants import US_PER_S
from dyknow.model.labels import Label
from dyknow.model.sample import Value
from dyknow.model.values import NO_VALUE
from dyknow.reasoning.features.clearance import FAR_M, Clearance
from dyknow.reasoning.features.proximity import (
    are_beyond,
    closest_approach,
    fence_margin_m,
    horizontal_miss_m,
    offset_m,
)
from dyknow.reasoning.features.well_clear import AMONG_SMALL, Thresholds, is_well_clear, time_to_violation_s

POSITION: Final = "heli-position"
ALTITUDE: Final = "heli-altitude"
HEIGHT: Final = "heli-height"
VELOCITY: Final = "heli-velocity"
BATTERY: Final = "battery"
HOME: Final = "heli-home"

Sort: TypeAlias = Literal["number", "duration"]


@dataclass(frozen=True, slots=True)
class DerivedFeature:
    """A feature of `arity` units; it needs each of the semantic labels `needs` from each of them."""

    name: str
    arity: int
    sort: Sort
    unit: str
    needs: tuple[str, ...]
    meaning: str


_MOVING: Final = (POSITION, ALTITUDE, VELOCITY)
FEATURES: Final[Mapping[str, DerivedFeature]] = {
    feature.name: feature
    for feature in (
        DerivedFeature("xy_dist", 2, "number", "m", (POSITION,), "horizontal distance"),
        DerivedFeature("z_dist", 2, "number", "m", (ALTITUDE,), "vertical distance"),
        DerivedFeature("dist_3d", 2, "number", "m", (POSITION, ALTITUDE), "distance in space"),
        DerivedFeature("cpa_time", 2, "duration", "us", _MOVING, "time to the closest approach on straight courses"),
        DerivedFeature("cpa_xy", 2, "number", "m", _MOVING, "horizontal distance at the closest approach"),
        DerivedFeature("cpa_z", 2, "number", "m", _MOVING, "vertical distance at the closest approach"),
        DerivedFeature("hmd", 2, "number", "m", (POSITION, VELOCITY), "horizontal miss distance on straight courses"),
        DerivedFeature(
            "closing_xy",
            2,
            "number",
            "m^2/s",
            (POSITION, VELOCITY),
            "horizontal distance times closing speed; > 0 closing",
        ),
        DerivedFeature("well_clear", 2, "number", "1", _MOVING, "1 while the two keep well clear, 0 while they do not"),
        DerivedFeature(
            "time_to_violation",
            2,
            "duration",
            "us",
            _MOVING,
            "time until the two violate well clear on straight courses; 180 s: not until then",
        ),
        DerivedFeature("speed", 1, "number", "m/s", (VELOCITY,), "speed over ground"),
        DerivedFeature("altitude", 1, "number", "m", (ALTITUDE,), "altitude above mean sea level"),
        DerivedFeature("height", 1, "number", "m", (HEIGHT,), "height above home"),
        DerivedFeature("battery", 1, "number", "1", (BATTERY,), "charge as a fraction of full"),
        DerivedFeature("home_dist", 1, "number", "m", (POSITION, HOME), "horizontal distance to home"),
        DerivedFeature("fence_margin", 1, "number", "m", (POSITION,), "distance to the edge of the fence, > 0 inside"),
    )
}


class FeatureInput(NamedTuple):
    """One input of a state: a semantic label of a unit."""

    label: str
    unit: str

    def __str__(self) -> str:
        return f"{self.label}[{self.unit}]"


def needed_labels(features: Iterable[str], vertical: str = ALTITUDE) -> tuple[str, ...]:
    """Semantic labels that these features need; `vertical` is what stands for the altitude."""
    needs = (one for name in features for one in FEATURES[name].needs)
    return tuple(dict.fromkeys(vertical if one == ALTITUDE else one for one in needs))


class Derivation:
    """Values of the derived features of one formula.

    Args:
        labels: the features, e.g. `dyknow.reasoning.required_labels(formula)`; labels that are not derived are left
            alone.
        vertical: `heli-altitude`, or `heli-height` to compare heights above different homes.
        fence: corners (latitude, longitude) in degrees, for `fence_margin`.
        first: the inputs of this unit stand before the others.
        volume: the thresholds of `well_clear` and `time_to_violation`.

    Raises:
        UnknownLabel: if a label is not derivable.
    """

    def __init__(
        self,
        labels: Iterable[str],
        vertical: str = ALTITUDE,
        fence: Sequence[Sequence[float]] = (),
        first: str = "",
        volume: Thresholds = AMONG_SMALL,
    ) -> None:
        wanted: dict[tuple[str, ...], dict[str, str]] = {}
        for text in labels:
            label = Label.parse(text)
            feature = FEATURES.get(label.feature)
            if feature is None or feature.arity != len(label.objects):
                raise UnknownLabel(text, tuple(FEATURES))
            wanted.setdefault(label.objects, {})[label.feature] = text
        found: dict[FeatureInput, None] = {}
        for units, names in wanted.items():
            found.update({FeatureInput(each, unit): None for each in needed_labels(names, vertical) for unit in units})
        self.inputs: tuple[FeatureInput, ...] = tuple(sorted(found, key=lambda each: (each.unit != first, each)))
        index = {each: at for at, each in enumerate(self.inputs)}
        self._groups: list[_Pair | _Single] = [
            (
                _Pair(units, names, index, vertical, volume)
                if len(units) == 2
                else _Single(units[0], names, index, vertical, fence)
            )
            for units, names in wanted.items()
        ]

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs, for `Monitor(inputs=...)`."""
        return tuple(str(one) for one in self.inputs)

    def values(self, inputs: Sequence[Value]) -> dict[str, Value]:
        """Values by label, of a state whose values stand in the order of `inputs`."""
        found: dict[str, Value] = {}
        for group in self._groups:
            group.put(inputs, found)
        return found

    def beyond(self, clear: Clearance) -> Callable[[Sequence[Value]], bool]:
        """A predicate over a state's inputs, faster than the values: no input is missing and the pair is so far apart.

        Raises:
            UnknownLabel: these are not features of one pair.
        """
        (group,) = self._groups
        if not isinstance(group, _Pair):
            raise UnknownLabel(str(self.inputs[0]), tuple(name for name, one in FEATURES.items() if one.arity == 2))
        return partial(group.is_beyond, *clear)

    def lacks(self, inputs: Sequence[Value]) -> tuple[str, ...]:
        """Names of the inputs without a value, for `Monitor.on_state(lacks=...)`."""
        if NO_VALUE not in inputs:
            return ()
        return tuple(str(one) for one, value in zip(self.inputs, inputs, strict=True) if value is NO_VALUE)


def _number(value: Value) -> float:
    """A simple value, or a record of one field."""
    return float(value[0] if isinstance(value, tuple) else value)


def _at(at: int | None, inputs: Sequence[Value]) -> Value:
    return NO_VALUE if at is None else inputs[at]


class _Pair:
    """Features of two units. All it needs is looked up here: there are states by the thousand each second."""

    def __init__(
        self,
        units: tuple[str, ...],
        names: dict[str, str],
        index: dict[FeatureInput, int],
        vertical: str,
        volume: Thresholds,
    ) -> None:
        self._names = tuple(names.items())
        self._volume, self._keeping_clear = volume, bool({"well_clear", "time_to_violation"} & set(names))
        self._in_space = "dist_3d" in names
        self._moving = bool({"cpa_time", "cpa_xy", "cpa_z"} & set(names))
        self._closing = bool({"hmd", "closing_xy"} & set(names))
        self._positions, self._verticals, self._velocities = (
            (index[FeatureInput(label, units[0])], index[FeatureInput(label, units[1])])
            if FeatureInput(label, units[0]) in index
            else None
            for label in (POSITION, vertical, VELOCITY)
        )

    def is_beyond(self, radius_m: float, horizon_s: float, inputs: Sequence[Value]) -> bool:
        """Whether no input lacks, every feature is a number, and the pair is farther apart; false if unknown."""
        if NO_VALUE in inputs or self._positions is None:
            return False
        here, there = inputs[self._positions[0]], inputs[self._positions[1]]
        if self._verticals is not None:
            down_m = _number(inputs[self._verticals[0]]) - _number(inputs[self._verticals[1]])
            if not -FAR_M < down_m < FAR_M:
                return False
        if self._velocities is not None:
            u, v = inputs[self._velocities[0]], inputs[self._velocities[1]]
            north_m_s, east_m_s, down_m_s = v[0] - u[0], v[1] - u[1], v[2] - u[2]
            radius_m += horizon_s * sqrt(north_m_s * north_m_s + east_m_s * east_m_s + down_m_s * down_m_s)
        return are_beyond(here, there, radius_m)

    def put(self, inputs: Sequence[Value], found: dict[str, Value]) -> None:
        values = self._values(inputs)
        for name, label in self._names:
            value = values.get(name)
            found[label] = value if value is not None and isfinite(value) else NO_VALUE

    def _values(self, inputs: Sequence[Value]) -> dict[str, float]:
        """The wanted features with known inputs, and their parts."""
        values: dict[str, float] = {}
        down_m: float | None = None
        if self._verticals is not None:
            low, high = inputs[self._verticals[0]], inputs[self._verticals[1]]
            if low is not NO_VALUE and high is not NO_VALUE:
                down_m = _number(low) - _number(high)
                values["z_dist"] = abs(down_m)
        if self._positions is None:
            return values
        here, there = inputs[self._positions[0]], inputs[self._positions[1]]
        if here is NO_VALUE or there is NO_VALUE:
            return values
        north_m, east_m = offset_m(here, there)
        xy_m = values["xy_dist"] = sqrt(north_m * north_m + east_m * east_m)
        if self._in_space and down_m is not None:
            values["dist_3d"] = sqrt(xy_m * xy_m + down_m * down_m)
        if self._velocities is None:
            return values
        u, v = inputs[self._velocities[0]], inputs[self._velocities[1]]
        if u is NO_VALUE or v is NO_VALUE:
            return values
        velocity = v[0] - u[0], v[1] - u[1], v[2] - u[2]
        if self._moving and down_m is not None:
            time_s, values["cpa_xy"], values["cpa_z"] = closest_approach((north_m, east_m, down_m), velocity)
            values["cpa_time"] = time_s * US_PER_S
        if self._keeping_clear and down_m is not None and isfinite(xy_m + down_m + sum(velocity)):
            p_m = north_m, east_m, down_m
            values["well_clear"] = float(is_well_clear(p_m, velocity, self._volume))
            values["time_to_violation"] = time_to_violation_s(p_m, velocity, self._volume) * US_PER_S
        if self._closing:
            values["hmd"] = horizontal_miss_m((north_m, east_m), velocity)
            values["closing_xy"] = -(north_m * velocity[0] + east_m * velocity[1])
        return values


class _Single:
    """Features of one unit."""

    def __init__(
        self,
        unit: str,
        names: dict[str, str],
        index: dict[FeatureInput, int],
        vertical: str,
        fence: Sequence[Sequence[float]],
    ) -> None:
        self._names, self._fence = names, fence
        labels = {"altitude": vertical, "height": HEIGHT, "battery": BATTERY}
        self._simple = {name: index[FeatureInput(label, unit)] for name, label in labels.items() if name in names}
        self._position, self._home = index.get(FeatureInput(POSITION, unit)), index.get(FeatureInput(HOME, unit))
        self._velocity = index.get(FeatureInput(VELOCITY, unit))

    def put(self, inputs: Sequence[Value], found: dict[str, Value]) -> None:
        for name, label in self._names.items():
            value = self._value(name, inputs)
            found[label] = value if value is not None and isfinite(value) else NO_VALUE

    def _value(self, name: str, inputs: Sequence[Value]) -> float | None:
        if name in self._simple:
            value = inputs[self._simple[name]]
            return None if value is NO_VALUE else _number(value)
        if name == "speed":
            velocity = _at(self._velocity, inputs)
            return None if velocity is NO_VALUE else hypot(velocity[0], velocity[1])
        position = _at(self._position, inputs)
        if position is NO_VALUE:
            return None
        if name == "fence_margin":
            return fence_margin_m(position, self._fence) if self._fence else None
        home = _at(self._home, inputs)
        return None if home is NO_VALUE else hypot(*offset_m(position, home))
