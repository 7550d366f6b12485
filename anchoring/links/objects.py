"""Objects, the links between them, and their events."""

from collections import deque
from collections.abc import Container
from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple, Protocol, TypeAlias

from dyknow.anchoring.links.individuals import Individual
from dyknow.anchoring.links.prediction import ObjectPrediction, certain
from dyknow.anchoring.links.specification import LinkSpecification
from dyknow.anchoring.links.states import ObjectState
from dyknow.reasoning import Explanation, Progressing
from dyknow.reasoning.formulas.tree import Formula

HISTORY: Final = 16
"""How many of its latest observed states an object keeps."""
LINKS_KEPT: Final = 64
"""How many of the latest events of its links an object keeps."""

EventKind: TypeAlias = Literal[
    "established", "reestablished", "unlinked", "reclassified", "forgotten", "find", "track", "reacquire", "lost"
]
"""The last four are of wanted objects: it comes into view, stays there for a second, is in view again; or is not."""
Cause: TypeAlias = Literal[
    "establish",
    "reestablish",
    "maintain",
    "weighed",
    "another",
    "wanted",
    "tracked",
    "released",
    "ended",
    "silent",
    "forgotten",
]


class LinkReason(NamedTuple):
    """Why a link was made or removed, or an object.

    Attributes:
        cause: a condition, or the description of a wanted object; that was seen for a while, or is wanted no more; the
            candidates of a percept were weighed again, or it has moved as the object does not; the percept ended, or
            had no sample for too long; the object was not
            anchored for too long.
        formula: of the condition, with the parts and samples that decided it in `explanations`.
        for_us: how long the percept was silent, or the object seen, or not anchored.
    """

    cause: Cause
    formula: Formula | None = None
    explanations: tuple[Explanation, ...] = ()
    for_us: int = 0


class LinkEvent(NamedTuple):
    """An event of a link, or of an object: then `source` is empty.

    Attributes:
        weight: how probable the target was, among the known objects that the source could have been.
    """

    valid_us: int
    kind: EventKind
    source: str
    source_type: str
    target: str
    target_type: str
    reason: LinkReason
    weight: float = 1.0


class LastSeen(NamedTuple):
    """How an object was known at one time, and the objects above it, each by the link that leads to it."""

    observed: tuple[ObjectState, ...]
    state: ObjectState
    prediction: ObjectPrediction | None
    anchored_us: int
    seen_us: int
    above: "tuple[tuple[ObjectLink, LastSeen], ...]" = ()


@dataclass(slots=True, eq=False)
class LinkObject:
    """An object: a symbol, a type and a stream of states.

    Attributes:
        state: the latest, observed or predicted.
        observed: the latest states that came through a link, or of a percept.
        prediction: the latest since then; None while it is observed.
        incoming, outgoing: live links, by the name of their process.
        anchored_us: when it was anchored last.
        seen_us: how long it was anchored, all together.
        individual: its learnt motion; None for percepts.
        classes: its last classification, by the name that exclusive specifications share.
    """

    symbol: str
    type: str
    created_us: int
    state: ObjectState
    observed: deque[ObjectState] = field(default_factory=lambda: deque(maxlen=HISTORY))
    prediction: ObjectPrediction | None = None
    incoming: "dict[str, ObjectLink]" = field(default_factory=dict)
    outgoing: "dict[str, ObjectLink]" = field(default_factory=dict)
    anchored_us: int = 0
    seen_us: int = 0
    individual: Individual | None = None
    classes: dict[str, str] = field(default_factory=dict)
    history: deque[LinkEvent] = field(default_factory=lambda: deque(maxlen=LINKS_KEPT))

    def observe(self, state: ObjectState, *, is_sure: bool = True) -> None:
        """Take a state that was seen; unless it is sure that it is its own, nothing is learnt of its motion."""
        self.state, self.prediction = state, None
        self.observed.append(state)
        if self.individual is not None and is_sure:
            self.individual.observe(state)

    def anchor(self, valid_us: int, since_us: int) -> None:
        """A live link leads to it, one that has done so since then."""
        self.seen_us += valid_us - max(self.anchored_us, since_us)
        self.anchored_us = valid_us

    def is_anchored(self, percepts: Container[str]) -> bool:
        """Whether live links lead to it from one of these types, or it is of one."""
        return self.type in percepts or any(link.source.is_anchored(percepts) for link in self.incoming.values())

    @property
    def last_seen(self) -> LastSeen:
        """How it is known now."""
        above = tuple((link, link.target.last_seen) for link in self.outgoing.values())
        return LastSeen(tuple(self.observed), self.state, self.prediction, self.anchored_us, self.seen_us, above)

    def go_back(self, to: LastSeen) -> None:
        """Go back to the state before a wrong link; objects above it go back, too, unless another link shows them."""
        self.observed.clear()
        self.observed.extend(to.observed)
        self.state, self.prediction = to.state, to.prediction
        self.anchored_us, self.seen_us = to.anchored_us, to.seen_us
        for link, seen in to.above:
            if self.outgoing.get(link.process.name) is link and len(link.target.incoming) == 1:
                link.target.go_back(seen)

    def as_known(self, before: LastSeen) -> "LinkObject":
        """The object as it was known, apart from all others; those above it predict it."""
        known = LinkObject(self.symbol, self.type, self.created_us, before.state, individual=self.individual)
        known.go_back(before)
        for link, seen in before.above:
            above = link.target.as_known(seen)
            known.outgoing[link.process.name] = ObjectLink(link.process, known, above, link.since_us)
        return known

    def expect(self, prediction: ObjectPrediction) -> None:
        """Take a state that was predicted."""
        self.state, self.prediction = prediction.likely, prediction

    @property
    def whereabouts(self) -> ObjectPrediction:
        """All hypotheses about the latest state."""
        return self.prediction or certain(self.state)


class LinkOwner(Protocol):
    """The process of a link."""

    @property
    def name(self) -> str: ...

    @property
    def specification(self) -> LinkSpecification: ...

    def unlink(self, valid_us: int, link: "ObjectLink", reason: LinkReason) -> None:
        """Remove a link of this process."""


@dataclass(slots=True, eq=False)
class ObjectLink:
    """A hypothesis: both objects are the same physical thing.

    Attributes:
        maintain: the evaluation of the condition; None if it can no longer fail.
        state: of the target, as this link alone makes it; None if its unit weighs it with the state before.
        weight: how probable it is, where its source may be other known objects as well.
    """

    process: LinkOwner
    source: LinkObject
    target: LinkObject
    since_us: int
    maintain: Progressing | None = None
    state: ObjectState | None = None
    weight: float = 1.0

    @property
    def is_doubtful(self) -> bool:
        """Whether both were seen so far apart that the place of the target is no evidence for that of the source."""
        if not (self.source.observed and self.target.observed):
            return False
        apart_m = self.source.observed[-1].distance_m(self.target.observed[-1])
        return apart_m > self.process.specification.threshold.most_m / 2
