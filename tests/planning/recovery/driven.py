"""A mission that a test drives by hand: searches are answered at once, states are as the test says."""

from itertools import count
from typing import Any

from dyknow.planning import Declarations, PlanFound, find_plan, parse_domain, parse_problem
from dyknow.planning.execution import events
from dyknow.planning.recovery.mission import Mission
from dyknow.planning.recovery.options import MissionOptions

SECOND = 1_000_000
COURIERS = """
#domain courier
#domain letter
#units courier
#feature has(courier, letter) : boolean
#feature done(letter) : boolean
#feature at-work(courier) : boolean
#feature strength(courier) : fp = 3
#feature place(letter) : fp
#feature open : boolean = true
#operator fetch(courier, letter)
  :timeconstraint monitored 0 <= end - start <= 10s
  :precond [start] !done(letter) & !exists courier2: has(courier2, letter)
  :precond [start] !exists courier2, letter2: at-work(courier2) & letter2 == letter & courier2 == courier
  :precond monitored [start] strength(courier) >= 1
  :effects [start] at-work(courier), [end] !at-work(courier)
  :effects monitored [end] has(courier, letter)
  :recovery weaker
#operator bring(courier, letter)
  :timeconstraint 0 <= end - start <= 20s
  :precond [start] has(courier, letter) & open
  :prevail monitored [start, end] has(courier, letter)
  :recovery look
  :effects [end] done(letter), [end] !has(courier, letter)
#monitor strong: always forall courier: strength(courier) >= 0 :recovery stop
#recovery weaker(courier) :act brake :assume strength(courier) := strength(courier) - 1 :times 2 drop-goal
#recovery look(courier, letter) :assume !has(courier, letter) :locate place(letter) :times 1 ask
#recovery stop(courier) :act land :without courier :times 1 give-up
#recovery replan :assume forall courier: at-work(courier) -> !at-work(courier)
"""
OBJECTS = "#objects courier = {k1, k2} #objects letter = {l1, l2} #init place(l1) := 1, place(l2) := 2\n"
GOALS = "#goal one: done(l1) :weight 5 :deadline 300s\n#goal two: done(l2) :weight 1"


class Driven:
    """A mission with what it has returned so far.

    Attributes:
        values: what the next state shows.
        taken: effects, oldest first; `take()` empties them.
    """

    def __init__(self, problem: str = OBJECTS + GOALS, domain: str = COURIERS, **options: int) -> None:
        declared = parse_domain(domain)
        self.problem = parse_problem(problem, declared)
        self.mission = Mission("m", declared, self.problem, MissionOptions(**options))  # type: ignore[arg-type] # times
        self.now_us = 100 * SECOND
        self.values: dict[str, Any] = {}
        self.taken: list[Any] = []
        self.searches: list[events.SearchPlan] = []
        self.answers = True
        self._perform(self.mission.start(self.now_us))

    def _perform(self, effects: list[Any]) -> None:
        for effect in effects:
            self.taken.append(effect)
            if isinstance(effect, events.SearchPlan):
                self.searches.append(effect)
                if self.answers:
                    self.answer_search()

    def answer_search(self) -> None:
        one = self.searches[-1]
        polls = count()
        found = find_plan(one.domain, one.problem, stop=lambda: "enough" if next(polls) > 30 else "", units=one.units)
        is_found = isinstance(found, PlanFound)
        plan = found.plan if isinstance(found, PlanFound) else None
        self.send(events.PlanSearched(one.search, plan, "" if is_found else "none", is_certain=True))

    def send(self, event: Any, after_us: int = 0) -> None:
        self.now_us += after_us
        self._perform(self.mission.on_event(event, self.now_us))

    def state(self, after_us: int = 200_000, /, **values: Any) -> None:
        """A state a moment later; values are those of before with these."""
        self.now_us += after_us
        self.values |= values
        self._perform(self.mission.on_event(events.StateSampled(self.now_us, dict(self.values)), self.now_us))

    def wait(self, us: int) -> None:
        """Let time pass, deadline by deadline."""
        until_us = self.now_us + us
        while (due_us := self.mission.deadline_us) is not None and due_us <= until_us:
            self.now_us = max(due_us, self.now_us + 1)
            self._perform(self.mission.on_time(self.now_us))
        self.now_us = until_us

    def take(self, kind: type | None = None) -> list[Any]:
        """Effects since the last time, of one kind."""
        taken, self.taken = self.taken, []
        return [one for one in taken if kind is None or isinstance(one, kind)]

    def begin(self) -> list[events.StartAction]:
        """States until something starts."""
        for _ in range(4):
            self.state()
            if found := [one for one in self.taken if isinstance(one, events.StartAction)]:
                self.take()
                return found
        return []

    def end(self, step: int, *, succeeded: bool = True, reason: str = "") -> None:
        self.send(events.ActionEnded(step, succeeded, reason), 100_000)

    @property
    def phase(self) -> str:
        return str(self.mission.status.phase)

    def initial(self) -> dict[str, Any]:
        """The initial state of the last search, by label."""
        problem: Declarations = self.searches[-1].problem
        return {
            f"{one.target.name}[{', '.join(arg.name for arg in one.target.args)}]".replace("[]", ""): getattr(  # type: ignore[attr-defined] # names
                one.value, "value", getattr(one.value, "name", None)
            )
            for one in problem.init
        }
