"""Whole specifications under random arrivals: every declared stream satisfies its policy, and lacks nothing (4.5.10, 4.5.11)."""

from dataclasses import replace
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from dyknow import NO_VALUE, Policy, Sample
from dyknow.model.sample import SURE, Quality
from tests.kpl.instances import Running, label
from tests.satisfaction import satisfied
from tests.thesis.streams.state_pseudocode import value
from tests.thesis.streams.stream_definitions import is_substream, line_between, literal_extension

MS = 1_000
END_US = 2_000 * MS
INPUTS = [
    "",
    "max delay 40500us",
    "sample every 20",
    "strict order",
    "monotone order, max delay 60500us",
    "any change",
    "min certainty 0.5",
    "max deviation 2, strict order",
    "sample every 20, use linear",
    "sample every 40, max delay 60500us, from 0 to oo, use most recent",
]
NOT_LINEAR = [policy for policy in INPUTS if "linear" not in policy]
STATES = [
    "max delay 60500us",
    "any change",
    "sample every 40, max delay 50500us",
    "sample every 20, max delay 70500us, delay before approximation 30500us",
    "sample every 40, max delay 500us, from 80 to 400",
]
SAMPLED = [policy for policy in STATES if "sample every" in policy]
QUALITIES = [SURE, Quality(0.4), Quality(0.9, ((1.0,),)), Quality(0.6, ((9.0,),))]


@st.composite
def policies(draw):
    """Every kind; delays lie between the milliseconds and the half ones at which samples come: a tie is moved by 1 us after
    max delay was checked, so that it could cross a limit that it lies on."""
    sample_us = draw(st.none() | st.sampled_from([20 * MS, 40 * MS]))
    from_us = draw(st.none() | st.integers(0, 20).map(lambda t: t * 10 * MS))
    max_delay_us = draw(st.none() | st.integers(0, 9).map(lambda t: t * 10 * MS + 700))
    kinds = ["none"]
    if sample_us is not None:
        kinds.append("linear")
        if from_us is not None and max_delay_us is not None:
            kinds.append("most recent")
    to_us = draw(st.none() | st.integers(0, 40).map(lambda t: t * 10 * MS + (from_us or 0)))
    return Policy(
        change="sample" if sample_us is not None else draw(st.sampled_from(["any update", "any change"])),
        sample_us=sample_us,
        max_delay_us=max_delay_us,
        from_us=from_us,
        to_us=to_us,
        order=draw(st.sampled_from(["any", "monotone", "strict"])),
        approximation=draw(st.sampled_from(kinds)),
        min_certainty=draw(st.none() | st.sampled_from([0.5, 0.7])),
        max_deviation=draw(st.none() | st.sampled_from([0.5, 2.0])),
    )


def taken(draw, nodes):
    policy = draw(st.sampled_from(INPUTS))
    return f"n{draw(st.sampled_from(nodes))}{' with ' if policy else ''}{policy}"


@st.composite
def networks(draw, branching=True):
    """Declarations of generators: sources and units; branching ones also take two streams, and states of states."""
    lines = ["source number s0", "source number s1", "strmgen n0 = s0", "strmgen n1 = s1"]
    numbers = [0, 1]
    for i in range(2, 2 + draw(st.integers(0, 5))):
        one, other = taken(draw, numbers), taken(draw, numbers)
        kinds = [f"Double({one})", f"Triple({one})", f"Sum({one})"]
        kinds += [f"Add({one}, {other})", ""] if branching else []
        made = draw(st.sampled_from(kinds))
        if made:
            numbers.append(i)
        else:
            policy = draw(st.sampled_from(STATES))
            every = range(i)
            made = f"state({taken(draw, every)}, {taken(draw, every)}) with {policy}"
        lines.append(f"strmgen n{i} = {made}")
    return lines


@st.composite
def arrivals(draw):
    now_us, found = 0, []
    for _ in range(draw(st.integers(0, 30))):
        now_us += draw(st.integers(1, 25)) * MS
        valid_us = max(0, now_us - draw(st.integers(-10, 60)) * MS) // (10 * MS) * 10 * MS
        quality = draw(st.sampled_from(QUALITIES))
        found.append((draw(st.sampled_from(["n0", "n1"])), valid_us, draw(st.integers(0, 3)), now_us, quality))
    return found


def run(lines, events):
    running = Running("\n".join(lines))
    for fed, valid_us, number, now_us, quality in events:
        running.wait(now_us)
        running.network.push(label(fed), Sample(now_us, valid_us, number, quality))
    running.wait(END_US)
    found = {}
    for name, sample in running.outputs:
        found.setdefault(name, []).append(sample)
    return found


def declared(wanted):
    return [f"stream o{i} = n{node} with {policy}" for i, (node, policy) in enumerate(wanted)]


