"""Units over joins and over time: one element an instant, and what takes time is available when it has finished."""

from collections import deque
from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from dyknow import Label, Network, Policy, Sample, Sort, computational_unit, value_unit
from dyknow.network.process import Input, Outcome
from dyknow.network.prototypes import UnitPrototype, prototypes_in
from dyknow.network.refinement import LATE_US, MAX_WAITING, SHOWN, SLOW_US, STUCK_US, RefinementProcess

ANY = Sort("", is_open=True)
OFTEN = 20_000


def label(i):
    return Label("n", (str(i),))


def unit(arity, cost_us=None, function=None):
    def step(_now_us, inputs, state):
        values = tuple("none" if each is None else each.value for each in inputs)
        newest = max((each for each in inputs if each is not None), key=lambda each: each.valid_us)
        return newest._replace(value=(values if function is None else function(values))), state

    return UnitPrototype("u", "", ("",) * arity, lambda: step, cost_us=cost_us)


def refine(network, i, prototype, inputs):
    process = RefinementProcess(prototype, [Input(label(one)) for one in inputs])
    network.add_process(label(i), ANY, process)
    return process


def listen(network, i):
    got = []
    network.connect(label(i), Policy(), got.append)
    return got


# One element of the join an instant (Def. 4.3.16)


def test_two_inputs_from_one_source_are_one_element() -> None:
    network = Network()
    network.add_source(label(0), ANY)
    refine(network, 1, unit(2), (0, 0))
    got = listen(network, 1)
    for value in (10, 20):
        network.push(label(0), Sample(value, value, value))
    assert [sample.value for sample in got] == [(10, 10), (20, 20)]


def test_over_a_diamond_of_unequal_branches_no_element_mixes_two_instants() -> None:
    network = Network()
    network.add_source(label(0), ANY)
    refine(network, 4, unit(2, function=max), (0, 3))  # it is there before what it takes
    refine(network, 3, unit(1, function=lambda values: values[0]), (2,))
    refine(network, 2, unit(2, function=max), (0, 1))
    refine(network, 1, unit(1, function=lambda values: values[0]), (0,))
    refine(network, 5, unit(3), (4, 0, 1))
    got = listen(network, 5)
    for value in (1, 2, 3):
        network.push(label(0), Sample(value, value, value))
    assert [sample.value for sample in got] == [(value,) * 3 for value in (1, 2, 3)]


def test_several_pushes_of_one_instant_are_one_element() -> None:
    network = Network()
    for i in (0, 1):
        network.add_source(label(i), ANY)
    refine(network, 2, unit(2), (0, 1))
    got = listen(network, 2)
    with network.instant.whole():
        network.push(label(0), Sample(1, 1, "a"))
        network.push(label(1), Sample(1, 1, "b"))
    network.push(label(0), Sample(2, 2, "c"))
    assert [sample.value for sample in got] == [("a", "b"), ("c", "b")]


@given(
    st.lists(st.tuples(st.integers(-2, 2), st.lists(st.integers(0, 7), min_size=1, max_size=2)), min_size=1, max_size=7)
)
def test_of_units_that_have_what_they_need_the_highest_priority_is_called_first(units) -> None:
    """Thesis 5.3; whatever the priorities, no join meets an instant twice or in halves."""
    network, called = Network(), []
    network.add_source(label(0), ANY)
    takes = {i: [min(one, i - 1) for one in inputs] for i, (_, inputs) in enumerate(units, 1)}
    for i, (priority, _) in enumerate(units, 1):

        def noted(values, i=i):
            called.append(i)
            return max(values)

        refine(network, i, replace(unit(len(takes[i]), 0, noted), priority=priority), takes[i])
        listen(network, i)
    for instant in (1, 2):
        called.clear()
        network.push(label(0), Sample(instant, instant, instant))
        assert sorted(called) == sorted(takes), "each once an instant"
        for at, i in enumerate(called):
            made = {0, *called[:at]}
            ready = [one for one in called[at:] if made.issuperset(takes[one])]
            assert i in ready
            alone = [one for one in ready if len(takes[one]) == 1]
            if any(priority for priority, _ in units) and alone:
                assert units[i - 1][0] >= max(units[one - 1][0] for one in alone)
    assert all(network.generator(label(i)).history.get_latest().value == 2 for i in takes)


def test_a_past_is_joined_as_it_was() -> None:
    network = Network()
    network.add_source(label(0), ANY)
    refine(network, 1, unit(2), (0, 0))
    for value in (1, 2):
        network.push(label(0), Sample(value, value, value))
    assert [sample.value for sample in network.snapshot(label(1)).get_between(0, 9)] == [(1, 1), (2, 2)]


# What takes time (3.2): generated networks, against a model that knows nothing of processes


@st.composite
def costly(draw):
    """(cost, inputs) of each unit; nodes 0 and 1 are sources, every other takes earlier ones."""
    units = []
    for i in range(2, 2 + draw(st.integers(1, 5))):
        inputs = tuple(draw(st.lists(st.integers(0, i - 1), min_size=1, max_size=3)))
        units.append((draw(st.sampled_from([0, 0, 1, 1_000, 7_000, 30_000, 400_000, 1_700_000])), inputs))
    return units


