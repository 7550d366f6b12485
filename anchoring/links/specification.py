"""ObjectLink specifications: how objects of one type become objects of another (Heintz, Rudol and Doherty, section IV-B; thesis Def. 8.5.3).

`strmgen b = link(a, cu, e, r, m)` with our additional keys. Conditions are formulas over the objects `from` and `to`:

* `xy_dist[from, to]` (also `xydist`): distance on the plane, the least over all hypotheses of `to`.
* `thresh`: how far `to` may be from where it is expected, see `Threshold`.
* `speed[from]`, `deviation[from]`: of the state; `NAME[from]`: an entry of `features`, else an attribute of the state.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from math import exp, log
from types import MappingProxyType
from typing import Final, NamedTuple, Protocol, TypeAlias, TypeVar

from dyknow import US_PER_S, Value
from dyknow.anchoring.links.motion import noise_of
from dyknow.anchoring.links.prediction import ObjectPrediction, Predictor
from dyknow.anchoring.links.states import ObjectState, diagonal, moved, weighed
from dyknow.reasoning.formulas.tree import Const, Formula

StateUnit: TypeAlias = Callable[[ObjectState, ObjectState | None], ObjectState]
"""The computational unit of a link: (state of A, state of B predicted to its time or None if B is new) -> state of B."""
Score: TypeAlias = Callable[[ObjectState, ObjectPrediction], float]
"""How badly a state fits an object that is expected somewhere; the least wins."""
Weigh: TypeAlias = Callable[[ObjectState, Mapping[str, ObjectPrediction]], Mapping[str, float]]
"""How probable each of several objects, by symbol, is the one that a state shows; the weights sum to 1."""
StateFeature: TypeAlias = Callable[[ObjectState], Value]
FROM: Final = "from"
TO: Final = "to"
DISTANCES: Final = frozenset({"xy_dist", "xydist"})
THRESHOLD: Final = "thresh"
ALWAYS_TRUE: Final = Const(value=True)
_UNKNOWN_SPEED_M_S: Final = 15.0


class Threshold(NamedTuple):
    """`scale` times the deviation of the predicted position, within bounds; fixed where both are the same."""

    scale: float = 3.0
    least_m: float = 5.0
    most_m: float = 25.0

    def of(self, expected: ObjectState) -> float:
        return min(self.most_m, max(self.least_m, self.scale * expected.deviation_m))


USUAL: Final = Threshold()


class Lasting(NamedTuple):
    """How long an object that no percept shows is kept, and predicted, by how long it was seen before, all together.

    It is kept `kept` times as long, and has states for `predicted` times as long: an object that was seen for a second
    is hardly expected for a minute.

    Attributes:
        least_kept_us, least_predicted_us: at least that long; not predicted for longer than it was seen.
    """

    kept: float = 1.0
    predicted: float = 0.25
    least_kept_us: int = 10 * US_PER_S
    least_predicted_us: int = US_PER_S


def distance(state: ObjectState, expected: ObjectPrediction) -> float:
    """The default score: metres to the nearest hypothesis."""
    return state.distance_m(expected.nearest(state))


def unlikelihood(state: ObjectState, expected: ObjectPrediction) -> float:
    """Twice the negative logarithm of how likely a position is, up to a constant: of the best hypothesis."""
    return min(unlikely(state, each.state) - 2.0 * log(max(each.weight, 1e-9)) for each in expected.hypotheses)


def unlikely(state: ObjectState, expected: ObjectState) -> float:
    """d^T S^-1 d + log det S, where S is the sum of both covariances of the position."""
    a, b = (state.covariance[:2, :2] + expected.covariance[:2, :2]).tolist()
    dx, dy = state.x_m - expected.x_m, state.y_m - expected.y_m
    determinant = a[0] * b[1] - a[1] * b[0]
    apart = (b[1] * dx * dx - (a[1] + b[0]) * dx * dy + a[0] * dy * dy) / determinant
    return float(apart + log(determinant))


def likelihoods(state: ObjectState, candidates: Mapping[str, ObjectPrediction]) -> dict[str, float]:
    """The weights of candidates that are as probable before the state is seen: by how likely they make it."""
    scores = {symbol: unlikelihood(state, expected) for symbol, expected in candidates.items()}
    least = min(scores.values(), default=0.0)
    weights = {symbol: exp((least - score) / 2.0) for symbol, score in scores.items()}
    return {symbol: weight / sum(weights.values()) for symbol, weight in weights.items()}


def filtered(measured: ObjectState, prior: ObjectState | None) -> ObjectState:
    """The unit of percepts: a Kalman filter, whose first estimate has a velocity of 0 +- 15 m/s if none is measured."""
    if prior is None:
        unknown = diagonal(1e4, _UNKNOWN_SPEED_M_S)
        prior = ObjectState(measured.valid_us, measured.x_m, measured.y_m, 0.0, 0.0, unknown)
    return weighed(prior, measured)


@dataclass(frozen=True, slots=True)
class LinkSpecification:
    """One link process.

    Attributes:
        source, target: the types A and B.
        unit: makes the state of B from that of A.
        establish: over `from`; true: `from` is a new object.
        reestablish: over `from` and `to`; true: it is this known one.
        maintain: over both; false: the hypothesis is withdrawn.
        predictor: of objects of B that are not linked; None: they are where the objects below them are.
        noise: density of the acceleration noise between two samples, m^2/s^3.
        forget_us: objects of B that were not anchored for so long are removed.
        lasting: how long they are kept before that, and predicted; None: for `forget_us`, all of them.
        is_adaptive: `noise` is that of the kind of thing, or of its speed, and `thresh` is not more than that of `threshold` but
            follows from how certain both positions are, and how far apart things are; see `motion`.
        threshold: the value of `thresh` in the conditions.
        exclusive: specifications with the same name here exclude each other for one object of A.
        correlated: errors of this process may be correlated with those of others into B; else they are independent.
        is_recursive: the unit weighs what it is given with the state before; else that is done with the states that other
            links make.
        weigh: the weights of the known objects that one object of A could be.
        candidates: most of them that are kept; with 1 it is taken for the one that is chosen.
        features: further features of `from` and `to`, by name.
        streams: features of one end that are streams of their own, and no attributes.
    """

    source: str
    target: str
    establish: Formula
    reestablish: Formula
    maintain: Formula = ALWAYS_TRUE
    unit: StateUnit = filtered
    predictor: Predictor | None = None
    noise: float = 2.0
    forget_us: int = 30 * US_PER_S
    lasting: Lasting | None = None
    is_adaptive: bool = False
    threshold: Threshold = USUAL
    score: Score = distance
    exclusive: str = ""
    correlated: bool = False
    is_recursive: bool = True
    weigh: Weigh = likelihoods
    candidates: int = 1
    features: Mapping[str, StateFeature] = field(default_factory=lambda: MappingProxyType({}), compare=False)
    streams: frozenset[str] = frozenset()

    @property
    def name(self) -> str:
        """As it is printed."""
        return f"{self.source} -> {self.target}"

    def later(self, state: ObjectState, to_us: int) -> ObjectState:
        """A state predicted to a later time, between two samples."""
        return moved(state, to_us, noise_of(state) if self.is_adaptive else self.noise)

    def kept_us(self, seen_us: int) -> int:
        """How long an object that was seen for so long is kept while it is not anchored."""
        if self.lasting is None:
            return self.forget_us
        return min(self.forget_us, max(self.lasting.least_kept_us, round(self.lasting.kept * seen_us)))

    def predicted_us(self, seen_us: int) -> int:
        """How long it has states while it is not anchored."""
        if self.lasting is None:
            return self.forget_us
        return min(seen_us, max(self.lasting.least_predicted_us, round(self.lasting.predicted * seen_us)))


class Typed(Protocol):
    """A specification of objects of a type that are made of those of another."""

    @property
    def source(self) -> str: ...
    @property
    def target(self) -> str: ...
    @property
    def name(self) -> str: ...


Specified = TypeVar("Specified", bound=Typed)


def in_order(specifications: Sequence[Specified]) -> list[Specified]:
    """Those into lower types first; in the order given where that is left open.

    Raises:
        ValueError: types are in a circle, or two specifications have the same types.
    """
    names = [each.name for each in specifications]
    if len(set(names)) < len(names):
        raise ValueError(f"each pair of types has one link specification, got {', '.join(names)}")
    below: dict[str, list[str]] = {}
    for each in specifications:
        below.setdefault(each.target, []).append(each.source)
    try:
        types = list(TopologicalSorter(below).static_order())
    except CycleError as wrong:
        raise ValueError(f"types are linked in a circle: {' -> '.join(wrong.args[1])}") from None
    return sorted(specifications, key=lambda each: types.index(each.target))


def prefix_of(type_: str, types: Collection[str]) -> str:
    """`wo` of world objects, `oo` of on-road objects, as the paper has it; the whole name where another type has it too."""
    return f"{type_[0]}o" if sum(other[0] == type_[0] for other in types) == 1 else f"{type_}_"
