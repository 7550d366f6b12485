"""Section 4.5, what declarations mean: what labels denote, what units make, and what a declared stream delivers."""

from dataclasses import replace
from itertools import groupby
from operator import itemgetter
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from dyknow import NO_VALUE, Label, Policy, Sample, UnitPrototype, of_values
from dyknow.kpl import parse_specification
from dyknow.network.computational_unit import latest_valid_us
from tests.dyknow.networks import pass_time
from tests.kpl.instances import Running
from tests.strategies import definition, gridded_streams, policies, rows
from tests.thesis.streams import stream_definitions as thesis
from tests.thesis.streams.stream_definitions import run

MS = 1_000
TWO = parse_specification("source thing s1\nsource thing s2\nstrmgen f[o1] = s1\nstrmgen f[o2] = s2")
SORTED = parse_specification(
    "sort pos(north in m, east in m)\nsource pos s\ncompunit pos C(thing)\nsource thing t\nstrmgen f = s\nstrmgen g = C(t1)\nstrmgen t1 = t"
)
NAMED = parse_specification("source thing s\nstrmgen l = s\nstream n = l")
COPY = UnitPrototype("C", "pos", ("thing",), lambda: of_values(lambda v: v))


def instance(specification: tuple[Any, ...]) -> Running:
    running = Running(prototypes=[COPY], sorts={})
    running.instance.add(specification, 0)
    return running


PROVIDED = instance(TWO)


def held(running: Running, label: str) -> list[Sample]:
    """The fluent stream that a label denotes."""
    history = running.network.snapshot(Label.parse(label))
    return history.get_slice(0, history.get_size() - 1)


@st.composite
def sources(draw: st.DrawFn) -> dict[int, tuple[int, str] | None]:
    """Functions from time-points to samples (Def. 4.3.14): valid time and value; elsewhere, and where None, no_sample."""
    drawn = rows(draw, 12, 3)
    return {at: None if value % 4 == 3 else (valid, "abc"[value % 4]) for at, valid, value in drawn}


@definition
@given(sources(), sources())
def test_definitions_4_3_14_4_5_6_and_4_5_7_a_label_denotes_what_its_source_provides(
    s1: dict[int, Any], s2: dict[int, Any]
) -> None:
    for label in ("f[o1]", "f[o2]"):
        PROVIDED.network.generator(Label.parse(label)).reset()
    for t in sorted({*s1, *s2}):
        for name, source in (("s1", s1), ("s2", s2)):
            if source.get(t) is not None:
                PROVIDED.instance.push(name, Sample(t, *source[t]))
    for label, source in (("f[o1]", s1), ("f[o2]", s2)):
        assert held(PROVIDED, label) == [Sample(t, *source[t]) for t in sorted(source) if source[t] is not None]


numbers = st.sampled_from([0, 1.5, -3, True, float("nan"), float("inf"), "north", NO_VALUE])
found_values = st.lists(numbers, max_size=3).map(tuple) | numbers


def is_position(v: Any) -> bool:
    """I_V(pos), as `sort pos` says it: two finite numbers; no_value is of every sort."""
    if v is NO_VALUE:
        return True
    parts = v if isinstance(v, tuple) and len(v) == 2 else ("not two",)
    return all(type(part) in {int, float} and part - part == 0 for part in parts)


@definition
@given(st.lists(found_values, max_size=10))
def test_definitions_4_5_4_and_4_5_5_sources_and_units_bring_only_values_of_their_sort(brought: list[Any]) -> None:
    running = instance(SORTED)
    got = list[Sample]()
    running.network.connect(Label("g"), Policy(), got.append)
    open_sort = [v for v in brought if thesis.is_value(v)]
    for t, value in enumerate(brought):
        running.instance.push("s", Sample(t, t, value))
        running.instance.push("t", Sample(t, t, value))
    assert thesis.values(held(running, "f")) == [v for v in brought if is_position(v)]
    assert thesis.values(held(running, "t1")) == open_sort
    assert thesis.values(got) == [v for v in open_sort if is_position(v)]