@st.composite
def pushes(draw):
    now_us, found = 0, []
    for _ in range(draw(st.integers(1, 25))):
        now_us += draw(st.integers(1, 60)) * draw(st.sampled_from([1_000, 10_000]))
        found.append((now_us, draw(st.integers(0, 1))))
    return found


class Station:
    """One unit of the model: serves one element after the other; the newest of each input is what counts."""

    def __init__(self, cost_us, inputs):
        self.cost_us, self.inputs = cost_us, inputs
        self.seen = ["none"] * len(inputs)
        self.queue = deque()
        self.done_us = None
        self.made = None

    def arrive(self, now_us, brought):
        self.queue.append((now_us, brought))

    def begin(self, now_us):
        if self.done_us is not None or not self.queue:
            return
        while len(self.queue) > 1 and now_us - self.queue[0][0] > LATE_US:
            _, late = self.queue.popleft()
            self.seen = [late.get(i, one) for i, one in enumerate(self.seen)]
        _, brought = self.queue.popleft()
        self.seen = [brought.get(i, one) for i, one in enumerate(self.seen)]
        self.made, self.done_us = tuple(self.seen), now_us + self.cost_us


def expected(units, events, end_us):
    """For each node what it has, and when; each instant is settled from the sources down."""
    stations = [None, None, *(Station(*each) for each in units)]
    found = [[] for _ in stations]
    events = deque(events)
    while True:
        dues = [each.done_us for each in stations[2:] if each.done_us is not None]
        dues += [events[0][0]] if events else []
        now_us = min(dues, default=end_us + 1)
        if now_us > end_us:
            return found
        fresh = {}
        while events and events[0][0] == now_us:
            source = events.popleft()[1]
            fresh[source] = (source, now_us)
            found[source].append((now_us, fresh[source]))
        for i, station in enumerate(stations[2:], 2):
            if station.done_us == now_us and station.made is not None:
                fresh[i], station.done_us = station.made, None
                found[i].append((now_us, fresh[i]))
            brought = {at: fresh[one] for at, one in enumerate(station.inputs) if one in fresh}
            if brought and station.cost_us == 0:
                station.seen = [brought.get(at, one) for at, one in enumerate(station.seen)]
                fresh[i] = tuple(station.seen)
                found[i].append((now_us, fresh[i]))
                continue
            if brought:
                station.arrive(now_us, brought)
            station.begin(now_us)


@given(costly(), pushes())
def test_what_a_unit_makes_is_available_when_it_has_finished(units, events) -> None:
    end_us = events[-1][0] + 20_000_000
    network = Network()
    for i in (0, 1):
        network.add_source(label(i), ANY)
    for i, (cost_us, inputs) in enumerate(units, 2):
        refine(network, i, unit(len(inputs), cost_us), inputs)
    got = [listen(network, i) for i in range(2 + len(units))]
    for now_us, source in events:
        pass_time(network, now_us - 1)
        with network.instant.whole():
            network.on_time(now_us)
            network.push(label(source), Sample(now_us, now_us, (source, now_us)))
    pass_time(network, end_us)
    has = [[(sample.available_us, sample.value) for sample in each] for each in got]
    assert has == expected(units, events, end_us)


def pass_time(network, until_us):
    while (due_us := network.deadline_us) is not None and due_us <= until_us:
        network.on_time(due_us)


# Workers


class Bench:
    """Workers that carry out a computation when `do` is called."""

    def __init__(self, network):
        self.network, self.us, self.given = network, 0, deque()
        network.calls.workers = self

    def now_us(self):
        return self.us

    def start(self, number, work):
        self.given.append((number, work))

    def do(self, took_us):
        number, work = self.given.popleft()
        outcome = work()
        self.us += took_us
        self.network.on_computed(number, outcome, took_us, self.us)


def apart(prototype):
    network = Network()
    faults = []
    network.on_fault = lambda _label, said: faults.append(said)
    network.add_source(label(0), ANY)
    bench = Bench(network)
    process = refine(network, 1, prototype, (0,))
    return network, bench, process, listen(network, 1), faults


def push(network, bench, value):
    bench.us = max(bench.us, value)
    network.push(label(0), Sample(value, value, value))


def test_a_unit_is_made_and_called_in_a_worker_until_it_has_shown_to_be_fast() -> None:
    made = []
    prototype = unit(1)
    network, bench, process, got, _ = apart(UnitPrototype("u", "", ("",), lambda: made.append(1) or prototype.make()))
    for n in range(SHOWN):
        push(network, bench, 1_000_000 * (n + 1))
        assert not made or n, "making one may import what takes a second"
        assert process.is_apart
        bench.do(300)
    assert not process.is_apart
    push(network, bench, 9_000_000)
    assert not bench.given
    assert [sample.delay_us for sample in got] == [300, 300, 300, 0]


