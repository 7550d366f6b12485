"""Sections 4.4.5 and 4.5.4: what policies mean, and that adapted streams are what Definition 4.5.10 allows."""

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import NO_VALUE, Label, Network, Policy, PolicyError, Sample, Sort
from tests.satisfaction import satisfied
from tests.strategies import definition, gridded_streams, policies, rated_streams, streams, times_us
from tests.thesis.streams.stream_definitions import (
    WORKED,
    is_maximal,
    is_substream,
    literal_extension,
    most_recent_at,
    run,
    sample,
    satisfies,
    stream,
)

P1 = stream([(250, 200, "p1"), (325, 300, "p2"), (430, 400, "p3"), (505, 500, "p4")])  # pos[car1] of Example 4.5.1
exact_policies = policies(exact=True)


def shown(samples: list[Sample]) -> list[list[Any]]:
    return [[s.available_us / 1_000, s.valid_us / 1_000, None if s.value is NO_VALUE else s.value] for s in samples]


# Definition 4.5.11, one constraint at a time, by the formula printed there.


@definition
@given(gridded_streams())
def test_definition_4_4_9_change_constraints(f: list[Sample]) -> None:
    assert satisfied(Policy(change="any update"), f)
    assert satisfied(Policy(change="any change"), f) == all(
        (a.valid_us, a.value) != (b.valid_us, b.value) for a, b in pairwise(f)
    )
    steps = [b.valid_us - a.valid_us for a, b in pairwise(f)]
    assert satisfied(Policy(change="sample", sample_us=20), f) == all(d > 0 and d % 20 == 0 for d in steps)


@definition
@given(streams(), st.integers(0, 150))
def test_definition_4_4_10_delay_constraint(f: list[Sample], limit_us: int) -> None:
    assert satisfied(Policy(max_delay_us=limit_us), f) == all(s.available_us - s.valid_us <= limit_us for s in f)
    assert satisfied(Policy(max_delay_us=None), f), "max delay oo"


@definition
@given(streams(), times_us, times_us, st.booleans())
def test_definition_4_4_11_duration_constraint(f: list[Sample], from_us: int, to_us: int, met: bool) -> None:
    """Both ends belong to the duration: they are often the times of samples."""
    if f and met:
        from_us, to_us = (f[at % len(f)].valid_us for at in (from_us, to_us))
    assert satisfied(Policy(to_us=to_us), f) == all(s.valid_us <= to_us for s in f)
    assert satisfied(Policy(from_us=from_us), f) == all(from_us <= s.valid_us for s in f)
    if from_us <= to_us:
        assert satisfied(Policy(from_us=from_us, to_us=to_us), f) == all(from_us <= s.valid_us <= to_us for s in f)
    else:
        with pytest.raises(PolicyError):
            Policy(from_us=from_us, to_us=to_us)


@definition
@given(gridded_streams())
def test_definition_4_4_12_order_constraints(f: list[Sample]) -> None:
    assert satisfied(Policy(order="any"), f)
    assert satisfied(Policy(order="monotone"), f) == all(a.valid_us <= b.valid_us for a, b in pairwise(f))
    assert satisfied(Policy(order="strict"), f) == all(a.valid_us < b.valid_us for a, b in pairwise(f))
    assert not satisfied(Policy(change="sample", sample_us=20), f) or satisfied(Policy(order="strict"), f)


@definition
@given(policies(), rated_streams(), st.booleans())
def test_definition_4_5_11_a_policy_is_satisfied_when_every_constraint_is(
    policy: Policy, f: list[Sample], adapted: bool
) -> None:
    found = run(f, policy)[0] if adapted else f
    assert satisfied(policy, found) == satisfies(found, policy)
    assert not adapted or satisfies(found, policy)


words = ("change", "sample_us", "from_us", "to_us", "max_delay_us", "order", "approximation")


@definition
@given(
    st.fixed_dictionaries(
        dict(
            zip(
                words,
                [
                    st.sampled_from(["any update", "any change", "sample"]),
                    *[st.none() | st.integers(-1, 5)] * 4,
                    st.sampled_from(["any", "monotone", "strict"]),
                    st.sampled_from(["none", "most recent"]),
                ],
                strict=True,
            )
        )
    )
)
def test_definitions_4_4_8_and_4_4_13_which_constraints_go_together(written: dict[str, Any]) -> None:
    """As 4.4.5 says it of each; `most recent` without an end too (P3), and no duration that ends before it starts."""
    times = [written[name] for name in words[1:5]]
    sampled, from_us, to_us = written["sample_us"] is not None, written["from_us"], written["to_us"]
    complete = sampled and from_us is not None and written["max_delay_us"] is not None
    allowed = (
        all(t is None or t >= 0 for t in times)
        and written["sample_us"] != 0
        and (written["change"] == "sample") == sampled
        and (from_us is None or to_us is None or from_us <= to_us)
        and (written["approximation"] == "none" or complete)
    )
    try:
        policy = Policy(**written)
    except PolicyError:
        assert not allowed
    else:
        assert allowed
        assert policy.order == ("strict" if sampled else written["order"]), "a sample constraint implies strict order"


