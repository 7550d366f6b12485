"""ObjectLink processes: the state machine of each object of type A (thesis Figure 8.4).

An object of A is unlinked, with evaluations of establish and of reestablish for each available object of B, or linked,
with one of maintain. All changes at one valid time are decided together: first maintain, then reestablish for all pairs
by one assignment, then establish. An evaluation starts at the first state in which both objects have a value; after a
maintain condition failed, at the next one. Pairs that a gate keeps apart cost nothing until they come near.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping

from dyknow.anchoring.links.assignment import natural
from dyknow.anchoring.links.deciding.candidates import (
    LinkCandidate,
    LinkCandidates,
    OpenLink,
    assigned_with,
    known_before,
    open_links,
    reassigned,
)
from dyknow.anchoring.links.deciding.conditions import Ends, PairCondition
from dyknow.anchoring.links.deciding.nearness import NearObjects
from dyknow.anchoring.links.deciding.ports import LinkPorts
from dyknow.anchoring.links.deciding.reach import Reach
from dyknow.anchoring.links.deciding.trials import LinkTrials
from dyknow.anchoring.links.deciding.waiting import ReestablishPair, Unlinked
from dyknow.anchoring.links.objects import EventKind, LastSeen, LinkObject, LinkReason, ObjectLink
from dyknow.anchoring.links.prediction import ObjectPrediction, certain
from dyknow.anchoring.links.specification import LinkSpecification, filtered
from dyknow.anchoring.links.states import ObjectState, intersected, weighed
from dyknow.reasoning import Progressing


class LinkProcess:
    """One specification at work.

    Attributes:
        unlinked: objects of A that are not linked, by symbol.
        available: since when each object of B has had no link of this process, by symbol.
        candidates: of the objects of A that may be several of B, by symbol.
        trials: the links that may be taken back.
        evaluations: how many progressions were made or continued at the latest tick.
    """

    def __init__(self, specification: LinkSpecification, ports: LinkPorts) -> None:
        self.specification = specification
        self.name = specification.name
        context, self._reach = ports.context, Reach(specification)
        self._establish = PairCondition(specification.establish, specification, context=context)
        self._reestablish = PairCondition(
            specification.reestablish, specification, context=context, thresh=self._reach.thresh
        )
        self._maintain = PairCondition(
            specification.maintain, specification, context=context, thresh=self._reach.thresh
        )
        self._ports = ports
        self.unlinked: dict[str, Unlinked] = {}
        self.available: dict[str, tuple[LinkObject, int]] = {}
        self.candidates: dict[str, LinkCandidates] = {}
        self.trials = LinkTrials(specification, self._establish)
        self.evaluations = 0

    # Reports of the structures

    def on_source(self, one: LinkObject, from_us: int) -> None:
        """An object of A is new, or unlinked again; its evaluations start at the first state from then on."""
        self.unlinked[one.symbol] = Unlinked(from_us, self._establish.start())

    def on_target(self, one: LinkObject, valid_us: int) -> None:
        """An object of B has no link of this process."""
        self.available[one.symbol] = one, valid_us

    def drop_source(self, symbol: str) -> None:
        """An object of A is gone, or linked by a process that excludes this one."""
        self.unlinked.pop(symbol, None)

    def drop_target(self, symbol: str) -> None:
        """An object of B is gone, and a candidate for nothing: a new one under its symbol is another."""
        self.available.pop(symbol, None)
        if self.candidates:
            self._drop_taken()

    def unlink(self, valid_us: int, link: ObjectLink, reason: LinkReason) -> None:
        """Remove a link; its target is available from now on, from the next state on if it was made at this one."""
        self.candidates.pop(link.source.symbol, None)
        self.trials.end(link.source.symbol)
        del link.source.outgoing[self.name]
        del link.target.incoming[self.name]
        self.on_target(link.target, max(valid_us, link.since_us + 1))
        self._ports.on_unlinked(valid_us, link, reason)

    def may_rename(self, one: LinkObject, named: Collection[str]) -> bool:
        """Whether an object of A could be one that is wanted: not excluded, and not linked to one that was wanted."""
        link = one.outgoing.get(self.name)
        return one.symbol in self.unlinked if link is None else link.target.symbol not in named

    # Decisions at a tick

    def update(self, valid_us: int, sources: Collection[LinkObject]) -> None:
        """Take the states of all objects of A that have one at `valid_us` and are linked."""
        self.evaluations = 0
        moved_over = self._weigh(valid_us, sources) if self.candidates else ()
        self._reach.on_states(valid_us, (one.state for one in sources if one.prediction is None))
        for one in sources:
            link = None if one.symbol in moved_over else one.outgoing.get(self.name)
            if link is not None and not self._take_back(valid_us, link):
                self._update(valid_us, link)

    def decide(self, valid_us: int, sources: Iterable[LinkObject]) -> None:
        """Take those of the others, which may be linked."""
        unlinked = []
        for one in sources:
            waiting = self.unlinked.get(one.symbol)
            if waiting is not None and waiting.from_us <= valid_us and self.name not in one.outgoing:
                unlinked.append((one, waiting))
        if unlinked:
            self._decide(valid_us, unlinked)
        if self.candidates:
            self._drop_taken()

    def estimate(self, one: LinkObject) -> ObjectState:
        """The state of the object of B that an object of A is, or would be if it became one now."""
        if (link := one.outgoing.get(self.name)) is not None:
            return link.target.state
        waiting = self.unlinked[one.symbol]
        before, state = waiting.estimate, one.state
        if before is None:
            waiting.estimate = self._first(one)
        elif before.valid_us < state.valid_us:
            waiting.estimate = self.specification.unit(state, self.specification.later(before, state.valid_us))
        return waiting.estimate or state

    def _take_back(self, valid_us: int, link: ObjectLink) -> bool:
        """Whether its source has just shown that it is another than the target, so that the link is removed."""
        if (trial := self.trials.failed(valid_us, link)) is None:
            return False
        target = link.target
        self.unlink(valid_us, link, LinkReason("another"))
        target.go_back(trial.before)
        waiting = trial.again(valid_us + 1, target.symbol, self.available[target.symbol][1])
        self.unlinked[link.source.symbol] = waiting
        return True

    def _update(self, valid_us: int, link: ObjectLink) -> None:
        """The state of B, and whether the hypothesis still holds with it."""
        source, target = link.source, link.target
        if source.prediction is not None:
            self._expect(valid_us, source, target)
            state = target.state
        else:
            state = self._computed(valid_us, link)
        if link.maintain is not None:
            self.evaluations += 1
            self._maintain.step(link.maintain, valid_us, source.state, certain(state), _ends(source, target))
            if link.maintain.verdict == "false" and (candidates := self.candidates.get(source.symbol)) is not None:
                candidates.lower()
                link.maintain = self._maintain.start()
            elif link.maintain.verdict == "false":
                reason = LinkReason("maintain", self._maintain.formula, link.maintain.explain())
                self.unlink(valid_us, link, reason)
                return
            if link.maintain.verdict == "true":
                link.maintain = None
        if source.prediction is None:
            target.observe(state, is_sure=source.symbol not in self.candidates)

    def _weigh(self, valid_us: int, sources: Iterable[LinkObject]) -> Collection[str]:
        """Weigh the candidates of all links that are not certain, and assign them again; the objects of A that go over."""
        self._drop_taken()
        shown = {one.symbol: one for one in sources if one.prediction is None and one.symbol in self.candidates}
        for symbol, one in shown.items():
            self.candidates[symbol].on_state(valid_us, one.state, self.specification.later)
        moving = reassigned(self.candidates, shown)
        self._go_over(valid_us, moving)
        self._drop_taken()
        return moving

    def _drop_taken(self) -> None:
        """Drop candidates that are gone, or that another percept certainly shows; a single remaining one is certain."""
        is_new = True
        while is_new:
            held, is_new = {each.chosen for each in self.candidates.values()}, False
            for symbol, candidates in list(self.candidates.items()):
                for other in candidates.others():
                    if other not in self.available and other not in held:
                        candidates.drop(other)
                candidates.of(candidates.chosen).target.incoming[self.name].weight = candidates.weight
                if candidates.is_decided:
                    del self.candidates[symbol]
                    is_new = True

    def _go_over(self, valid_us: int, moving: Mapping[str, str]) -> None:
        """Link percepts to others of their candidates; the objects before are as if they had never been it."""
        left: list[tuple[LinkObject, LinkCandidates, LinkCandidate]] = []
        for symbol, target in moving.items():
            candidates = self.candidates[symbol]
            before, to = candidates.of(candidates.chosen), candidates.of(target)
            left.append((before.target.incoming[self.name].source, candidates, to))
            self.unlink(valid_us, before.target.incoming[self.name], LinkReason("weighed"))
            before.target.go_back(before.before)
        for source, candidates, to in left:
            candidates.go_over(to)
            self._link(valid_us, "reestablished", source, to.target, LinkReason("weighed"), to.weight, candidates)
            if self.specification.is_recursive:
                to.target.state = to.target.observed[-1] = to.state

    def _expect(self, valid_us: int, source: LinkObject, target: LinkObject) -> None:
        """Predict the objects above a predicted object with it."""
        if target.state.valid_us != valid_us and source.prediction is not None:
            attributes = target.state.attributes
            target.expect(source.prediction.described(attributes))

    def _computed(self, valid_us: int, link: ObjectLink) -> ObjectState:
        """The state that the unit makes of the source's, weighed with those of other live links."""
        specification, target = self.specification, link.target
        others = [other for other in target.incoming.values() if other is not link and other.state is not None]
        if link.state is None or not (others or specification.correlated):
            prior = self._prior(valid_us, link.source.state, target)
        else:
            prior = specification.later(link.state, valid_us)
        state = specification.unit(link.source.state, prior)
        if specification.is_recursive and not specification.correlated:
            return state
        link.state = state
        for other in others:
            fused = intersected if specification.correlated or other.process.specification.correlated else weighed
            state = fused(specification.later(other.state or state, valid_us), state)
        return state

    def _prior(self, valid_us: int, state: ObjectState, target: LinkObject) -> ObjectState | None:
        """The target's state before this one is taken in: of several hypotheses the one that it confirms."""
        if not target.observed:
            return None
        if target.prediction is None:
            return self.specification.later(target.state, valid_us)
        return self._ports.expected(target, valid_us).nearest(state)

    def _decide(self, valid_us: int, unlinked: list[tuple[LinkObject, Unlinked]]) -> None:
        """Progress the conditions of all unlinked objects, then link those for which one became true."""
        scores: dict[tuple[str, str], float] = {}
        held: dict[tuple[str, str], Progressing] = {}
        known: dict[str, dict[str, ObjectPrediction]] = {}
        sources: dict[str, LinkObject] = {}
        new: list[tuple[LinkObject, Progressing]] = []
        held_open = open_links(self.candidates.values(), self.name)
        near = self._near(valid_us, held_open, unlinked)
        gate = self._reestablish.gate
        for one, waiting in unlinked:
            if gate is not None:
                waiting.on_state(valid_us, gate.window_us)
            if (establish := waiting.establish) is not None:
                self.evaluations += 1
                if establish.verdict == "undecided":
                    self._establish.step(establish, valid_us, one.state, ends=Ends(one.symbol))
                if establish.verdict == "true":
                    new.append((one, establish))
                elif establish.verdict == "false":
                    waiting.establish = None
            for target, whereabouts in near.of(one.state, waiting.pairs):
                since_us = held_open[target].link.since_us if target in held_open else self.available[target][1]
                evaluation = self._progressed(valid_us, one, waiting, target, whereabouts, since_us)
                if evaluation is not None and evaluation.verdict == "true":
                    scores[one.symbol, target] = self._reach.score(one.state, whereabouts)
                    held[one.symbol, target] = evaluation
                    known.setdefault(one.symbol, {})[target] = whereabouts
                    sources[one.symbol] = one
        chosen = assigned_with(scores, held_open.values(), self.available, self._reach.alone)
        before = known_before(held_open, self.available, {target for _, target in scores})
        moving = {name: target for name, target in chosen.items() if name not in sources}
        self._go_over(valid_us, {name: to for name, to in moving.items() if to != self.candidates[name].chosen})
        for source, target in ((name, to) for name, to in chosen.items() if name in sources):
            reason = LinkReason("reestablish", self._reestablish.formula, held[source, target].explain())
            weights = self.specification.weigh(sources[source].state, known[source])
            candidates = self._candidates(sources[source], target, known[source], before, weights)
            one, weight, waiting = self.available[target][0], weights.get(target, 0.0), self.unlinked[source]
            link = self._link(valid_us, "reestablished", sources[source], one, reason, weight, candidates)
            if candidates is None and self.name in sources[source].outgoing:
                expected = known[source][target].nearest(sources[source].state)
                self.trials.begin(waiting, link, before[target][1], expected, scores[source, target])
        for one, establish in new:
            if one.symbol not in chosen:
                reason = LinkReason("establish", self._establish.formula, establish.explain())
                created = self._ports.create(valid_us, self.specification.target, self._first(one))
                created.seen_us = valid_us - one.created_us
                self._link(valid_us, "established", one, created, reason)

    def _candidates(
        self,
        source: LinkObject,
        target: str,
        known: Mapping[str, ObjectPrediction],
        before: Mapping[str, tuple[LinkObject, LastSeen]],
        weights: Mapping[str, float],
    ) -> LinkCandidates | None:
        """The objects that a percept may be besides the assigned one; None: the assigned one is certain."""
        others = sorted(known.keys() - {target}, key=lambda symbol: (-weights.get(symbol, 0.0), natural(symbol)))
        made: dict[str, LinkCandidate] = {}
        for symbol in (target, *others[: self.specification.candidates - 1]):
            track = filtered(source.state, known[symbol].nearest(source.state))
            one, last_seen = before[symbol]
            made[symbol] = LinkCandidate(one, weights.get(symbol, 0.0), track, last_seen)
        found = LinkCandidates(target, made)
        return None if found.is_decided else found

    def _first(self, source: LinkObject) -> ObjectState:
        """The state of a new object: from all states of its source so far."""
        unit, later = self.specification.unit, self.specification.later
        states = [*source.observed]
        if source.prediction is not None:
            states.append(source.state)
        state = unit(states[0], None)
        for each in states[1:]:
            state = unit(each, later(state, each.valid_us))
        return state

    def _near(
        self, valid_us: int, open_links: Mapping[str, OpenLink], unlinked: Iterable[tuple[LinkObject, Unlinked]]
    ) -> NearObjects:
        """The objects that are available, or may be claimed, where they are expected now."""
        expected = dict(self._expected(valid_us, open_links))
        gate = self._reach.gate(self._reestablish, (one.state for one, _ in unlinked), expected)
        return NearObjects(
            expected,
            None if gate is None else gate.bound_m,
            gate is not None and gate.keeps_all,
        )

    def _expected(self, valid_us: int, open_links: Mapping[str, OpenLink]) -> Iterator[tuple[str, ObjectPrediction]]:
        available = (symbol for symbol, (_, since_us) in self.available.items() if since_us <= valid_us)
        for symbol in sorted((*available, *open_links), key=natural):
            one = open_links[symbol].expected if symbol in open_links else self.available[symbol][0]
            yield symbol, self._ports.expected(one, valid_us)

    def _progressed(
        self,
        valid_us: int,
        one: LinkObject,
        waiting: Unlinked,
        target: str,
        whereabouts: ObjectPrediction,
        available_us: int,
    ) -> Progressing | None:
        """One reestablish condition after this state; None if it has ended."""
        pair = waiting.pairs.get(target)
        if pair is None or pair.available_us != available_us:
            pair = waiting.pairs[target] = ReestablishPair(available_us, self._begun(valid_us, waiting, available_us))
        evaluation = pair.evaluation
        if evaluation is None:
            return None
        self.evaluations += 1
        if evaluation.verdict == "undecided":
            self._reestablish.step(evaluation, valid_us, one.state, whereabouts, Ends(one.symbol, target))
        if evaluation.verdict == "false":
            waiting.pairs[target] = ReestablishPair(available_us, None)
            return None
        return evaluation

    def _begun(self, valid_us: int, waiting: Unlinked, available_us: int) -> Progressing | None:
        """A condition whose states until now were all far ones."""
        evaluation = self._reestablish.start()
        if self._reestablish.gate is not None:
            start_us = waiting.start_us(available_us)
            if start_us is None:
                return None
            if start_us < valid_us:
                self._reestablish.pass_by(evaluation, start_us)
        return evaluation

    def anchor(self, valid_us: int, source: LinkObject, symbol: str, reason: LinkReason) -> None:
        """Link an unlinked object of A to a wanted object of B, which it is found to be."""
        created = self._ports.create(valid_us, self.specification.target, self._first(source), symbol)
        self._link(valid_us, "reestablished", source, created, reason)

    def _link(
        self,
        valid_us: int,
        kind: EventKind,
        source: LinkObject,
        target: LinkObject,
        reason: LinkReason,
        weight: float = 1.0,
        candidates: LinkCandidates | None = None,
    ) -> ObjectLink:
        link = ObjectLink(self, source, target, valid_us)
        if candidates is not None:
            self.candidates[source.symbol], link.weight = candidates, candidates.weight
        if not target.observed:
            target.observe(target.state)
        elif source.prediction is None:
            target.observe(self._computed(valid_us, link), is_sure=candidates is None)
        else:
            self._expect(valid_us, source, target)
        source.outgoing[self.name] = target.incoming[self.name] = link
        self.drop_source(source.symbol)
        self.available.pop(target.symbol, None)
        self._ports.on_linked(valid_us, kind, link, reason, weight)
        if self._maintain.is_trivial:
            return link
        link.maintain = self._maintain.start()
        self._maintain.step(link.maintain, valid_us, source.state, certain(target.state), _ends(source, target))
        if link.maintain.verdict == "false":
            self.unlink(valid_us, link, LinkReason("maintain", self._maintain.formula, link.maintain.explain()))
        return link


def _ends(source: LinkObject, target: LinkObject) -> Ends:
    return Ends(source.symbol, target.symbol)


def updated(objects: Iterable[LinkObject], valid_us: int) -> list[LinkObject]:
    """Those with a state at this time, in the order of their symbols."""
    return sorted((one for one in objects if one.state.valid_us == valid_us), key=lambda one: natural(one.symbol))
