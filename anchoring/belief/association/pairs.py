"""Likelihoods of pairs of instance and observation, of all or of those within the gate."""

from collections.abc import Mapping
from math import pi
from typing import Final, NamedTuple

import numpy as np

from dyknow.anchoring.belief.arrays import Floats, Indices
from dyknow.anchoring.belief.description import POSITION
from dyknow.anchoring.belief.gaussians import Innovations, determinants
from dyknow.anchoring.belief.instances import InstanceTable
from dyknow.anchoring.belief.observations import EncodedLook

FAINTEST: Final = 1e-100
"""Intensities of births and clutter that are less are none."""
_WIDEST_GATE = 1e4


class MeasuredPairs(NamedTuple):
    """One continuous attribute: the pairs that have it, None for all, and their innovations."""

    which: Indices | None
    innovations: Innovations


class Pairs(NamedTuple):
    """E pairs.

    Attributes:
        rows, cols: (E,) instance and observation; `rows` ascend.
        log_likelihood: (E,) log L, with all that was observed.
        is_limited: there were more than are allowed; the farthest were left out.
    """

    rows: Indices
    cols: Indices
    log_likelihood: Floats
    measured: Mapping[str, MeasuredPairs]
    is_limited: bool = False


def all_pairs(table: InstanceTable, look: EncodedLook) -> Pairs:
    """Every instance with every observation."""
    count = len(table)
    rows, cols = np.repeat(np.arange(count), look.size), np.tile(np.arange(look.size), count)
    return _weighed(table, look, rows, cols, {})


def gated_pairs(
    table: InstanceTable, look: EncodedLook, odds: Floats, faintest: float, most: int, negligible: float
) -> Pairs:
    """Pairs whose positions are near enough; every instance with every observation, where no position was observed or
    the observations can only come from instances.

    Args:
        table: the instances.
        look: the encoded observations.
        odds: (N,) that an instance exists and is detected.
        faintest: the least intensity of births and clutter at any observation: a pair has at most the weight
            odds / (faintest sqrt(|2 pi S|)) exp(-v^T S^-1 v / 2), times the densities of other attributes at their highest,
            and is not negligible within a gate that follows from it.
        most: pairs.
        negligible: the least weight.
    """
    measured = look.gaussian.get(POSITION)
    allowed = most // max(1, len(table))
    if measured is None or measured.among is not None or (faintest <= FAINTEST and look.size <= allowed):
        if look.size <= allowed:
            return all_pairs(table, look)
        rows, cols = np.repeat(np.arange(len(table)), allowed), np.tile(np.arange(allowed), len(table))
        return _weighed(table, look, rows, cols, {})._replace(is_limited=True)
    beliefs = table.gaussian[POSITION]
    with np.errstate(divide="ignore"):
        log_peak = (
            np.log(odds) - np.log(faintest * negligible) - 0.5 * np.log(determinants(2.0 * pi * beliefs.spread()))
        )
    gate = np.clip(2.0 * (log_peak + _highest(look)), 0.0, _WIDEST_GATE)
    noise = measured.noise[:, 0, 0].max(initial=0.0)
    reach = np.sqrt(gate * (beliefs.covariance[:, 0, 0] + noise))
    rows, cols, is_limited = _near(beliefs.mean[:, 0], reach, measured.values[:, 0], most)
    known: dict[str, MeasuredPairs] = {}
    if len(rows):
        innovations = beliefs.innovations(rows, cols, measured.values, measured.noise)
        inside = np.flatnonzero(innovations.distance < gate[rows])
        rows, cols = rows[inside], cols[inside]
        known[POSITION] = MeasuredPairs(None, innovations.chosen(inside))
    return _weighed(table, look, rows, cols, known)._replace(is_limited=is_limited)


def _highest(look: EncodedLook) -> float:
    """Log of the density that attributes other than the position have at most, if it is above 1."""
    others = [each.noise for name, each in look.gaussian.items() if name != POSITION]
    return sum(max(0.0, float((-0.5 * np.log(determinants(2.0 * pi * each))).max())) for each in others)


def _near(mean: Floats, reach: Floats, places: Floats, most: int) -> tuple[Indices, Indices, bool]:
    """Pairs that are near on one axis, (E,) each, and whether some of these had to be left out."""
    order = np.argsort(places)
    placed = places[order]
    first, last = np.searchsorted(placed, mean - reach), np.searchsorted(placed, mean + reach, "right")
    counts = last - first
    total = int(counts.sum())
    is_limited = total > most
    if is_limited:
        each = max(1, most // len(mean))
        first = np.clip(np.searchsorted(placed, mean) - each // 2, first, np.maximum(first, last - each))
        counts = np.minimum(last - first, each)
        total = int(counts.sum())
    rows = np.repeat(np.arange(len(mean)), counts)
    starts = np.cumsum(counts) - counts
    return rows, order[np.arange(total) + (first - starts)[rows]], is_limited


def _weighed(
    table: InstanceTable, look: EncodedLook, rows: Indices, cols: Indices, measured: dict[str, MeasuredPairs]
) -> Pairs:
    """The likelihoods of all attributes; those in `measured` are known already."""
    log_likelihood = np.zeros(len(rows))
    for name, values in look.gaussian.items():
        pairs = measured.get(name)
        if pairs is None:
            which = None if values.among is None else np.flatnonzero(values.among[cols])
            row, col = (rows, cols) if which is None else (rows[which], cols[which])
            pairs = measured[name] = MeasuredPairs(
                which, table.gaussian[name].innovations(row, col, values.values, values.noise)
            )
        if pairs.which is None:
            log_likelihood += pairs.innovations.log_likelihood
        else:
            log_likelihood[pairs.which] += pairs.innovations.log_likelihood
    for name, likely in look.categorical.items():
        with np.errstate(divide="ignore"):  # an observation that no value explains has no likelihood
            log_of = np.log(table.categorical[name].likelihood(rows, cols, likely.likelihood))
        log_likelihood += log_of if likely.among is None else np.where(likely.among[cols], log_of, 0.0)
    return Pairs(rows, cols, log_likelihood, measured)