def test_definition_4_4_13_use_most_recent_needs_to_know_what_is_missing_and_when() -> None:
    complete = {"change": "sample", "sample_us": 5, "from_us": 0, "max_delay_us": 1, "approximation": "most recent"}
    Policy(**complete)  # type: ignore[arg-type]
    for needed in ("from_us", "max_delay_us"):
        with pytest.raises(PolicyError):
            Policy(**{**complete, needed: None})  # type: ignore[arg-type]


# Definitions 4.5.9 and 4.5.10: what comes out of an adapter.


@definition
@given(exact_policies, rated_streams())
def test_definition_4_5_9_what_is_delivered_is_a_substream_available_no_earlier(
    policy: Policy, f: list[Sample]
) -> None:
    kept, adapter = run(f, policy)
    assert is_substream(kept, f)
    assert len(kept) + sum(adapter.dropped.values()) == len(f), "what is dropped is counted"


@definition
@given(exact_policies, rated_streams(max_size=8))
def test_definition_4_5_10_what_is_delivered_satisfies_the_policy_and_is_maximal(
    policy: Policy, f: list[Sample]
) -> None:
    kept, adapter = run(f, policy)
    assert satisfies(kept, policy)
    assert is_maximal(kept, f, policy), adapter.dropped


@given(policies(), rated_streams())
def test_every_adapted_stream_satisfies_its_policy(policy: Policy, f: list[Sample]) -> None:
    got, _ = run(f, policy)
    assert satisfied(policy, got)
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


@definition
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


# The examples.


@pytest.mark.parametrize("case", WORKED["substreams"], ids=lambda c: c["from"])
def test_example_4_5_4_substream(case: dict[str, Any]) -> None:
    assert is_substream(stream(case["stream"]), stream(case["original"])) == case["is_substream"]


@pytest.mark.parametrize("case", WORKED["satisfaction"], ids=lambda c: f"{c['from']}-{c['policy']}")
def test_example_4_5_5_fluent_stream_policy(case: dict[str, Any]) -> None:
    assert satisfied(Policy.parse(case["policy"]), stream(case["stream"])) == case["satisfied"]


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


def kept(f: list[Sample], policy: str) -> list[Any]:
    return [s.value for s in run(f, Policy.parse(policy))[0]]


REPEATED = stream([(1, 1, "a"), (2, 1, "b"), (3, 0, "c")])


def test_example_4_4_8_change_constraint() -> None:
    assert kept(P1, "sample every 100") == ["p1", "p2", "p3", "p4"]
    assert kept(P1, "sample every 200") == ["p1", "p3"]
    assert kept(REPEATED, "any update") == kept(REPEATED, "") == ["a", "b", "c"]


def test_example_4_4_9_delay_constraint() -> None:
    assert kept(P1, "max delay 100") == kept(P1, "max delay oo") == ["p1", "p2", "p3", "p4"]
    assert kept(P1, "max delay 30") == ["p2", "p3", "p4"]


def test_example_4_4_10_duration_constraint() -> None:
    assert kept(P1, "from 300 to 400") == ["p2", "p3"]
    assert kept(P1, "from 300") == kept(P1, "from 300 to oo") == ["p2", "p3", "p4"]
    assert kept(P1, "to 300") == kept(P1, "from 0 to 300") == ["p1", "p2"]


def test_example_4_4_11_order_constraint() -> None:
    assert kept(REPEATED, "any order") == ["a", "b", "c"]
    assert kept(REPEATED, "monotone order") == ["a", "b"]
    assert kept(REPEATED, "strict order") == ["a"]


def test_example_4_4_12_approximation_constraint() -> None:
    missing = [s for s in P1 if s.value != "p3"]
    complete = "sample every 100, max delay 60, from 200 to 500"
    assert kept(missing, f"{complete}, use most recent") == ["p1", "p2", "p2", "p4"]
    assert kept(missing, f"{complete}, no approximation") == kept(missing, complete) == ["p1", "p2", "p4"]
    assert most_recent_at(P1, 450_000, 480_000) == sample((430, 400, "p3"))


def adapted_in_network(policy: str) -> list[Any]:
    network, car1, got = Network(), Label.parse("pos[car1]"), list[Sample]()
    network.add_source(car1, Sort("pos"))
    network.connect(car1, Policy.parse(policy), got.append)
    for s in P1:
        network.push(car1, s)
    return [s.value for s in got]


def test_example_4_4_13_fluent_stream_term() -> None:
    assert adapted_in_network("sample every 200") == ["p1", "p3"]


def test_example_4_4_14_fluent_stream_declaration() -> None:
    assert adapted_in_network("from 300 to 400") == ["p2", "p3"]
