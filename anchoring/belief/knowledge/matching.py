"""Which known instance an instance is, and the attributes that it takes over.

An instance's beliefs are its prior times the likelihood of all that was observed of it. For a known one with belief p_k about an
attribute the observations are likelier than for something new by the factor

    discrete:    sum_v p_k(v) p(v) / p0(v)
    continuous:  N(m; m_k, P + P_k) / N(m; m_0, P + P_0), or V N(m; m_k, P + P_k) where the prior is uniform

whose product over all attributes counts. Rates are not compared: a memory does not move.
"""

from collections.abc import Mapping, Sequence
from math import log

import numpy as np

from dyknow.anchoring.belief.arrays import Floats
from dyknow.anchoring.belief.categories import CategoricalBeliefs
from dyknow.anchoring.belief.gaussians import GaussianBeliefs, log_normal
from dyknow.anchoring.belief.instances import InstanceTable
from dyknow.anchoring.belief.knowledge.ontology import KnownInstance
from dyknow.anchoring.belief.observations import TYPE

_SAME = 1e-6


def match(table: InstanceTable, row: int, known: Sequence[KnownInstance]) -> tuple[KnownInstance, float] | None:
    """The known instance that one most probably is, and how probably; each of them, and none, are equally likely at first."""
    if not known:
        return None
    logs = np.array([_log_factor(table, row, each) for each in known])
    peak = max(0.0, float(logs.max()))
    weights = np.exp(logs - peak)
    best = int(weights.argmax())
    return known[best], float(weights[best] / (weights.sum() + np.exp(-peak)))


def complete(table: InstanceTable, row: int, known: KnownInstance) -> list[str]:
    """Take over the type, and the attributes about which nothing was observed; these."""
    if TYPE in known.categorical:
        types = table.categorical[TYPE]
        shares = types.shares[row] * known.categorical[TYPE] / np.maximum(types.attribute.prior, _SAME)
        if shares.sum() > 0.0:
            types.shares[row] = shares / shares.sum()
    attributes = {name: shares for name, shares in known.categorical.items() if name != TYPE}
    return fill(table, row, known.gaussian, attributes)


def fill(
    table: InstanceTable,
    row: int,
    gaussian: Mapping[str, tuple[Floats, Floats]],
    categorical: Mapping[str, Floats],
) -> list[str]:
    """Believe this of attributes about which nothing was observed."""
    filled = []
    for name, (mean, covariance) in gaussian.items():
        beliefs = table.gaussian[name]
        if is_unknown(beliefs, row):
            beliefs.mean[row], beliefs.covariance[row] = mean, covariance
            filled.append(name)
    for name, shares in categorical.items():
        known = table.categorical[name]
        if is_unknown(known, row):
            known.shares[row] = shares
            filled.append(name)
    return filled


def is_unknown(beliefs: GaussianBeliefs | CategoricalBeliefs, row: int) -> bool:
    """Whether nothing has been observed of an attribute that the prior does not say."""
    if isinstance(beliefs, CategoricalBeliefs):
        return bool(np.abs(beliefs.shares[row] - beliefs.attribute.prior).max() < _SAME)
    axes = range(beliefs.attribute.axes)
    return bool((beliefs.covariance[row, axes, axes] > 0.99 * np.diag(beliefs.attribute.prior_covariance)[axes]).all())


def _log_factor(table: InstanceTable, row: int, known: KnownInstance) -> float:
    found = 0.0
    for name, shares in known.categorical.items():
        beliefs = table.categorical[name]
        prior = np.maximum(beliefs.attribute.prior, _SAME)
        found += log(max(float((shares * beliefs.shares[row] / prior).sum()), 1e-300))
    for name, (mean, covariance) in known.gaussian.items():
        gaussian = table.gaussian[name]
        if is_unknown(gaussian, row):
            continue
        attribute, axes = gaussian.attribute, gaussian.attribute.axes
        place, spread = gaussian.mean[row, :axes], gaussian.covariance[row, :axes, :axes]
        found += log_normal(place - mean[:axes], spread + covariance[:axes, :axes])
        if attribute.volume is not None:
            found += log(attribute.volume)
        else:
            of_new = attribute.prior_covariance[:axes, :axes] + spread
            found -= log_normal(place - attribute.prior_mean[:axes], of_new)
    return found
