"""Sections 4.4.5 and 4.5.4: what policies mean, and that adapted streams are what Definition 4.5.10 allows."""

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dyknow import NO_VALUE, Label, Network, Policy, PolicyError, Sample, Sort
from tests.strategies import gridded_streams, policies, rated_streams, streams, times_us
from tests.thesis.stream_definitions import (
    WORKED,
    is_substream,
    literal_extension,
    most_recent_at,
    run,
    sample,
    stream,
)

P1 = stream([(250, 200, "p1"), (325, 300, "p2"), (430, 400, "p3"), (505, 500, "p4")])  # pos[car1] of Example 4.5.1
exact_policies = policies().filter(lambda p: p.approximation == "none")


def shown(samples: list[Sample]) -> list[list[Any]]:
    return [[s.available_us / 1_000, s.valid_us / 1_000, None if s.value is NO_VALUE else s.value] for s in samples]


# Definition 4.5.11, one constraint at a time, by the formula printed there.


@given(gridded_streams())
def test_definition_4_4_9_change_constraints(f: list[Sample]) -> None:
    assert Policy(change="any update").satisfied_by(f)
    assert Policy(change="any change").satisfied_by(f) == all(
        (a.valid_us, a.value) != (b.valid_us, b.value) for a, b in pairwise(f)
    )
    steps = [b.valid_us - a.valid_us for a, b in pairwise(f)]
    assert Policy(change="sample", sample_us=20).satisfied_by(f) == all(d > 0 and d % 20 == 0 for d in steps)


@given(streams(), st.integers(0, 150))
def test_definition_4_4_10_delay_constraint(f: list[Sample], limit_us: int) -> None:
    assert Policy(max_delay_us=limit_us).satisfied_by(f) == all(s.available_us - s.valid_us <= limit_us for s in f)
    assert Policy(max_delay_us=None).satisfied_by(f), "max delay oo"


@given(streams(), times_us, times_us)
def test_definition_4_4_11_duration_constraint(f: list[Sample], from_us: int, to_us: int) -> None:
    assert Policy(from_us=from_us).satisfied_by(f) == all(from_us <= s.valid_us for s in f)
    assert Policy(to_us=to_us).satisfied_by(f) == Policy(from_us=0, to_us=to_us).satisfied_by(f)
    if from_us <= to_us:
        assert Policy(from_us=from_us, to_us=to_us).satisfied_by(f) == all(from_us <= s.valid_us <= to_us for s in f)
    else:
        with pytest.raises(PolicyError):
            Policy(from_us=from_us, to_us=to_us)


@given(gridded_streams())
def test_definition_4_4_12_order_constraints(f: list[Sample]) -> None:
    assert Policy(order="any").satisfied_by(f)
    assert Policy(order="monotone").satisfied_by(f) == all(a.valid_us <= b.valid_us for a, b in pairwise(f))
    assert Policy(order="strict").satisfied_by(f) == all(a.valid_us < b.valid_us for a, b in pairwise(f))
    assert not Policy(change="sample", sample_us=20).satisfied_by(f) or Policy(order="strict").satisfied_by(f)


@given(policies(), rated_streams())
def test_definition_4_5_11_a_policy_holds_when_each_constraint_does(policy: Policy, f: list[Sample]) -> None:
    each = [
        Policy(change=policy.change, sample_us=policy.sample_us),
        Policy(max_delay_us=policy.max_delay_us),
        Policy(from_us=policy.from_us, to_us=policy.to_us),
        Policy(order=policy.order),
        Policy(min_certainty=policy.min_certainty),
        Policy(max_deviation=policy.max_deviation),
    ]
    assert policy.satisfied_by(f) == all(constraint.satisfied_by(f) for constraint in each)


def test_definition_4_4_13_use_most_recent_needs_to_know_what_is_missing_and_when() -> None:
    complete = {"change": "sample", "sample_us": 5, "from_us": 0, "max_delay_us": 1, "approximation": "most recent"}
    Policy(**complete)  # type: ignore[arg-type]
    for needed in ("from_us", "max_delay_us"):
        with pytest.raises(PolicyError):
            Policy(**{**complete, needed: None})  # type: ignore[arg-type]


# Definitions 4.5.9 and 4.5.10: what comes out of an adapter.


