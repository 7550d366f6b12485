"""One wanted object that is anchored, or looked at again until it is: the five steps of "Have another look" on a platform.

It is a value, stepped five times a second. Percepts are remembered; an ambiguous situation becomes a plan of
`planning/ambiguity`, whose moves the vehicle flies and whose looks the camera makes. A look is answered by a property
that percepts had since it began, or by none, if they had none while the object or its place was in view. A look that
shows neither is not answered, so that its time runs out and a plan is made without it.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from itertools import islice
from math import hypot
from typing import Final, Protocol

from dyknow import US_PER_S
from dyknow.agents.capabilities.anchors.looks import SHARE, PlannedLook
from dyknow.agents.capabilities.anchors.observed_objects import ObjectPlace, ObservedObjects
from dyknow.agents.capabilities.anchors.viewpoints import Viewpoint, Viewpoints, grid, nearest, ring
from dyknow.anchoring.links.structures import ObjectLinkage
from dyknow.anchoring.matching.candidates import ObservationGates, PerceptProperties
from dyknow.anchoring.matching.descriptions import ObjectDescription
from dyknow.anchoring.matching.situations import AnchoringSituation, MatchingOptions, classify
from dyknow.planning.ambiguity import recovery_messages as messages
from dyknow.planning.ambiguity.anchoring_recovery import AnchoringRecovery, RecoveryLimits, RecoveryPhase
from dyknow.planning.ambiguity.hypotheses import LookingKnowledge
from dyknow.planning.contingent.conditional_plans import ConditionalPlan, print_plan
from dyknow.planning.contingent.sensing_problems import SensingProblem

FIND_US: Final = 4 * US_PER_S
"""Percepts are gathered for so long before a Find, and after a loss before a Reacquire."""
AGAIN_US: Final = US_PER_S
"""While nothing is flown, what comes into view is matched so often."""
MOST_CANDIDATES: Final = 4
"""Partially matching objects that one plan decides between."""
MOST_RECOVERIES: Final = 4
"""Most flights for one object in `BUDGET_US`: an object that is lost and found on purpose wears out no vehicle."""
BUDGET_US: Final = 600 * US_PER_S
KEPT: Final = 24
"""Most lines of the history."""
LONG_GAP_US: Final = US_PER_S
LIMITS: Final = RecoveryLimits(at_once=9, answer_us=120 * US_PER_S, look_us=12 * US_PER_S)
"""Plans over more hypotheses may take longer than 5 ms."""
HERE: Final = "here"
LOOKED, ANSWERED = "it was looked at again", "the delegator answered"
PLACE: Final = ("x_m", "y_m")
"""The property to ask for where nothing else differs."""


class RecoveryPorts(Protocol):
    """Interface of a recovery to its platform. Times are the node clock unless they are named otherwise."""

    def anchor(self, symbol: str | None, now_us: int) -> str: ...
    def fly(self, number: int, place: Viewpoint, why: str, now_us: int) -> str: ...
    def stare(self, place: Viewpoint, symbol: str) -> None: ...
    def leave(self, now_us: int) -> None: ...
    def plan(self, number: int, problem: SensingProblem) -> None: ...
    def say(self, kind: str, text: str, now_us: int) -> None: ...
    def own(self) -> Viewpoint | None: ...
    def view_m(self) -> float: ...
    def shows(self, x_m: float, y_m: float, since_us: int) -> bool: ...
    def forbidden(self, place: Viewpoint) -> str: ...

    @property
    def waits(self) -> str: ...


class LookingAgain:
    """See the module. Times are federation time, but for `now_us`, the node clock.

    Args:
        symbol: the name of the wanted object.
        within_m: around where it was, or the vehicle is, it is searched for.
        standoff_m: candidates are looked at from so far.

    Attributes:
        state: for lists, in words.
        history: the last lines: time, kind and text.
        question: the values between which the delegator is to choose.
    """

    def __init__(
        self,
        symbol: str,
        type_: str,
        description: ObjectDescription,
        ports: RecoveryPorts,
        begun_us: int,
        *,
        is_cautious: bool = False,
        within_m: float = 60.0,
        standoff_m: float = 25.0,
    ) -> None:
        self.symbol, self._description, self._ports = symbol, description, ports
        self._is_cautious, self._within_m, self._standoff_m = is_cautious, within_m, standoff_m
        self._objects = ObservedObjects(type_)
        self.state, self.since_us = f"looks for {symbol}", begun_us
        self.history: deque[tuple[int, str, str]] = deque(maxlen=KEPT)
        self.question: tuple[str, ...] = ()
        self.asked, self._because = "", LOOKED
        self.questions = 0
        self.plans = 0
        self.recovery: AnchoringRecovery | None = None
        self.anchored = ""
        self._places: dict[str, Viewpoint] = {}
        self._due_us = begun_us + FIND_US
        self._began: deque[int] = deque(maxlen=MOST_RECOVERIES)
        self._lost_us: int | None = None
        self._last: ObjectPlace | None = None
        self._others: dict[str, int] = {}
        self._is_released = False
        self._look: PlannedLook | None = None
        self._stepped_us = 0
        self._stuck = ""

    # -- stepped -----------------------------------------------------------------------------------------------

    def step(self, linkage: ObjectLinkage, federation_us: int, now_us: int) -> None:
        """Look at what percepts show, and do what is due."""
        self._objects.step(linkage)
        waited_us, self._stepped_us = federation_us - (self._stepped_us or federation_us), federation_us
        if self.anchored:
            self._on_anchored(federation_us, now_us)
        elif self.recovery is not None:
            self._recover(self.recovery, federation_us, waited_us, now_us)
        elif federation_us >= self._due_us:
            self._find(federation_us, now_us)

    def _find(self, federation_us: int, now_us: int) -> None:
        """Steps 1 and 2: Find or Reacquire among what is seen now."""
        self._due_us = federation_us + AGAIN_US
        percepts = self._candidates()
        situation = classify(self._description, percepts, self._options)
        if situation.recovery is None:
            self._anchor(situation.anchors[0].percept, f"case {situation.case}", now_us)
        elif self._stuck != "absent" or situation.case != 1:
            if situation.ask is not None and not situation.ask.name:
                percepts = self._candidates(PLACE)
            self._begin(situation, percepts, federation_us, now_us)

    @property
    def _options(self) -> MatchingOptions:
        functionality = "find" if self._lost_us is None else "reacquire"
        return MatchingOptions(functionality, is_cautious=self._is_cautious, gates=ObservationGates(SHARE))  # type: ignore[arg-type]

    def _candidates(self, names: tuple[str, ...] = ()) -> dict[str, PerceptProperties]:
        """Objects that may be it: seen now, and of those that were seen next to it none; where they are, if that matters."""
        found: dict[str, PerceptProperties] = dict(
            self._objects.percepts(placed=(*names, *self._description.properties))
        )
        for symbol, begins_us in self._others.items():
            if self._objects.begins_us(symbol) == begins_us:
                found.pop(symbol, None)
        return found

    # -- anchored ----------------------------------------------------------------------------------------------

    def _anchor(self, percept: str, why: str, now_us: int) -> None:
        refused = self._ports.anchor(percept, now_us)
        if refused:
            self._say("fails", f"{percept} is not given the symbol: {refused}", now_us)
        else:
            self._objects.renamed(percept, self.symbol)
            self.anchored, self._lost_us, self._stuck = percept, None, ""
            self._say("anchored", f"{self.symbol} is {percept}: {why}", now_us)
        self._end(now_us)

    def on_lost(self, federation_us: int) -> None:
        """Note that no percept shows the object any longer."""
        if self.anchored:
            self._lost_us, self._last = federation_us, self._objects.place(self.symbol)
            seen = [each for each in self._objects.percepts() if each != self.symbol]
            self._others = {each: self._objects.begins_us(each) for each in seen}
            self._objects.forget(self.symbol)
            self._due_us = federation_us + FIND_US

    def on_reacquired(self, federation_us: int) -> None:
        """Note that a percept shows the object again, or another one like it."""
        if self._lost_us is not None and federation_us - self._lost_us >= LONG_GAP_US:
            self._due_us = federation_us + FIND_US

    def _on_anchored(self, federation_us: int, now_us: int) -> None:
        """After a gap: is that which is seen now what was seen before?"""
        if self._lost_us is None or federation_us < self._due_us:
            return
        percepts = self._candidates()
        situation = classify(self._description, percepts, self._options)
        taken = [each.percept for each in situation.anchors]
        if taken == [self.symbol]:
            self._lost_us = None
            self._say("reacquired", f"{self.symbol} is seen again: case {situation.case}", now_us)
            return
        self.anchored = ""
        self._is_released = self._objects.is_seen(self.symbol)
        self._ports.anchor(None, now_us)
        self._due_us = federation_us + US_PER_S
        self._say("lost", f"{self.symbol} is no longer anchored: case {situation.case}, {_reason(situation)}", now_us)

    # -- recovered ---------------------------------------------------------------------------------------------

    def _begin(
        self, situation: AnchoringSituation, percepts: Mapping[str, PerceptProperties], federation_us: int, now_us: int
    ) -> None:
        own = self._ports.own()
        if len(self._began) == MOST_RECOVERIES and federation_us - self._began[0] < BUDGET_US:
            self._hinder(f"{MOST_RECOVERIES} times in {BUDGET_US // US_PER_S // 60} min is enough", now_us)
            return
        if own is None:
            self._hinder("where the vehicle is is not known", now_us)
            return
        kept = self._kept(situation, percepts, own)
        if situation.recovery == "search":
            centre = own if self._last is None else Viewpoint(self._last.x_m, self._last.y_m)
            found, reached_m = grid("p", centre, self._within_m, self._ports.view_m())
            if reached_m < self._within_m - 1.0:
                self._say(
                    "note", f"the search covers {reached_m:.0f} m about its middle, not {self._within_m:.0f}", now_us
                )
            knowledge = self._knowledge(found, own, now_us, is_search=True)
        else:
            knowledge = self._knowledge(self._around(kept, own, "v"), own, now_us, is_search=False)
        if knowledge is None:
            return
        self._began.append(federation_us)
        self.recovery = AnchoringRecovery(self.symbol, self._description, self._options, knowledge, LIMITS)
        self._do(self.recovery.on_event(messages.PerceptsSeen(kept), federation_us), federation_us, now_us)

    def _hinder(self, why: str, now_us: int) -> None:
        if self._stuck != why:
            self._stuck = why
            self._say("waits", f"{self.symbol} is not looked at again: {why}", now_us)

    def _kept(
        self, situation: AnchoringSituation, percepts: Mapping[str, PerceptProperties], own: Viewpoint
    ) -> dict[str, PerceptProperties]:
        """All but the partial matches that are too many, the farthest."""

        def away_m(symbol: str) -> float:
            place = self._objects.place(symbol)
            return 0.0 if place is None else hypot(place.x_m - own.x_m, place.y_m - own.y_m)

        partial = sorted((each.percept for each in situation.matches if each.status == "partial"), key=away_m)
        left = set(partial[MOST_CANDIDATES:])
        return {symbol: each for symbol, each in percepts.items() if symbol not in left}

    def _around(self, percepts: Mapping[str, PerceptProperties], own: Viewpoint, prefix: str) -> Viewpoints:
        matches = classify(self._description, percepts, self._options).matches
        places = [self._objects.place(each.percept) for each in matches if each.status != "none"]
        targets = [Viewpoint(each.x_m, each.y_m) for each in places if each is not None]
        return ring(prefix, targets or [own], own, self._standoff_m)

    def _knowledge(self, found: Viewpoints, own: Viewpoint, now_us: int, *, is_search: bool) -> LookingKnowledge | None:
        """Places that may be flown to, as `planning` takes them; the vehicle is at `here`."""
        reasons = {name: self._ports.forbidden(place) for name, place in found.places.items()}
        self._places = {name: place for name, place in found.places.items() if not reasons[name]}
        if len(self._places) < len(reasons):
            why = next(filter(None, reasons.values()))
            self._say(
                "note", f"{len(reasons) - len(self._places)} of {len(reasons)} places are left out: {why}", now_us
            )
        if not self._places:
            self._hinder("no place may be flown to", now_us)
            return None
        ways = {name: [to for to in found.ways[name] if to in self._places] for name in self._places}
        ways[HERE] = [nearest(self._places, own)] if is_search else list(self._places)
        names = tuple(self._description.properties)
        viewpoints = {} if is_search else dict.fromkeys(names, tuple(self._places))
        return LookingKnowledge(ways, HERE, viewpoints, searched=frozenset([HERE]))

    def _recover(self, recovery: AnchoringRecovery, federation_us: int, waited_us: int, now_us: int) -> None:
        """Step 4: carry out the step of the plan."""
        if self._ports.waits:
            if recovery.deadline_us is not None:
                recovery.deadline_us += waited_us
            self._hinder(self._ports.waits, now_us)
            return
        self._stuck = ""
        if recovery.phase is RecoveryPhase.LOOKING and self._look is not None:
            event = self._seen(recovery, self._look, federation_us, now_us)
            if event is not None:
                self._do(recovery.on_event(event, federation_us), federation_us, now_us)
        elif recovery.phase is RecoveryPhase.FINDING:
            self._do(recovery.on_event(messages.PerceptsSeen(self._candidates()), federation_us), federation_us, now_us)
        if self.recovery is recovery:
            self._do(recovery.on_time(federation_us), federation_us, now_us)

    def _seen(
        self, recovery: AnchoringRecovery, look: PlannedLook, federation_us: int, now_us: int
    ) -> messages.RecoveryEvent | None:
        """The outcome of a look; None: nothing yet."""
        if look.target == self.symbol:
            return self._searched(recovery, look, federation_us, now_us)
        place = self._objects.place(look.target)
        if place is not None and self._objects.is_seen(look.target):
            self._ports.stare(Viewpoint(place.x_m, place.y_m), look.target)
        shown = look.shown(recovery, self._objects, self._ports.shows, federation_us)
        if shown is None:
            return None
        self._say("observed", f"look-at {look.target} from {recovery.knowledge.start} shows {shown}", now_us)
        return messages.FeatureObserved(look.started.number, shown)

    def _searched(
        self, recovery: AnchoringRecovery, look: PlannedLook, federation_us: int, now_us: int
    ) -> messages.RecoveryEvent | None:
        """The outcome of a look at a place of a search: all objects seen there."""
        here = self._places.get(recovery.knowledge.start)
        if here is None or not look.is_searched(here, self._ports.shows, federation_us):
            return None
        percepts = self._candidates()
        situation = classify(self._description, percepts, self._options)
        self._say("observed", f"from {recovery.knowledge.start}: case {situation.case}", now_us)
        if situation.recovery in {"recover", "recover_cautious"}:
            percepts = self._kept(situation, percepts, here)
            around = self._around(percepts, here, f"w{len(self._places)}_")
            places = {name: place for name, place in around.places.items() if not self._ports.forbidden(place)}
            self._places |= places
            recovery.add_viewpoints(tuple(places), self._description.properties)
        return messages.PerceptsSeen(percepts)

    def on_moved(self, number: int, why: str, federation_us: int, now_us: int) -> None:
        """The vehicle is where it was sent, or why not."""
        if self.recovery is not None:
            self._because = LOOKED
            event = messages.SensingActionEnded(number, not why, why)
            self._do(self.recovery.on_event(event, federation_us), federation_us, now_us)

    def on_planned(
        self, number: int, plan: ConditionalPlan | None, reason: str, federation_us: int, now_us: int
    ) -> None:
        """A plan was made elsewhere."""
        if self.recovery is not None:
            event = messages.RecoveryPlanned(number, plan, reason)
            self._do(self.recovery.on_event(event, federation_us), federation_us, now_us)

    def answer(self, value: str, federation_us: int, now_us: int) -> None:
        """The delegator's answer, one of `question`."""
        if self.recovery is not None:
            self.question, self.asked, self._because = (), "", ANSWERED
            self._do(self.recovery.on_event(messages.DelegatorAnswered(value), federation_us), federation_us, now_us)
            if self.recovery is not None:
                self._description = self.recovery.description

    def _do(self, effects: Sequence[messages.RecoveryEffect], federation_us: int, now_us: int) -> None:
        """Perform the effects of the plan's value."""
        for effect in effects:
            match effect:
                case messages.TopPlanHalted(reason):
                    self._say("halted", reason, now_us)
                case messages.RecoveryPlanWanted(number, problem):
                    self._say("plans", f"over {len(problem.hypotheses)} hypotheses, in a worker", now_us)
                    self._ports.plan(number, problem)
                case messages.RecoveryPlanMade():
                    self._on_plan(effect, now_us)
                case messages.SensingActionStarted():
                    self._start(effect, federation_us, now_us)
                case messages.SymbolAnchored(_, percept):
                    self._anchor(percept, self._because, now_us)
                case messages.DelegatorAsked(_, question, ask):
                    self.questions += 1
                    self.question, self.asked = tuple(islice(ask.values, 16)), question
                    self._say("asks", question, now_us)
                case messages.RecoveryFailed(_, reason, is_absent):
                    self._fail(reason, federation_us, now_us, is_absent=is_absent)
                case messages.TopPlanResumed():
                    pass  # the vehicle was given back with the anchor

    def _on_plan(self, made: messages.RecoveryPlanMade, now_us: int) -> None:
        self.plans += 1
        left = f", {made.left_out} left out" if made.left_out else ""
        where = "" if made.level == 1 else f", recovery {made.level} within it"
        text = f"case {made.case}, {made.hypotheses} hypotheses{left}{where}: {' '.join(print_plan(made.plan).split())}"
        self._say("plan", text, now_us)

    def _start(self, started: messages.SensingActionStarted, federation_us: int, now_us: int) -> None:
        action = started.action
        target = action.arguments[0]
        if action.name == "move":
            self._look = None
            refused = self._ports.fly(started.number, self._places[target], f"looks again for {self.symbol}", now_us)
            self._say("flies", f"{action}{f': {refused}' if refused else ''}", now_us)
            if refused:
                self._fail(f"the vehicle cannot be flown: {refused}", federation_us, now_us, is_absent=False)
            return
        self._look = PlannedLook(started, federation_us, self._objects.counts(target))
        place, here = self._objects.place(target), None
        if self.recovery is not None:
            here = self._places.get(self.recovery.knowledge.start)
        if place is not None and target != self.symbol:
            here = Viewpoint(place.x_m, place.y_m)
        if here is not None:
            self._ports.stare(here, target)
        self._say("looks", str(action), now_us)

    def _fail(self, reason: str, federation_us: int, now_us: int, *, is_absent: bool) -> None:
        looked = len(self.recovery.knowledge.searched) if self.recovery is not None else 0
        self._stuck = "absent" if is_absent else reason
        self._due_us = federation_us + (AGAIN_US if is_absent else BUDGET_US // MOST_RECOVERIES)
        text = (
            f"{self.symbol} is not present: {looked} places were looked at" if is_absent else f"{self.symbol}: {reason}"
        )
        self._say("not present" if is_absent else "fails", text, now_us)
        self._end(now_us)

    def _end(self, now_us: int) -> None:
        if self.recovery is not None:
            self.recovery, self._look, self.question, self.asked = None, None, (), ""
            self._ports.leave(now_us)

    def end(self, now_us: int) -> None:
        """End the recovery: the object is no longer wanted."""
        self._end(now_us)

    def _say(self, kind: str, text: str, now_us: int) -> None:
        self.state = f"{kind}: {text}"
        self.history.append((self._stepped_us or self.since_us, kind, text))
        self._ports.say(kind, text, now_us)


def _reason(situation: AnchoringSituation) -> str:
    return next(iter(situation.reasons()), "")
