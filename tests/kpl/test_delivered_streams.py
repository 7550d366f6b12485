"""Whole specifications under random arrivals: every declared stream satisfies its policy, and lacks nothing (4.5.10, 4.5.11)."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from dyknow import Policy
from tests.kpl.running import Running, label
from tests.thesis.stream_definitions import is_substream, literal_extension

MS = 1_000
INPUTS = ["", "max delay 40500us", "sample every 20", "strict order", "monotone order, max delay 60500us", "any change"]


@st.composite
def policies(draw):
    """Every kind; limits lie between the milliseconds at which samples come, so that a tie never crosses one."""
    sample_us = draw(st.none() | st.sampled_from([20 * MS, 40 * MS]))
    from_us = draw(st.none() | st.integers(0, 20).map(lambda t: t * 10 * MS))
    max_delay_us = draw(st.none() | st.integers(0, 9).map(lambda t: t * 10 * MS + 500))
    kinds = ["none"]
    if sample_us is not None and from_us is not None and max_delay_us is not None:
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
    )


def taken(draw, nodes):
    policy = draw(st.sampled_from(INPUTS))
    return f"n{draw(st.integers(0, nodes - 1))}{' with ' if policy else ''}{policy}"


@st.composite
def networks(draw):
    """Declarations of generators: sources, units, states."""
    lines = ["source number s0", "source number s1", "strmgen n0 = s0", "strmgen n1 = s1"]
    for i in range(2, 2 + draw(st.integers(0, 5))):
        one, other = taken(draw, i), taken(draw, i)
        made = draw(st.sampled_from([f"Double({one})", f"Triple({one})", f"Add({one}, {other})", f"Sum({one})"]))
        lines.append(f"strmgen n{i} = {made}")
    return lines


@st.composite
def arrivals(draw):
    now_us, found = 0, []
    for _ in range(draw(st.integers(0, 30))):
        now_us += draw(st.integers(1, 25)) * MS
        valid_us = max(0, now_us - draw(st.integers(-10, 60)) * MS) // (10 * MS) * 10 * MS
        found.append((draw(st.sampled_from(["s0", "s1"])), valid_us, draw(st.integers(0, 3)), now_us))
    return found


def run(lines, events):
    running = Running("\n".join(lines))
    for source, valid_us, value, now_us in events:
        running.wait(now_us)
        running.network.now_us = now_us
        running.instance.push(source, valid_us, value, now_us)
    running.wait(2_000 * MS)
    found = {}
    for name, sample in running.outputs:
        found.setdefault(name, []).append(sample)
    return found


@given(networks(), st.data(), arrivals())
def test_every_declared_stream_satisfies_its_policy_and_is_maximal(lines, data, events) -> None:
    """Slow and direct: nothing that was left out could have been added when it came (read with P1); with approximation
    each point has its literal value and is never later (P2)."""
    nodes = len(lines) - 2
    wanted = data.draw(st.lists(st.tuples(st.integers(0, nodes - 1), policies()), min_size=1, max_size=4))
    whole = [f"stream whole{i} = n{i}" for i in range(nodes)]
    declared = [f"stream o{i} = n{node} with {policy}" for i, (node, policy) in enumerate(wanted)]
    found = run([*lines, *data.draw(st.permutations([*whole, *declared]))], events)
    for i, (node, policy) in enumerate(wanted):
        got, every = found.get(f"o{i}", []), found.get(f"whole{node}", [])
        assert policy.satisfied_by(got)
        assert all(one.available_us < other.available_us for one, other in pairwise(got))
        if policy.approximation == "most recent":
            assert_literal(policy, got, every)
        else:
            assert is_substream(got, every)
            assert_maximal(policy, got, every)


def assert_maximal(policy, got, every):
    for left_out in (sample for sample in every if sample not in got):
        before = [sample for sample in got if sample.available_us < left_out.available_us]
        off_grid = policy.sample_us and policy.from_us is not None
        if not (off_grid and (left_out.valid_us - policy.from_us) % policy.sample_us):
            assert not policy.satisfied_by([*before, left_out])


def assert_literal(policy, got, every):
    if policy.to_us is None:
        return
    literal = [
        sample for sample in literal_extension(every, policy) if sample.valid_us + policy.max_delay_us < 2_000 * MS
    ]
    assert [sample.valid_us for sample in got] == [sample.valid_us for sample in literal]
    assert all(one.available_us <= late.available_us for one, late in zip(got, literal, strict=True))


@given(networks(), arrivals())
def test_what_nobody_wants_is_not_computed(lines, events) -> None:
    running = Running("\n".join(lines))
    for source, valid_us, value, now_us in events:
        running.wait(now_us)
        running.instance.push(source, valid_us, value, now_us)
    for i in range(2, len(lines) - 2):
        assert not running.network.process(label(f"n{i}")).running  # type: ignore[union-attr]
        assert running.network.generator(label(f"n{i}")).history.get_size() == 0
