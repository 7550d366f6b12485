"""Random networks of processes, and what happens to them: samples that arrive, and time that passes."""

from hypothesis import strategies as st

from dyknow import NO_VALUE, ComputationalUnit, Label, Network, Policy, Sample, Sort, UnitPrototype, of_values
from dyknow.network.computational_unit import latest_valid_us
from dyknow.network.process import Input
from dyknow.network.processes import OnDemand
from dyknow.network.refinement import RefinementProcess
from tests.strategies import rows

ANY = Sort("any", is_open=True)
NUMBER = Sort("number")
stateless = st.sampled_from(["", "max delay 30us", "from 40us to oo", "to 300us", "max delay 50us, from 20us to 350us"])
stateful = stateless | st.sampled_from(
    [
        "sample every 20us",
        "strict order",
        "monotone order, max delay 60us",
        "any change",
        "sample every 40us, use linear",
    ]
)


def doubled(value):
    return NO_VALUE if value is NO_VALUE else value * 2


def summing():
    """A unit with a memory: the sum of all that came."""

    def step(now_us, inputs, state):
        total = (0 if state is NO_VALUE else state) + sum(s.value for s in inputs if s is not None)
        return Sample(now_us, latest_valid_us(inputs), total), total

    return step


def compute(network, i, function, upon, policy):
    """Make stream `i` of stream `upon` by hand, with or without a subscriber."""
    generator, unit = network.add_source(label(i), ANY), ComputationalUnit(function, 1)

    def on_sample(sample):
        for output in unit.outputs_of({0: sample}, sample.available_us):
            generator.push(output.available_at(sample.available_us))

    network.connect(label(upon), policy, on_sample)


class Counted:
    """A unit that works sample by sample and notes what it is called with."""

    def __init__(self, name="Counted"):
        self.seen = []
        self.prototype = UnitPrototype(name, "any", ("any",), self.make, samplewise=True)

    def make(self):
        def step(now_us, inputs, state):
            (sample,) = inputs
            self.seen.append(sample.valid_us)
            return Sample(now_us, sample.valid_us, doubled(sample.value)), state

        return step


def joined(arity):
    return UnitPrototype(
        f"Join{arity}", "any", ("any",) * arity, lambda: of_values(lambda *values: sum(v * 3 for v in values))
    )


def remembering(arity):
    return UnitPrototype(f"Sum{arity}", "any", ("any",) * arity, summing)


def label(i):
    return Label("n", (str(i),))


@st.composite
def arrivals(draw, sources=2, max_size=30, max_lead_us=10):
    """(source, valid, value, now): available times that differ, valid times that may come in any order."""
    now_us, found = 0, []
    for step, delay, source, value in rows(draw, max_size, 4):
        now_us += 1 + step % 25
        valid_us = max(0, (now_us - delay % (61 + max_lead_us) + max_lead_us) // 10 * 10)
        found.append((source % sources, valid_us, value % 4, now_us))
    return found


def pass_time(network, until_us):
    """Let the timers before an instant go off; at one instant inputs are first."""
    while (due_us := network.deadline_us) is not None and due_us < until_us:
        network.on_time(max(due_us, network.now_us))
    network.now_us = max(network.now_us, until_us)


def feed(network, events):
    for source, valid_us, value, now_us in events:
        pass_time(network, now_us)
        network.push(label(source), Sample(now_us, valid_us, value))


def refine(network, at, prototype, inputs):
    process = RefinementProcess(prototype, [Input(label(i), policy) for i, policy in inputs])
    network.add_process(label(at), ANY, process)
    return process


def state_of(network: Network):
    """Everything that a stream can leave behind."""
    generators = {name: network.generator(name) for name in network.labels()}
    return {
        "labels": network.labels(),
        "subscriptions": {name: len(one.subscriptions) for name, one in generators.items()},
        "sizes": {name: one.history.get_size() for name, one in generators.items() if one.owner is not None},
        "running": [name for name in generators if isinstance(p := network.process(name), OnDemand) and p.running],
        "processes": set(network._processes),
        "timed": len(network._timed),
        "waiting": {name: len(waiting) for name, waiting in network._waiting.items()},
        "attributes": {stem: tuple(found) for stem, found in network._attributes.items()},
    }


def invariants(network: Network) -> None:
    """What holds whenever nothing is being called."""
    for name in network.labels():
        generator = network.generator(name)
        process = network.process(name)
        if isinstance(process, OnDemand):
            assert process.running == bool(generator.subscriptions), name
            assert generator.owner is process
            if not process.running:
                assert process.proxies == ()
                assert generator.history.get_size() == 0
        assert all(subscription.active for subscription in generator.subscriptions)
    assert all(waiting for waiting in network._waiting.values())
    assert all(found for found in network._attributes.values())


def times(samples):
    return [(s.available_us, s.valid_us, s.value) for s in samples]


def policy(text):
    return Policy.parse(text)
