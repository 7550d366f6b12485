"""Association of a single observation with N instances, birth or clutter, and their existence after it.

Two readings of the association prior p(d | e), which the paper gives as p_E for an instance that exists and p_F for one that
does not; as they stand these are no distribution over d once N p_E > 1.

`event`: each source independently gives an observation or not; there was exactly one.
`share`: one observation is given, by each source in proportion to its weight.

Both are marginals over all 2^N vectors of existence and all associations, in O(N).
"""

from typing import Final, NamedTuple

import numpy as np

from dyknow.anchoring.belief.arrays import Floats

MOST_DETECTION: Final = 1.0 - 1e-9
MOST_EXISTENCE: Final = 1.0 - 1e-12
"""Nothing is quite certain: two certain instances could not both be silent."""
_STEP, _FIRST = 0.2, -42.0
_LONGEST: Final = 1 << 18
"""Most cells of nodes and instances that are evaluated at once."""


class SingleAssociation(NamedTuple):
    """Where one observation came from.

    Attributes:
        instances: (N,) P(d = i | y).
        birth, clutter: of the two other sources.
        existence: (N,) P(e_i = 1 | y), equation (9).
        weights: (N,) P(d = i | e_i = 1, y), the weights of the mixture (8).
    """

    instances: Floats
    birth: float
    clutter: float
    existence: Floats
    weights: Floats


class OtherSources(NamedTuple):
    """Birth and clutter: expected number of observations in a look, and log density of the observation given each."""

    births: float
    log_birth: float
    clutter: float
    log_clutter: float


def by_event(
    existence: Floats, log_likelihood: Floats, hit: Floats, false_alarm: Floats, others: OtherSources
) -> SingleAssociation | None:
    """Association by `event`; None where nothing could have given the observation.

    Args:
        existence: (N,) predicted.
        log_likelihood: (N,) of the observation, given that the instance exists and is its source.
        hit: (N,) p_E, of the sensor for each instance.
        false_alarm: (N,) p_F.
        others: birth and clutter.
    """
    r, p_e = np.minimum(existence, MOST_EXISTENCE), np.minimum(hit, MOST_DETECTION)
    p_f = np.minimum(false_alarm, MOST_DETECTION)
    silent = r * (1.0 - p_e) + (1.0 - r) * (1.0 - p_f)
    with np.errstate(divide="ignore", invalid="ignore"):
        exists = np.log(r) + np.log(p_e) + log_likelihood
        absent = np.log1p(-r) + np.log(p_f) + others.log_clutter
        either = np.logaddexp(exists, absent)
        sources = either - np.log(silent)
        birth, clutter = np.log(others.births) + others.log_birth, np.log(others.clutter) + others.log_clutter
    peak = max(sources.max(initial=-np.inf), birth, clutter)
    if not np.isfinite(peak):
        return None
    shares, birth, clutter = np.exp(sources - peak), float(np.exp(birth - peak)), float(np.exp(clutter - peak))
    total = float(shares.sum()) + birth + clutter
    shares /= total
    birth, clutter = birth / total, clutter / total
    not_its = 1.0 - shares
    if len(shares):
        largest = int(shares.argmax())  # of the likeliest source the difference may have lost its digits
        not_its[largest] = shares[:largest].sum() + shares[largest + 1 :].sum() + birth + clutter
    with np.errstate(invalid="ignore"):
        both = np.where(shares > 0.0, shares * np.exp(exists - either), 0.0)
    after = both + not_its * r * (1.0 - p_e) / silent
    return SingleAssociation(shares, birth, clutter, after, _ratio(both, after))


