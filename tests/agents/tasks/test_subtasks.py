"""The small parts: buckets, deadlines, tasks, readings, and formulas under check."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.admission.limits import ActLimits, TokenBucket
from agents.exchange.readings import merge_inverse_variance, merge_mean, select_best, select_newest
from agents.monitoring.checks import Checks
from agents.platform import Platform
from agents.tasks.life import TOMBSTONES
from agents.tasks.task import Claim, Task
from dyknow.model.errors import Refused
from federation.members.deadlines import Deadlines
from federation.messages.acts import Performative
from federation.messages.contents import CheckFormula, Reading, Verdict
from tests.agents.wire import Wire

P = Performative
MOMENTS = st.lists(st.integers(0, 2_000_000), max_size=200).map(sorted)


@given(MOMENTS)
def test_a_bucket_never_gives_more_than_its_burst_and_its_rate(moments: list[int]) -> None:
    bucket = TokenBucket(20.0, 5.0, 5.0)
    given_at = [at_us for at_us in moments if bucket.take(at_us)]
    for first in range(len(given_at)):
        for last in range(first, len(given_at)):
            assert last - first + 1 <= 5 + 20.0 * (given_at[last] - given_at[first]) / 1e6 + 1e-6


def test_names_cost_no_memory_and_the_busy_are_not_forgotten() -> None:
    limits = ActLimits(20.0, 3.0, peers=4)
    assert [limits.admit("busy", 0) for _ in range(4)] == [True, True, True, False]
    for at in range(3):
        limits.admit(f"n{at}", 0)
    assert not limits.admit("busy", 0)
    for at in range(100):
        limits.admit(f"m{at}", 0)
    assert len(limits._buckets) == 4


@given(st.lists(st.tuples(st.sampled_from("abcde"), st.none() | st.integers(0, 50)), max_size=60), st.integers(0, 60))
def test_deadlines_are_what_was_set_last(steps: list[tuple[str, int | None]], now_us: int) -> None:
    deadlines: Deadlines[str] = Deadlines()
    known: dict[str, int] = {}
    for key, due_us in steps:
        deadlines.set(key, due_us)
        known.pop(key, None)
        if due_us is not None:
            known[key] = due_us
        assert deadlines.next_us == min(known.values(), default=None)
    due = deadlines.pop_due(now_us)
    assert set(due) == {key for key, due_us in known.items() if due_us <= now_us}
    assert [known[key] for key in due] == sorted(known[key] for key in due)
    assert deadlines.pop_due(now_us) == []


def test_a_life_of_tasks_remembers_whose_task_ended_and_forgets_in_the_end(wire: Wire, node: Platform) -> None:
    life, ended = node.ports.tasks, []

    def take_down(now_us: int) -> tuple[str, ...]:
        ended.append(now_us)
        return ("larger",)

    life.add(Task("c", "1", "create-monitor", take_down))
    assert life.cancel("c", 5) == ("larger",)
    assert life.cancel("c", 6) == (), "cancelling twice is harmless"
    assert life.cancel("d", 7) is None
    assert ended == [5]
    with pytest.raises(Refused, match="cancelled") as refused:
        life.check_claim(Claim("c", "2", 0, 1, "", ""))
    assert refused.value.code == "cancelled"
    life.check_claim(Claim("c", "1", 0, 1, "", ""))  # it ended on its behalf, so it may set it up again
    for at in range(TOMBSTONES):
        life.bury(f"t{at}", "1")
    life.check_claim(Claim("c", "2", 0, 1, "", ""))


def reading(valid_us: int, value: float, variance: float | None = None) -> Reading:
    stated = None if variance is None else {"altitude_m": variance}
    return Reading(valid_us=valid_us, available_us=valid_us + 1, value={"altitude_m": value}, variance=stated)


def test_readings_are_selected_and_merged_as_their_names_say() -> None:
    found = [reading(3, 10.0, 4.0), reading(5, 20.0, 1.0), reading(9, 90.0)]
    assert select_newest(found) == found[2]
    assert select_best(found) == found[1]
    mean, weighed = merge_mean(found), merge_inverse_variance(found)
    assert mean is not None
    assert weighed is not None
    assert mean.value == {"altitude_m": 40.0}
    assert weighed.value == {"altitude_m": 18.0}, "(10/4 + 20) / (1/4 + 1); one without a variance is left out"
    assert weighed.variance == {"altitude_m": pytest.approx(0.8)}
    assert mean.valid_us == 9
    assert [f([]) for f in (select_newest, select_best, merge_mean, merge_inverse_variance)] == [None] * 4


def test_a_formula_is_checked_until_it_is_decided(wire: Wire, node: Platform) -> None:
    wire.run(1.0)
    question = wire.ask("cc", "0", CheckFormula(text="eventually[0s, 2s] altitude[self] > 1000.0", timeout_s=9.0))
    wire.run(4.0)
    assert question.performatives == [P.AGREE, P.INFORM]
    (said,) = [c for c in question.contents if isinstance(c, Verdict)]
    assert (said.verdict, said.index is not None) == ("false", True)
    (because,) = said.because
    assert (because.part, because.holds) == ("altitude[0] > 1000.0", False)
    assert because.samples.keys() == {"altitude[0]"}
    assert because.until_us - because.since_us == 2_000_000
    assert node.part(Checks)._open == {}


def test_an_undecided_formula_names_what_never_had_a_value(wire: Wire, node: Platform) -> None:
    """A vehicle that has reported where it is, and not how full its battery is."""
    wire.run(1.0)
    text = "always (battery[self] > 0.0 and altitude[self] > 0.0)"
    question = wire.ask("cc", "0", CheckFormula(text=text, timeout_s=1.0))
    wire.run(2.0)
    (said,) = [c for c in question.contents if isinstance(c, Verdict)]
    assert (said.verdict, said.index) == ("undecided", None)
    assert said.no_value == ("battery[0]",)
    assert said.missing == ("battery[0]",)


def test_a_formula_about_a_stream_that_is_not_there_is_refused_and_leaves_nothing(wire: Wire, node: Platform) -> None:
    question = wire.asked("cc", "0", CheckFormula(text="always xy_dist[self, 1] > 5.0"))
    assert question.performatives == [P.REFUSE]
    assert node.part(Checks)._open == {}
    assert node.part(Checks).deadline_us is None
    wire.run(3.0)


def test_who_does_not_want_to_know_any_more_cancels_the_check(wire: Wire, node: Platform) -> None:
    wire.run(1.0)
    question = wire.asked("cc", "0", CheckFormula(text="always altitude[self] > 0.0", timeout_s=60.0))
    assert len(node.part(Checks)._open) == 1
    wire.cancel("cc", "0", question.conversation)
    wire.run(0.5)
    assert node.part(Checks)._open == {}
    assert node.ports.agent.conversations.conversations() == []
