"""The description of a world model: types, attributes, relations, sensors, thresholds. All of it is values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import inf
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import numpy as np

from dyknow.anchoring.belief.arrays import Floats
from dyknow.navigation import LocalFrame

EVENT, SHARE = "event", "share"
READINGS: Final = (EVENT, SHARE)
POSITION: Final = "position_m"
ALTITUDE: Final = "altitude_m"
"""The attribute that is the height above the ellipsoid where positions are on earth."""
"""The attribute that regions and fields of view are about."""
_NOTHING: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class GaussianAttribute:
    """A continuous attribute: its motion, what is believed of something new, and when it is created and dropped.

    Attributes:
        axes: numbers that are observed of it.
        order: 1 what wanders, 2 what also has rates, 3 what also has accelerations.
        noise: density of the white noise that drives it, squared units per second (to the power of 1, 3, 5).
        low, high: (axes,) where it may be, uniformly; empty: Gaussian about `mean` (axes,) with `sd` (axes,).
        rate_sd: of rates and accelerations at first.
        is_angle: radians, one axis.
        create_sd, drop_sd: it is created once no axis deviates by more than the one, dropped once one does by the other.
    """

    name: str
    axes: int = 1
    order: int = 1
    noise: float = 0.0
    low: Floats = field(default_factory=lambda: np.zeros(0))
    high: Floats = field(default_factory=lambda: np.zeros(0))
    mean: Floats = field(default_factory=lambda: np.zeros(0))
    sd: Floats = field(default_factory=lambda: np.zeros(0))
    rate_sd: tuple[float, ...] = ()
    is_angle: bool = False
    create_sd: float = inf
    drop_sd: float = inf

    @cached_property
    def is_optional(self) -> bool:
        """Whether an instance may be without it."""
        return min(self.create_sd, self.drop_sd) < inf

    @cached_property
    def volume(self) -> float | None:
        """Of the region in which it is uniform; None where it is Gaussian."""
        return float(np.prod(self.high - self.low)) if len(self.low) else None

    @cached_property
    def prior_mean(self) -> Floats:
        """(d,) of something new."""
        places = (self.low + self.high) / 2.0 if len(self.low) else self.mean
        return np.concatenate((places, np.zeros(self.axes * (self.order - 1))))

    @cached_property
    def prior_covariance(self) -> Floats:
        """(d, d)."""
        variances = (self.high - self.low) ** 2 / 12.0 if len(self.low) else self.sd**2
        rates = [each**2 for each in self.rate_sd[: self.order - 1] for _ in range(self.axes)]
        return np.diag(np.concatenate((variances, rates)))


@dataclass(frozen=True, eq=False)
class CategoricalAttribute:
    """A discrete attribute.

    Attributes:
        prior: (K,) of something new.
        ageing_s: time constant with which it becomes uniform.
        create, drop: it is created once one value is likelier than the one, dropped once none is as likely as the other.
    """

    name: str
    values: tuple[str, ...]
    prior: Floats
    ageing_s: float = inf
    create: float = 0.0
    drop: float = 0.0

    @cached_property
    def is_optional(self) -> bool:
        """Whether an instance may be without it."""
        return self.create > 0.0


class RelationKind(NamedTuple):
    """A binary relation between two instances.

    Attributes:
        prior: that it holds between any two.
        right, wrong: that it is reported where it holds, and where it does not.
        create, drop: thresholds of its probability.
    """

    name: str
    prior: float = 0.1
    ageing_s: float = inf
    right: float = 0.9
    wrong: float = 0.1
    create: float = 0.8
    drop: float = 0.6


@dataclass(frozen=True, eq=False)
class ObjectTypes:
    """All types.

    Attributes:
        belief: their prior and ageing, as of an attribute.
        observed: p(M | t): for each set of attributes that may be observed together the probabilities (T,); empty: 1.
        least: the probability of sets that the table does not have.
    """

    belief: CategoricalAttribute
    observed: Mapping[frozenset[str], Floats] = field(default_factory=dict)
    least: float = 1e-6

    @property
    def names(self) -> tuple[str, ...]:
        return self.belief.values

    def probability(self, attributes: frozenset[str]) -> Floats:
        """(T,) that just these are observed, of each type."""
        if not self.observed:
            return np.ones(len(self.names))
        found = self.observed.get(attributes)
        return np.full(len(self.names), self.least) if found is None else np.maximum(found, self.least)


class Confusion(NamedTuple):
    """A sensor's reports of a discrete attribute: `matrix` (K, O) is p(symbol | value)."""

    symbols: tuple[str, ...]
    matrix: Floats


