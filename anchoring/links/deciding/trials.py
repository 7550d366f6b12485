"""Links on trial: the later motion of a percept may show that it is not the known object it was linked to.

A percept is linked at once, by where it is; how it moves is seen later. For a while two tracks take each of its states:
that of the known object, and that of a stranger that has come into view with the percept, as fast as others are. The
logarithm of their likelihood ratio starts at the value for which the link was made. Once the stranger is the likelier
one, the link is taken back: the object is as it was before, and the percept waits as if it had not been linked. It is
not taken for the same object again before that was linked to something else.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

from dyknow import US_PER_S
from dyknow.anchoring.links.deciding.conditions import Ends, PairCondition
from dyknow.anchoring.links.deciding.waiting import ReestablishPair, Unlinked
from dyknow.anchoring.links.motion import loosened
from dyknow.anchoring.links.objects import LastSeen, LinkObject, ObjectLink
from dyknow.anchoring.links.specification import LinkSpecification, filtered, unlikely
from dyknow.anchoring.links.states import UNMEASURED, ObjectState
from dyknow.reasoning import Progressing

LASTS_US: Final = 2 * US_PER_S
_TAKEN_BACK, _KEPT = -2.0, 8.0
"""The evidence below which a link is taken back, and above which it is on trial no more."""
_LEAST_SPEED_VARIANCE: Final = 0.25


@dataclass(slots=True)
class LinkTrial:
    """A link that may be taken back.

    Attributes:
        waiting: the evaluations of the percept, as if it were not linked.
        before: how the object was known before.
        known, other: the latest states of the object that the percept is, and of the one that it would be if it were another.
        evidence: the logarithm of how much likelier it is that it is the known one.
    """

    since_us: int
    waiting: Unlinked
    before: LastSeen
    known: ObjectState
    other: ObjectState
    evidence: float

    def again(self, from_us: int, target: str, available_us: int) -> Unlinked:
        """The percept after the link was taken back: not the same object again while that is available since then."""
        self.waiting.from_us, self.waiting.estimate = from_us, self.other
        self.waiting.pairs[target] = ReestablishPair(available_us, None)
        return self.waiting


class LinkTrials:
    """The links of one process that are on trial: of percepts, adaptively, to objects that move on as they did.

    An object above it, such as its place on a road, already tells where it turns; then its motion is no evidence.
    """

    def __init__(self, specification: LinkSpecification, establish: PairCondition) -> None:
        self._is_held = specification.is_adaptive and specification.unit is filtered
        self._later: Callable[[ObjectState, int], ObjectState] = specification.later
        self._establish = establish
        self.by_source: dict[str, LinkTrial] = {}

    def begin(self, waiting: Unlinked, link: ObjectLink, before: LastSeen, expected: ObjectState, score: float) -> None:
        """A percept was linked to an object that was expected somewhere: with a score less than 0 if it is more likely that one."""
        if not self._is_held or link.target.outgoing:
            return
        known = filtered(link.source.state, loosened(expected))
        other = _as_another(link.source, link.target, self._later)
        evidence = max(0.0, -score / 2.0)
        self.by_source[link.source.symbol] = LinkTrial(link.since_us, waiting, before, known, other, evidence)

    def end(self, source: str) -> None:
        """A link is gone."""
        self.by_source.pop(source, None)

    def failed(self, valid_us: int, link: ObjectLink) -> LinkTrial | None:
        """The trial of a link, if the state that its source has now ends it."""
        source = link.source
        trial = self.by_source.get(source.symbol)
        if trial is None or source.prediction is not None:
            return None
        self._wait(valid_us, trial.waiting, source)
        known, other = self._later(trial.known, valid_us), self._later(trial.other, valid_us)
        trial.evidence += (unlikely(source.state, other) - unlikely(source.state, known)) / 2.0
        trial.known, trial.other = filtered(source.state, known), filtered(source.state, other)
        if trial.evidence < _TAKEN_BACK:
            return trial
        if trial.evidence > _KEPT or valid_us - trial.since_us > LASTS_US:
            self.end(source.symbol)
        return None

    def _wait(self, valid_us: int, waiting: Unlinked, source: LinkObject) -> None:
        """Step the establish condition as if the object were not linked."""
        establish = waiting.establish
        if establish is None or establish.verdict != "undecided":
            return
        self._establish.step(establish, valid_us, source.state, ends=Ends(source.symbol))
        waiting.establish = self._still(establish)

    @staticmethod
    def _still(establish: Progressing) -> Progressing | None:
        return None if establish.verdict == "false" else establish

    def pairs(self) -> Iterator[dict[str, ReestablishPair]]:
        """The reestablish conditions that wait, by the symbols of their objects."""
        yield from (each.waiting.pairs for each in self.by_source.values())


def _as_another(
    source: LinkObject, target: LinkObject, later: Callable[[ObjectState, int], ObjectState]
) -> ObjectState:
    """The estimate of a percept by its own states, whose velocity is at first that of others."""
    first, *others = source.observed
    speed = target.individual.square_speed if target.individual is not None else UNMEASURED
    covariance = first.covariance.copy()
    for axis in (2, 3):
        covariance[axis, axis] = min(covariance[axis, axis], max(_LEAST_SPEED_VARIANCE, speed / 2.0))
    state = first._replace(covariance=covariance)
    for each in others:
        state = filtered(each, later(state, each.valid_us))
    return state