@given(networks(), st.data(), arrivals())
def test_every_declared_stream_satisfies_its_policy_and_is_maximal(lines, data, events) -> None:
    """Slow and direct: nothing that was left out could have been added when it came (read with P1); with approximation
    each point has its literal value and is never later (P2)."""
    nodes = len(lines) - 2
    wanted = data.draw(st.lists(st.tuples(st.integers(0, nodes - 1), policies()), min_size=1, max_size=4))
    whole = [f"stream whole{i} = n{i}" for i in range(nodes)]
    found = run([*lines, *data.draw(st.permutations([*whole, *declared(wanted)]))], events)
    for i, (node, policy) in enumerate(wanted):
        got, every = found.get(f"o{i}", []), found.get(f"whole{node}", [])
        assert satisfied(policy, got)
        assert all(one.available_us < other.available_us for one, other in pairwise(got))
        good = [sample for sample in every if is_good(sample.quality, policy)]
        if policy.approximation == "most recent":
            assert_literal(policy, got, good)
        elif policy.approximation == "linear":
            assert_on_the_line(policy, got, good)
        else:
            assert is_substream(got, every)
            assert_maximal(policy, got, every)


def is_good(quality, policy):
    """What is too uncertain is as if it had not come (12.3)."""
    certain = policy.min_certainty is None or quality.certainty >= policy.min_certainty
    return certain and (policy.max_deviation is None or quality.deviation <= policy.max_deviation)


def assert_maximal(policy, got, every):
    for left_out in (sample for sample in every if sample not in got):
        before = [sample for sample in got if sample.available_us < left_out.available_us]
        off_grid = policy.sample_us and policy.from_us is not None
        if not (off_grid and (left_out.valid_us - policy.from_us) % policy.sample_us):
            assert not satisfied(policy, [*before, left_out])


def assert_literal(policy, got, good):
    """Each point that came, or had to, within the horizon once; an exact sample counts from its arrival on, a missing one has its value."""
    to_us = END_US if policy.to_us is None else policy.to_us
    literal = literal_extension(good, replace(policy, to_us=to_us))
    came = {sample.valid_us for sample in good}
    literal = [late for late in literal if late.available_us <= END_US or late.valid_us in came]
    assert [sample.valid_us for sample in got] == [sample.valid_us for sample in literal]
    for one, late in zip(got, literal, strict=True):
        exact = [s.value for s in good if s.valid_us == one.valid_us and s.available_us <= late.available_us]
        assert one.available_us <= late.available_us + len(got)  # but for ties
        assert one.value in exact if exact else one.value == late.value


def assert_on_the_line(policy, got, good):
    expected = line_between(good, policy)
    assert [sample.valid_us for sample in got] == [valid_us for valid_us, _, _ in expected]
    for one, (_, available_us, straight) in zip(got, expected, strict=True):
        assert available_us <= one.available_us <= available_us + len(got)  # but for ties
        assert is_close(one.value, straight)


def is_close(one, other):
    if isinstance(other, tuple):
        return len(one) == len(other) and all(map(is_close, one, other))
    return one == other if NO_VALUE in (one, other) else abs(one - other) < 1e-9


@given(networks(branching=False), st.data(), arrivals())
def test_who_else_takes_a_stream_changes_nothing_of_it(lines, data, events) -> None:
    """What is computed is what somebody wants; each gets the same as if all were computed.

    Where a process takes two streams of one origin, which comes first within an instant is nobody's promise.
    """
    nodes = len(lines) - 2
    wanted = data.draw(st.lists(st.tuples(st.integers(0, nodes - 1), policies()), min_size=1, max_size=4))
    whole = [f"stream whole{i} = n{i}" for i in range(nodes)]
    alone = run([*lines, *declared(wanted)], events)
    among = run([*lines, *whole, *declared(wanted)], events)
    for i in range(len(wanted)):
        one, other = ([(s.valid_us, s.value) for s in found.get(f"o{i}", [])] for found in (alone, among))
        assert one == other


@given(st.lists(st.sampled_from(NOT_LINEAR), min_size=1, max_size=3), st.sampled_from(SAMPLED), arrivals())
def test_each_value_of_a_state_is_the_most_recent_of_its_input(inputs, policy, events) -> None:
    """Of what had come when the state was made; what comes in that very millisecond may count or not (7.8.2)."""
    terms = [f"n{i % 2}{' with ' if each else ''}{each}" for i, each in enumerate(inputs)]
    lines = ["source number s0", "source number s1", "strmgen n0 = s0", "strmgen n1 = s1"]
    lines += [f"strmgen st = state({', '.join(terms)}) with {policy}", "stream made = st"]
    found = run([*lines, *(f"stream i{i} = {term}" for i, term in enumerate(terms))], events)
    for state in found.get("made", []):
        for i, got in enumerate(state.value):
            come = found.get(f"i{i}", [])
            cuts = (state.available_us // MS * MS, state.available_us + 1)
            may_be = [value([s for s in come if s.available_us < cut], state.valid_us) for cut in cuts]
            assert got in may_be


@given(networks(), arrivals())
def test_what_nobody_wants_is_not_computed(lines, events) -> None:
    running = Running("\n".join(lines))
    for fed, valid_us, number, now_us, quality in events:
        running.wait(now_us)
        running.network.push(label(fed), Sample(now_us, valid_us, number, quality))
    for i in range(2, len(lines) - 2):
        assert not running.network.process(label(f"n{i}")).running  # type: ignore[union-attr]
        assert running.network.generator(label(f"n{i}")).history.get_size() == 0
