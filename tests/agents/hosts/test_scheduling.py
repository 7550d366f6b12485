"""When a host lets its processes work, against what the thesis says of it (5.3)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from dyknow.agents.hosts.scheduling import Scheduler

PROCESSES = st.integers(0, 4)
puts = st.lists(PROCESSES, max_size=60)
priorities = st.lists(st.integers(-2, 2), min_size=5, max_size=5)


def filled(
    given_priorities: list[int], arrivals: list[int], batch: int = 1, *, train: bool = False
) -> Scheduler[int, int]:
    scheduler: Scheduler[int, int] = Scheduler(batch, train=train)
    for process, priority in enumerate(given_priorities):
        scheduler.add(process, priority)
    for number, process in enumerate(arrivals):
        scheduler.put(process, number)
    return scheduler


def drained(scheduler: Scheduler[int, int]) -> list[tuple[int, int]]:
    found = []
    while (turn := scheduler.next()) is not None:
        found.append(turn)
    return found


@given(priorities, puts)
def test_higher_priorities_go_first_and_equals_in_the_order_of_arrival(given_priorities, arrivals) -> None:
    turns = drained(filled(given_priorities, arrivals))
    assert turns == sorted(
        ((p, n) for n, p in enumerate(arrivals)), key=lambda turn: (-given_priorities[turn[0]], turn[1])
    )


@given(priorities, puts, st.integers(1, 7))
def test_a_process_works_when_a_batch_waits_and_then_on_all_of_it(given_priorities, arrivals, batch) -> None:
    turns = drained(filled(given_priorities, arrivals, batch))
    for process in range(5):
        mine = [number for number, each in enumerate(arrivals) if each == process]
        assert [number for each, number in turns if each == process] == mine[: len(mine) // batch * batch]
    for begins in range(0, len(turns), batch):
        assert len({process for process, _ in turns[begins : begins + batch]}) == 1


@given(priorities, puts, st.integers(1, 4))
def test_with_trains_each_item_passes_the_whole_chain_before_the_next_begins(given_priorities, arrivals, batch) -> None:
    """0 is followed by 1 and 2, 1 by 3: depth first, whatever the priorities."""
    follows = {0: (1, 2), 1: (3,)}
    heads = [0 if process < 3 else 4 for process in arrivals]
    scheduler = filled(given_priorities, heads, batch, train=True)
    turns = []
    while (turn := scheduler.next()) is not None:
        turns.append(turn)
        scheduler.follow((follower, turn[1]) for follower in follows.get(turn[0], ()))
    chains = [turn for turn in turns if turn[0] == 0]
    for head in chains:
        at = turns.index(head)
        assert turns[at : at + 4] == [(process, head[1]) for process in (0, 1, 3, 2)]
    assert len(turns) == 4 * len(chains) + sum(1 for process, _ in turns if process == 4)


def test_without_trains_what_follows_waits_for_its_turn_like_everything_else() -> None:
    scheduler = filled([0, 0], [0, 0])
    assert scheduler.next() == (0, 0)
    scheduler.follow([(1, 0)])
    assert drained(scheduler) == [(0, 1), (1, 0)]


def test_the_newest_wait_and_what_gave_way_is_counted() -> None:
    scheduler: Scheduler[str, int] = Scheduler(bound=2)
    scheduler.add("slow")
    for number in range(5):
        scheduler.put("slow", number)
    assert [scheduler.next(), scheduler.next(), scheduler.next()] == [("slow", 3), ("slow", 4), None]
    assert scheduler.dropped == 3


def test_an_action_goes_on_without_a_process_that_went() -> None:
    scheduler = filled([0, 0], [0, 0, 1, 1], 2)
    assert scheduler.next() == (0, 0)
    assert scheduler.acting
    scheduler.remove(0)
    assert not scheduler.acting
    assert drained(scheduler) == [(1, 2), (1, 3)]


@pytest.mark.parametrize("batch", [0, -1, 11])
def test_a_batch_is_at_least_one_and_at_most_what_can_wait(batch: int) -> None:
    with pytest.raises(ValueError, match="expected 1 to 10 samples"):
        Scheduler(batch, bound=10)


class Scheduling(RuleBasedStateMachine):
    """Against a list of all that waits, searched from the beginning each time."""

    def __init__(self) -> None:
        super().__init__()
        self.scheduler: Scheduler[int, int] = Scheduler(2)
        self.priorities: dict[int, int] = {}
        self.waiting: list[tuple[int, int]] = []
        self.action: list[tuple[int, int]] = []
        self.number = 0

    @rule(process=PROCESSES, priority=st.integers(-1, 1))
    def add(self, process: int, priority: int) -> None:
        self.remove(process)
        self.scheduler.add(process, priority)
        self.priorities[process] = priority

    @rule(process=PROCESSES)
    def remove(self, process: int) -> None:
        self.scheduler.remove(process)
        self.priorities.pop(process, None)
        self.waiting = [each for each in self.waiting if each[0] != process]
        self.action = [each for each in self.action if each[0] != process]

    @rule(process=PROCESSES)
    def put(self, process: int) -> None:
        self.number += 1
        self.scheduler.put(process, self.number)
        if process in self.priorities:
            self.waiting.append((process, self.number))

    @precondition(lambda self: self.waiting or self.action)
    @rule()
    def turn(self) -> None:
        if not self.action:
            ready = [p for p in self.priorities if sum(each[0] == p for each in self.waiting) >= 2]
            if ready:
                highest = max(self.priorities[p] for p in ready)
                first = next(
                    each[0] for each in self.waiting if each[0] in ready and self.priorities[each[0]] == highest
                )
                self.action = [each for each in self.waiting if each[0] == first][:2]
                self.waiting = [each for each in self.waiting if each not in self.action]
        assert self.scheduler.next() == (self.action.pop(0) if self.action else None)

    @invariant()
    def nothing_is_lost(self) -> None:
        assert len(self.scheduler) == len(self.waiting) + len(self.action)


TestScheduling = Scheduling.TestCase