def by_share(
    existence: Floats, log_likelihood: Floats, hit: Floats, false_alarm: Floats, others: OtherSources
) -> SingleAssociation | None:
    """Association by `share`, with weights p_E, p_F and the expected numbers of births and clutter.

    The sum of all weights couples the existences. With 1 / D = integral of exp(-u D) du they factorise for each u; the
    integral is taken in log u by the trapezoid rule, which is exact to rounding for such an integrand.
    """
    r = np.minimum(existence, MOST_EXISTENCE)
    log_noise = others.log_clutter if others.clutter > 0.0 or (false_alarm > 0.0).any() else -np.inf
    log_birth = others.log_birth if others.births > 0.0 else -np.inf
    peak = max(log_likelihood.max(initial=-np.inf), log_noise, log_birth)
    other = others.births + others.clutter
    least = other + float(np.minimum(hit, false_alarm).sum())
    if not least > 0.0:
        least = float(hit.min(initial=1.0, where=hit > 0.0))
    if not np.isfinite(peak):
        return None
    likely, noise = np.exp(log_likelihood - peak), float(np.exp(log_noise - peak))
    birth, clutter = others.births * float(np.exp(log_birth - peak)), others.clutter * noise
    sums = _Sums(r, likely, hit, false_alarm, noise)
    for nodes in _chunks(_nodes(least), len(r)):
        sums.add(nodes, other, birth + clutter)
    total = sums.sources.sum() + sums.scale * (birth + clutter)
    if not total > 0.0:
        return None
    after = sums.exist / total
    return SingleAssociation(
        sums.sources / total,
        sums.scale * birth / total,
        sums.scale * clutter / total,
        after,
        _ratio(sums.both, sums.exist),
    )


class _Sums:
    """Integrals over u, with a common factor that keeps them within range."""

    def __init__(self, r: Floats, likely: Floats, hit: Floats, false_alarm: Floats, noise: float) -> None:
        with np.errstate(divide="ignore"):
            self._log_r, self._log_not = np.log(r), np.log1p(-r)
        self._hit, self._false_alarm = hit, false_alarm
        self._exists, self._absent = hit * likely, false_alarm * noise
        self.sources, self.both, self.exist = (np.zeros(len(r)) for _ in range(3))
        self.scale, self._peak = 0.0, -np.inf

    def add(self, log_u: Floats, other: float, constant: float) -> None:
        """Nodes (Q,): `other` is the weight of birth and clutter, `constant` what these contribute."""
        u = np.exp(log_u)[:, None]
        exists, absent = self._log_r - u * self._hit, self._log_not - u * self._false_alarm
        either = np.logaddexp(exists, absent)
        exists, absent = np.exp(exists - either), np.exp(absent - either)
        heights = log_u - u[:, 0] * other + either.sum(axis=1)
        self._lift(float(heights.max()))
        weight = np.exp(heights - self._peak)
        both = self._exists * exists
        source = both + self._absent * absent
        not_its = source.sum(axis=1, keepdims=True) + constant - source
        if source.shape[1]:
            nodes, largest = np.arange(len(source)), source.argmax(axis=1)
            rest = source.copy()
            rest[nodes, largest] = 0.0
            not_its[nodes, largest] = rest.sum(axis=1) + constant
        self.scale += float(weight.sum())
        self.sources += weight @ source
        self.both += weight @ both
        self.exist += weight @ (both + not_its * exists)

    def _lift(self, peak: float) -> None:
        if peak > self._peak:
            factor = float(np.exp(self._peak - peak))
            self.sources *= factor
            self.both *= factor
            self.exist *= factor
            self.scale *= factor
            self._peak = peak


def _nodes(least: float) -> Floats:
    """(Q,) log u: beyond the last one exp(-u D) is below rounding."""
    return np.arange(_FIRST, np.log(60.0 / least) + _STEP, _STEP)


def _chunks(nodes: Floats, count: int) -> list[Floats]:
    return np.array_split(nodes, -(-len(nodes) * max(1, count) // _LONGEST))


def _ratio(part: Floats, whole: Floats) -> Floats:
    return np.divide(part, whole, out=np.zeros_like(part), where=whole > 0.0)