def step(now_us: int, inputs: tuple[Sample | None, ...], state: Any) -> tuple[Sample | None, Any]:
    """A unit that makes use of all it is given, and says nothing at every third call."""
    called = 1 if state is NO_VALUE else state + 1
    output = Sample(now_us, latest_valid_us(inputs) or 0, f"{now_us} {inputs} {state}")
    return (None if called % 3 == 0 else output), called


STEP = UnitPrototype("Step", "thing", ("thing", "thing"), lambda: step)
JOINED = parse_specification(
    "source thing s0\nsource thing s1\nstrmgen f0 = s0\nstrmgen f1 = s1\nstrmgen made = Step(f0, f1)\nstream out = made"
)


def in_ms(f: list[Sample], policy: Policy) -> tuple[list[Sample], Policy]:
    """A stream and a policy in the times that specifications have."""
    times = {name: getattr(policy, name) for name in ("sample_us", "max_delay_us", "from_us", "to_us")}
    policy = replace(policy, delay_before_us=None, **{name: t and t * MS for name, t in times.items()})
    return [s._replace(available_us=s.available_us * MS, valid_us=s.valid_us * MS) for s in f], policy


@definition
@given(gridded_streams(), gridded_streams(), policies(exact=True), policies(exact=True))
def test_definition_4_5_8_a_unit_makes_its_output_of_the_join_of_its_adapted_inputs(
    one: list[Sample], other: list[Sample], p1: Policy, p2: Policy
) -> None:
    """Whether the inputs come at instants of their own or at one, which is one element of the join."""
    (one, p1), (other, p2) = in_ms(one, p1), in_ms(other, p2)
    made: Any = JOINED[4]
    terms = tuple(replace(term, policy=p) for term, p in zip(made.made.inputs, (p1, p2), strict=True))
    running = Running(prototypes=[STEP], sorts={})
    running.instance.add((*JOINED[:4], replace(made, made=replace(made.made, inputs=terms)), JOINED[5]), 0)
    pushes = sorted((s.available_us, i, s) for i, f in enumerate((one, other)) for s in f)
    for at_us, together in groupby(pushes, itemgetter(0)):
        with running.network.instant.whole():
            for _, i, s in together:
                running.instance.push(f"s{i}", Sample(at_us, s.valid_us, s.value))
    assert [s for _, s in running.outputs] == thesis.refined(step, run(one, p1)[0], run(other, p2)[0])


@definition
@given(gridded_streams(), policies())
def test_definition_4_5_12_a_declared_stream_is_what_its_policy_makes_of_the_label(
    f: list[Sample], policy: Policy
) -> None:
    f, policy = in_ms(f, policy)
    running = Running()
    named = replace(NAMED[2], term=replace(NAMED[2].term, policy=policy))  # type: ignore[call-arg,union-attr]
    running.instance.add((*NAMED[:2], named), 0)
    for s in f:
        pass_time(running.network, s.available_us)
        running.instance.push("s", s)
    horizon_us = max([s.available_us for s in f], default=0) + 500 * MS
    pass_time(running.network, horizon_us + 1)
    expected, _ = run(f, policy, horizon_us)
    assert [s for _, s in running.outputs] == expected


def test_example_4_5_3_a_generator_has_the_samples_of_its_source() -> None:
    running = instance(parse_specification("source thing pos_car1\nstrmgen pos[car1] = pos_car1"))
    provided = {250: (200, "p1"), 325: (300, "p2"), 430: (400, "p3"), 505: (500, "p4")}
    for t in range(600):
        if t in provided:
            running.instance.push("pos_car1", Sample(t, *provided[t]))
    assert held(running, "pos[car1]") == [Sample(t, *provided[t]) for t in provided]