def test_the_delay_is_the_one_there_was_wherever_the_unit_ran() -> None:
    network, bench, process, got, _ = apart(unit(1, cost_us=1_000, function=lambda _values: busy()))

    def busy():
        bench.us += 4_000
        return 1

    push(network, bench, 1_000_000)
    assert not process.is_apart
    assert [sample.delay_us for sample in got] == [4_000]


def test_a_call_that_is_slow_is_the_last_on_the_spot() -> None:
    costs = [SLOW_US + 1, 10, 10]
    network, bench, process, got, _ = apart(unit(1, cost_us=1_000, function=lambda _values: busy()))

    def busy():
        bench.us += costs.pop(0)
        return 1

    push(network, bench, 1_000_000)
    assert process.is_apart
    push(network, bench, 2_000_000)
    assert len(got) == 1
    bench.do(0)
    assert len(got) == 2


def test_what_is_late_is_dropped_and_counted_and_not_queued() -> None:
    network, bench, process, got, faults = apart(unit(1, cost_us=4_000_000))
    for second in range(1, 41):
        push(network, bench, second * 1_000_000)
        if second % 4 == 1 and second > 1:
            bench.us = second * 1_000_000 - 4_000_000
            bench.do(4_000_000)
    assert process.dropped > 20
    assert max(sample.delay_us for sample in got) <= 4_000_000 + LATE_US + 1_000_000
    assert any("dropped" in said for said in faults)


def test_only_so_many_wait_and_a_unit_that_does_not_return_is_told_once() -> None:
    network, bench, process, got, faults = apart(unit(1, cost_us=SLOW_US + 1))
    for n in range(1, 2_000):
        push(network, bench, n * OFTEN)
    assert not got
    assert len(process._waiting) <= MAX_WAITING
    assert sum("has not returned" in said for said in faults) == 1
    assert 2_000 * OFTEN > STUCK_US


def test_what_a_unit_raises_in_a_worker_is_told_and_ends_nothing() -> None:
    network, bench, _, got, faults = apart(unit(1, function=lambda values: 1 // values[0][0]))
    network.push(label(0), Sample(1, 1, (0,)))
    bench.do(10)
    network.push(label(0), Sample(2, 2, (1,)))
    bench.do(10)
    assert [sample.value for sample in got] == [1]
    assert "ZeroDivisionError" in faults[0]


def test_what_comes_of_a_unit_that_was_replaced_meanwhile_is_dropped() -> None:
    network, bench, process, got, _ = apart(unit(1, function=lambda _values: "old"))
    push(network, bench, 1_000_000)
    process.exchange(unit(1, function=lambda _values: "new"))
    push(network, bench, 2_000_000)
    bench.do(100)
    bench.do(100)
    assert [sample.value for sample in got] == ["new"]


def test_two_inputs_of_a_unit_that_is_busy_are_taken_together_when_they_are_late() -> None:
    """What was dropped still counts as the last sample of its input (Def. 4.3.16)."""
    network = Network()
    for i in (0, 1):
        network.add_source(label(i), ANY)
    bench = Bench(network)
    process = refine(network, 2, unit(2, cost_us=SLOW_US + 1), (0, 1))
    got = listen(network, 2)
    network.push(label(0), Sample(1, 1, "first"))
    network.push(label(0), Sample(2, 2, "late"))
    network.push(label(1), Sample(3_000_000, 3_000_000, "newest"))
    bench.us = 4_000_000
    bench.do(0)
    bench.do(0)
    assert process.dropped == 1
    assert [sample.value for sample in got] == [("first", "none"), ("late", "newest")]


def test_a_cost_is_declared_with_the_unit() -> None:
    @value_unit("number", "number", cost_us=20_000)
    def slow(value):
        return value

    @computational_unit("number", "number", cost_us=30_000)
    def slower(_now_us, sample):
        return sample.value

    assert [each.cost_us for each in prototypes_in([slow, slower])] == [20_000, 30_000]


def test_an_outcome_without_a_taker_is_ignored() -> None:
    network = Network()
    network.on_computed(7, Outcome(), 1, 1)
    assert not network.calls


# Several outputs of one call


def test_a_unit_may_make_several_samples_of_one() -> None:
    @computational_unit("", "")
    def split(now_us, sample):
        return [sample._replace(value=(name, sample.value)) for name in "ab"[: sample.value]]

    network = Network()
    network.add_source(label(0), ANY)
    refine(network, 1, prototypes_in([split])[0], (0,))
    got = listen(network, 1)
    for value in (2, 0, 1):
        network.push(label(0), Sample(value, value, value))
    assert [sample.value for sample in got] == [("a", 2), ("b", 2), ("a", 1)]


def test_a_list_of_other_things_is_a_value_and_refused_as_before() -> None:
    @computational_unit("", "")
    def listed(_now_us, sample):
        return [sample.value]

    network = Network()
    network.add_source(label(0), ANY)
    faults = []
    network.on_fault = lambda _label, said: faults.append(said)
    refine(network, 1, prototypes_in([listed])[0], (0,))
    got = listen(network, 1)
    network.push(label(0), Sample(1, 1, 1))
    assert got == []
    assert "not of its sort" in faults[0]