@dataclass(frozen=True, eq=False)
class WorldSensor:
    """How the world is observed.

    Attributes:
        detects: p_E, in a scan P_D: that something in view is observed.
        false_alarm: p_F, of single observations.
        births, clutter: expected number of new things, and of false observations, in a look.
        noise: covariance of each continuous attribute.
        confusion: of each discrete attribute, and of `type`.
        view_m: corners of its field of view, (V, 2); None: everything.
        is_frame: whether also a single observation is a scan, of one.
        trust: how far it is trusted, in [0, 1].
    """

    name: str
    detects: float = 0.9
    false_alarm: float = 0.01
    births: float = 0.1
    clutter: float = 0.1
    noise: Mapping[str, Floats] = field(default_factory=lambda: _NOTHING)
    confusion: Mapping[str, Confusion] = field(default_factory=lambda: _NOTHING)
    view_m: Floats | None = None
    is_frame: bool = False
    trust: float = 1.0


class LifeThresholds(NamedTuple):
    """Probabilities at which instances are created (gamma_n), confirmed (gamma_i) and deleted (gamma_e)."""

    create: float = 0.1
    confirm: float = 0.9
    delete: float = 0.05


class WorldLimits(NamedTuple):
    """Bounds of the work: instances, observations of a scan, and pairs of the two that are weighed."""

    instances: int = 10_000
    scan: int = 5_000
    pairs: int = 200_000


class InitialInstance(NamedTuple):
    """An instance that exists from the beginning.

    Attributes:
        gaussian: mean (d,) and covariance (d, d) of continuous attributes.
        categorical: (K,) of discrete ones, and of `type`.
    """

    name: str
    existence: float
    gaussian: Mapping[str, tuple[Floats, Floats]] = _NOTHING
    categorical: Mapping[str, Floats] = _NOTHING


_USUAL_THRESHOLDS, _USUAL_LIMITS = LifeThresholds(), WorldLimits()


@dataclass(frozen=True, eq=False)
class WorldModel:
    """All of it.

    Attributes:
        lifetime_s: tau of existence: without observations it decays by exp(-t / tau).
        frame: where x = y = 0 of positions is on earth, if that is known.
    """

    types: ObjectTypes
    gaussian: Sequence[GaussianAttribute] = ()
    categorical: Sequence[CategoricalAttribute] = ()
    relations: Sequence[RelationKind] = ()
    sensors: Mapping[str, WorldSensor] = field(default_factory=lambda: _NOTHING)
    reading: str = EVENT
    thresholds: LifeThresholds = _USUAL_THRESHOLDS
    lifetime_s: float = inf
    limits: WorldLimits = _USUAL_LIMITS
    initial: Sequence[InitialInstance] = ()
    frame: LocalFrame | None = None

    @property
    def area(self) -> tuple[float, float, float, float] | None:
        """West, south, east and north of the region, metres; None where positions have none."""
        place = next((each for each in self.gaussian if each.name == POSITION and len(each.low)), None)
        return None if place is None else (*place.low[:2].tolist(), *place.high[:2].tolist())

    @property
    def attributes(self) -> dict[str, GaussianAttribute | CategoricalAttribute]:
        """Each attribute by its name."""
        every: list[GaussianAttribute | CategoricalAttribute] = [*self.gaussian, *self.categorical]
        return {each.name: each for each in every}


def uniform(name: str, values: Sequence[str], **about: Any) -> CategoricalAttribute:
    """A discrete attribute without a prior belief."""
    return CategoricalAttribute(name, tuple(values), np.full(len(values), 1.0 / len(values)), **about)