@given(exact_policies, gridded_streams())
def test_definition_4_5_10_what_is_delivered_is_a_substream_that_satisfies_the_policy(
    policy: Policy, f: list[Sample]
) -> None:
    kept, adapter = run(f, policy)
    assert policy.satisfied_by(kept)
    assert is_substream(kept, f)
    assert len(kept) + sum(adapter.dropped.values()) == len(f), "what is dropped is counted"


@given(exact_policies, rated_streams())
def test_definition_4_5_10_what_is_delivered_is_maximal(policy: Policy, f: list[Sample]) -> None:
    """No dropped sample could be added, at the time it arrived, to what was delivered, as far as is known then."""
    kept, adapter = run(f, policy)
    for dropped in (s for s in f if s not in kept):
        until_then = [s for s in kept if s.available_us < dropped.available_us]
        on_grid = (
            policy.sample_us is None
            or policy.from_us is None
            or (dropped.valid_us - policy.from_us) % policy.sample_us == 0
        )
        assert not (on_grid and policy.satisfied_by([*until_then, dropped])), adapter.dropped


@given(policies(), rated_streams())
def test_every_adapted_stream_satisfies_its_policy(policy: Policy, f: list[Sample]) -> None:
    got, _ = run(f, policy)
    assert policy.satisfied_by(got)
    assert all(a.available_us < b.available_us for a, b in pairwise(got))


@st.composite
def most_recent_policies(draw: st.DrawFn) -> Policy:
    from_us = draw(st.integers(0, 200))
    return Policy(
        change="sample",
        sample_us=20,
        max_delay_us=draw(st.integers(0, 90)),
        from_us=from_us,
        to_us=from_us + draw(st.integers(0, 300)),
        approximation="most recent",
    )


@given(most_recent_policies(), gridded_streams())
def test_definition_4_5_10_use_most_recent_gives_every_point_its_literal_value_and_never_later(
    policy: Policy, f: list[Sample]
) -> None:
    got, _ = run(f, policy)
    literal = literal_extension(f, policy)
    assert [s.valid_us for s in got] == [s.valid_us for s in literal]
    assert all(early.available_us <= late.available_us for early, late in zip(got, literal, strict=True))
    for delivered, late in zip(got, literal, strict=True):
        exact = [s for s in f if s.valid_us == delivered.valid_us and s.available_us <= late.available_us]
        if exact:
            assert delivered.value in {s.value for s in exact}
            assert delivered.available_us >= exact[0].available_us
        else:
            assert delivered == late, "a missing sample is approximated at valid time + max delay"


@given(most_recent_policies(), gridded_streams())
def test_an_exact_sample_leaves_when_it_arrives_unless_an_earlier_point_is_still_open(
    policy: Policy, f: list[Sample]
) -> None:
    assert policy.max_delay_us is not None
    got, _ = run(f, policy)
    settled_us = 0
    for delivered in got:
        limit_us = delivered.valid_us + policy.max_delay_us
        arrived = [s.available_us for s in f if s.valid_us == delivered.valid_us and s.available_us <= limit_us]
        settled_us = max([settled_us, arrived[0] if arrived else limit_us])
        assert delivered.available_us >= settled_us
        assert delivered.available_us - settled_us < len(got), "but for ties"


@given(gridded_streams(), st.none() | st.integers(0, 60), st.integers(0, 40))
def test_use_linear_puts_missing_points_on_the_line_between_their_neighbours(
    f: list[Sample], limit_us: int | None, from_us: int
) -> None:
    rising = [s._replace(value=(3.0 * s.valid_us, -1.0 * s.valid_us)) for s in f]
    got, _ = run(
        rising, Policy(change="sample", sample_us=20, from_us=from_us, max_delay_us=limit_us, approximation="linear")
    )
    heard = []
    for s in rising:
        if not heard or s.valid_us > heard[-1].valid_us:
            heard.append(s)
    expected = []
    for before, after in pairwise([None, *heard]):
        assert after is not None
        first_us = after.valid_us if before is None else before.valid_us + 1
        expected += [
            (g, after.available_us)
            for g in range(first_us, after.valid_us + 1)
            if g >= from_us and (g - from_us) % 20 == 0
        ]
    assert [s.valid_us for s in got] == [g for g, at in expected if limit_us is None or at - g <= limit_us]
    for s in got:
        assert s.value == pytest.approx((3.0 * s.valid_us, -1.0 * s.valid_us))


