"""Reports of updates: associations, events, and instances with their beliefs."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from dyknow.anchoring.belief.arrays import Floats, Indices

CREATED, CONFIRMED, DELETED = "created", "confirmed", "deleted"
ATTRIBUTE_CREATED, ATTRIBUTE_DROPPED = "attribute-created", "attribute-dropped"
RELATION_CREATED, RELATION_DROPPED = "relation-created", "relation-dropped"
OF_RELATIONS = frozenset({RELATION_CREATED, RELATION_DROPPED})
UNEXPLAINED, LATE, LIMITED, UNKNOWN = "unexplained", "late", "limited", "unknown-instance"
TENTATIVE = "tentative"
NEW, CLUTTER = "new", "clutter"
_NEGLIGIBLE = 1e-10


class LifeEvent(NamedTuple):
    """Something began or ended.

    Attributes:
        instance: its name; empty: about no instance.
        existence: of it, then.
        what: the attribute or relation.
        because: the reason, where there is one to give.
    """

    valid_us: int
    kind: str
    instance: str = ""
    existence: float = 0.0
    what: str = ""
    because: str = ""


class GaussianBelief(NamedTuple):
    """Mean (d,) and covariance (d, d), places before rates."""

    mean: Floats
    covariance: Floats


class BelievedInstance(NamedTuple):
    """One instance.

    Attributes:
        status: tentative or confirmed.
        type: the probability of each.
        gaussian, categorical: the attributes that it has.
        relations: (name, other instance) -> probability, of those that it has.
        known: name of the prior instance that it is.
    """

    name: str
    existence: float
    status: str
    type: Mapping[str, float]
    gaussian: Mapping[str, GaussianBelief]
    categorical: Mapping[str, Mapping[str, float]]
    relations: Mapping[tuple[str, str], float]
    known: str = ""


class UpdateReport(NamedTuple):
    """The result of a look, or of time alone.

    Attributes:
        names: of the N instances before it.
        existence: (N,) after it.
        rows, cols, pairs: (E,) P(instance `rows` gave observation `cols`).
        births, clutter: (M,) of each observation.
        is_scan: mutual exclusion was observed.
        is_exact: the association is a sum over all possible ones.
    """

    valid_us: int
    names: Sequence[str]
    existence: Floats
    rows: Indices
    cols: Indices
    pairs: Floats
    births: Floats
    clutter: Floats
    events: tuple[LifeEvent, ...]
    is_scan: bool = False
    is_exact: bool = True

    @property
    def associations(self) -> list[dict[str, float]]:
        """For each observation the probability of each instance as its origin, above 1e-10."""
        found: list[dict[str, float]] = [{} for _ in self.births]
        for row, col, value in zip(self.rows.tolist(), self.cols.tolist(), self.pairs.tolist(), strict=True):
            if value >= _NEGLIGIBLE:
                found[col][self.names[row]] = value
        for each, birth, clutter in zip(found, self.births.tolist(), self.clutter.tolist(), strict=True):
            each |= {NEW: birth, CLUTTER: clutter}
        return found

    @property
    def created(self) -> list[str]:
        return [each.instance for each in self.events if each.kind == CREATED]

    @property
    def deleted(self) -> list[str]:
        return [each.instance for each in self.events if each.kind == DELETED]

    @property
    def is_unexplained(self) -> bool:
        """Whether an observation could have come from nothing that is modelled."""
        return any(each.kind == UNEXPLAINED for each in self.events)
