"""Observations, and those of one look as arrays."""

from collections.abc import Mapping, Sequence
from math import inf, log
from typing import Any, NamedTuple

import numpy as np

from dyknow.anchoring.belief.arrays import Flags, Floats
from dyknow.anchoring.belief.categories import CategoricalBeliefs
from dyknow.anchoring.belief.description import POSITION, ObjectTypes, WorldSensor
from dyknow.anchoring.belief.gaussians import GaussianBeliefs

TYPE = "type"


class ReportedRelation(NamedTuple):
    """That what was observed is, or is not, in a relation to an instance."""

    name: str
    other: str
    holds: bool = True


class WorldObservation(NamedTuple):
    """Attributes of one thing, observed together.

    Attributes:
        values: numbers (m,) of continuous attributes, a symbol of discrete ones and of `type`.
        covariance: (m, m) of `position_m`; None: that of the sensor.
    """

    valid_us: int
    sensor: str
    values: Mapping[str, Any]
    covariance: Floats | None = None
    relations: tuple[ReportedRelation, ...] = ()


class MeasuredValues(NamedTuple):
    """One continuous attribute: values (M, m), covariances (M, m, m); `among` (M,) has those that say something of it."""

    values: Floats
    noise: Floats
    among: Flags | None


class ValueLikelihoods(NamedTuple):
    """One discrete attribute, or `type`: p(what was observed | value), (M, K)."""

    likelihood: Floats
    among: Flags | None


class EncodedLook(NamedTuple):
    """All observations of one sensor at one time.

    Attributes:
        log_birth, log_clutter: (M,) density of each, if it is of something new, and if it is of nothing; the two are equal
            within the region, beyond which nothing new appears.
        relations: of each observation.
    """

    valid_us: int
    sensor: WorldSensor
    size: int
    gaussian: Mapping[str, MeasuredValues]
    categorical: Mapping[str, ValueLikelihoods]
    log_birth: Floats
    log_clutter: Floats
    relations: tuple[tuple[ReportedRelation, ...], ...]


class LookEncoder:
    """Makes arrays of observations, given how attributes and types are believed in."""

    def __init__(
        self,
        types: ObjectTypes,
        gaussian: Mapping[str, GaussianBeliefs],
        categorical: Mapping[str, CategoricalBeliefs],
    ) -> None:
        self.types, self._gaussian, self._categorical = types, gaussian, categorical

    def look(self, valid_us: int, sensor: WorldSensor, observations: Sequence[WorldObservation]) -> EncodedLook:
        count = len(observations)
        log_birth, log_clutter = np.zeros(count), np.zeros(count)
        measured: dict[str, MeasuredValues] = {}
        for name, gaussian in self._gaussian.items():
            found = self._measured(name, gaussian, sensor, observations)
            if found is not None:
                measured[name] = found
                log_new = gaussian.log_birth(found.values, found.noise)
                _add(log_birth, log_new, found.among)
                volume = gaussian.attribute.volume
                _add(log_clutter, log_new if volume is None else np.full(count, -log(volume)), found.among)
        likely: dict[str, ValueLikelihoods] = {}
        for name, categorical in self._categorical.items():
            values = self._likelihoods(name, categorical, sensor, observations)
            if values is not None:
                likely[name] = values
                log_new = np.full(count, -log(len(categorical.attribute.values)))
                _add(log_birth, log_new, values.among)
                _add(log_clutter, log_new, values.among)
        if (types := self._of_type(sensor, observations)) is not None:
            likely[TYPE] = types
            log_new = _log(types.likelihood @ self.types.belief.prior)
            log_birth += log_new
            log_clutter += log_new
        relations = tuple(each.relations for each in observations)
        return EncodedLook(valid_us, sensor, count, measured, likely, log_birth, log_clutter, relations)

    @staticmethod
    def _measured(
        name: str, gaussian: GaussianBeliefs, sensor: WorldSensor, observations: Sequence[WorldObservation]
    ) -> MeasuredValues | None:
        axes, usual = gaussian.attribute.axes, sensor.noise.get(name)
        given = [each.values.get(name) for each in observations]
        missing = sum([each is None for each in given])
        if missing == len(given):
            return None
        usual = np.eye(axes) if usual is None else usual
        noise = np.broadcast_to(usual, (len(given), axes, axes))
        if name == POSITION and any(each.covariance is not None for each in observations):
            noise = np.array([usual if each.covariance is None else each.covariance for each in observations])
        if not missing:
            return MeasuredValues(np.array(given, dtype=np.float64).reshape(-1, axes), noise, None)
        among = np.array([each is not None for each in given])
        values = np.zeros((len(given), axes))
        values[among] = np.array([each for each in given if each is not None], dtype=np.float64).reshape(-1, axes)
        return MeasuredValues(values, noise, among)

    @staticmethod
    def _likelihoods(
        name: str, categorical: CategoricalBeliefs, sensor: WorldSensor, observations: Sequence[WorldObservation]
    ) -> ValueLikelihoods | None:
        given = [each.values.get(name) for each in observations]
        among = np.array([each is not None for each in given], dtype=np.bool_)
        if not among.any():
            return None
        table = _by_symbol(name, categorical.attribute.values, sensor)
        neutral = np.ones(len(categorical.attribute.values))
        likelihood = np.array([neutral if each is None else table[each] for each in given])
        return ValueLikelihoods(likelihood, None if among.all() else among)

    def _of_type(self, sensor: WorldSensor, observations: Sequence[WorldObservation]) -> ValueLikelihoods | None:
        """p(M | t), times the confusion of what class the sensor reports."""
        reports = any(TYPE in each.values for each in observations)
        if not self.types.observed and not reports:
            return None
        known: dict[tuple[str, ...], Floats] = {}
        table = _by_symbol(TYPE, self.types.names, sensor) if reports else {}
        rows = []
        for each in observations:
            key = tuple(each.values)
            if key not in known:
                known[key] = self.types.probability(frozenset(key) - {TYPE})
            symbol = each.values.get(TYPE)
            rows.append(known[key] if symbol is None else known[key] * table[symbol])
        return ValueLikelihoods(np.array(rows).reshape(-1, len(self.types.names)), None)


def _by_symbol(name: str, values: Sequence[str], sensor: WorldSensor) -> dict[str, Floats]:
    """For each symbol that a sensor may report p(symbol | value), (K,)."""
    confusion = sensor.confusion.get(name)
    if confusion is None:
        return dict(zip(values, np.eye(len(values)), strict=True))
    return dict(zip(confusion.symbols, confusion.matrix.T, strict=True))


def _add(into: Floats, more: Floats, among: Flags | None) -> None:
    into += more if among is None else np.where(among, more, 0.0)


def _log(probabilities: Floats) -> Floats:
    return np.log(probabilities, out=np.full_like(probabilities, -inf), where=probabilities > 0.0)