@given(streams(), streams())
def test_definition_4_5_9_substreams_are_a_preorder(f: list[Sample], g: list[Sample]) -> None:
    assert is_substream(f, f)
    assert is_substream([], f)
    late = [s._replace(available_us=s.available_us + 5) for s in f]
    assert is_substream(late, f)
    assume(is_substream(g, late))
    assert is_substream(g, f)


# The examples.


@pytest.mark.parametrize("case", WORKED["substreams"], ids=lambda c: c["from"])
def test_example_4_5_4_substream(case: dict[str, Any]) -> None:
    assert is_substream(stream(case["stream"]), stream(case["original"])) == case["is_substream"]


@pytest.mark.parametrize("case", WORKED["satisfaction"], ids=lambda c: f"{c['from']}-{c['policy']}")
def test_example_4_5_5_fluent_stream_policy(case: dict[str, Any]) -> None:
    assert Policy.parse(case["policy"]).satisfied_by(stream(case["stream"])) == case["satisfied"]


@pytest.mark.parametrize("case", WORKED["terms"], ids=lambda c: c["from"])
def test_example_4_5_6_fluent_stream_term(case: dict[str, Any]) -> None:
    got, _ = run(stream(case["stream"]), Policy.parse(case["policy"]))
    assert [s.value for s in got] == case["maximal_values"][0], "the first sample anchors the grid"


@pytest.mark.parametrize("case", WORKED["approximated"], ids=lambda c: c["from"])
def test_missing_samples_are_approximated_and_punctual_ones_not_delayed(case: dict[str, Any]) -> None:
    f, policy = stream(case["stream"]), Policy.parse(case["policy"])
    got, _ = run(f, policy)
    assert shown(got) == case["on_arrival"]
    assert shown(literal_extension(f, policy)) == case["literal_extension"]


@pytest.mark.parametrize("case", WORKED["gaps"], ids=lambda c: c["from"])
def test_a_missed_sample_is_a_gap_and_not_the_end(case: dict[str, Any]) -> None:
    got, adapter = run(stream(case["stream"]), Policy.parse(case["policy"]))
    assert shown(got) == case["delivered"]
    assert adapter.gaps == case["gaps"]


def test_example_4_4_8_to_4_4_12_one_constraint_each() -> None:
    assert shown(run(P1, Policy.parse("sample every 100"))[0]) == shown(P1)
    assert [s.value for s in run(P1, Policy.parse("max delay 30"))[0]] == ["p2", "p3", "p4"]
    assert [s.value for s in run(P1, Policy.parse("from 300 to 400"))[0]] == ["p2", "p3"]
    repeated = stream([(1, 1, "a"), (2, 1, "b"), (3, 0, "c")])
    assert [s.value for s in run(repeated, Policy.parse("monotone order"))[0]] == ["a", "b"]
    assert [s.value for s in run(repeated, Policy.parse("strict order"))[0]] == ["a"]
    assert most_recent_at(P1, 450_000, 480_000) == sample((430, 400, "p3"))


def test_examples_4_4_13_4_4_14_and_4_5_3_terms_and_streams_of_a_generator() -> None:
    network, car1 = Network(), Label.parse("pos[car1]")
    network.add_source(car1, Sort("pos"))
    sampled: list[Sample] = []
    speed_car1: list[Sample] = []
    network.subscribe(car1, Policy.parse("sample every 200"), sampled.append)
    network.subscribe(car1, Policy.parse("from 300 to 400"), speed_car1.append)
    for s in P1:
        network.push(car1, s.valid_us, s.value, s.available_us)
    assert [s.value for s in sampled] == ["p1", "p3"]
    assert [s.value for s in speed_car1] == ["p2", "p3"]
    assert network.generator(car1).history.get_between(0, 500_000) == P1, (
        "Definition 4.5.7: the label denotes the source's samples"
    )


@given(streams())
def test_definition_4_5_8_a_unit_computes_from_the_join_of_its_adapted_inputs(f: list[Sample]) -> None:
    network, pos, speed = Network(), Label("pos"), Label("speed")
    network.add_source(pos, Sort("pos"))
    network.add_unit(
        speed,
        Sort("speed"),
        lambda now, inputs, state: (Sample(now, now, inputs[0]), state),
        [(pos, Policy(order="monotone"))],
    )
    for s in f:
        network.push(pos, s.valid_us, s.value, s.available_us)
    adapted, _ = run(f, Policy(order="monotone"))
    assert [s.value for s in network.generator(speed).history.get_slice(0, len(adapted) - 1)] == adapted
