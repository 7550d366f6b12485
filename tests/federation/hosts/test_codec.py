"""What a platform and its hosts say to each other, as bytes: everything well-formed comes through, nothing else does."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import NO_VALUE, SURE, Predicted, Quality, Sample
from dyknow.federation.hosts.codec import decode_from_host, decode_from_platform, encode, pack_sample
from dyknow.federation.hosts.messages import (
    KEPT,
    KEPT_BYTES,
    SAMPLES_BYTES,
    Backlog,
    Beat,
    Begin,
    Chain,
    End,
    FieldOffer,
    HostFault,
    HostInput,
    HostInputs,
    HostOutput,
    Refuse,
    Register,
    SortOffer,
    SourceOffer,
    UnitOffer,
    Want,
    Welcome,
)
from dyknow.federation.messages.unpacking import MAX_BYTES, VERSION
from dyknow.model.errors import ContentError, DecodeError
from dyknow.policies.sampling import Grid
from tests.federation.mutants import NASTY
from tests.federation.mutants import encode as packed

counts = st.integers(0, 2**62)
instants = st.integers(-(6 * 10**16), 6 * 10**16)
names = st.from_regex(r"\A\??[A-Za-z_][A-Za-z0-9_.-]{0,20}\Z")
texts = st.text(st.characters(codec="utf-8"), max_size=40)
labels = st.sampled_from(["a", "a[self]", "cars.speed[car1, 2]"])
simple = st.floats(-1e30, 1e30) | st.integers(-(2**63), 2**63 - 1) | st.booleans() | texts | st.just(NO_VALUE)
values = simple | st.lists(simple | st.lists(simple, max_size=3).map(tuple), max_size=5).map(tuple)
numbers = st.floats(-1e30, 1e30)
square = st.integers(0, 3).flatmap(lambda n: st.tuples(*[st.tuples(*[numbers] * n)] * n))
predictions = st.none() | st.builds(Predicted, instants, st.just("left"), st.floats(0, 1))
qualities = st.just(SURE) | st.builds(Quality, st.floats(0, 1), square, predictions)
samples = st.builds(Sample, instants, instants, values, qualities)
grids = st.none() | st.builds(Grid, st.integers(1, 10**9), st.none() | instants)
units = st.builds(
    UnitOffer,
    names,
    names,
    st.lists(names, min_size=1, max_size=3).map(tuple),
    st.just(False),
    counts,
    st.just(""),
    instants,
)
sources = st.builds(SourceOffer, names, names, st.just("") | labels)
offers = st.lists(units | sources, unique_by=lambda each: each.name, max_size=6)
registers = st.builds(
    lambda pid, module, train, found: Register(
        pid, module, train,
        tuple(each for each in found if isinstance(each, UnitOffer)),
        tuple(each for each in found if isinstance(each, SourceOffer)),
        (SortOffer("gas", "ppm", ()), SortOffer("wind", "", (FieldOffer("north", "m/s"),))),
    ),
    counts, texts, st.booleans(), offers,
)  # fmt: skip
from_host = (
    registers
    | st.builds(HostOutput, counts, counts, counts, st.booleans(), st.lists(samples, max_size=5).map(tuple))
    | st.builds(HostFault, counts, texts)
    | st.builds(Beat, counts)
)
from_platform = (
    st.builds(Welcome, texts, st.lists(texts, max_size=3).map(tuple), instants, st.floats(1e-3, 1e6), instants)
    | st.builds(Refuse, texts)
    | st.builds(Begin, counts, names, labels, instants, st.sampled_from(["", "sample every 100"]), grids)
    | st.builds(Want, counts, grids)
    | st.builds(
        HostInputs,
        counts,
        st.booleans(),
        st.lists(st.builds(HostInput, st.integers(0, 63), samples), max_size=5).map(tuple),
    )
    | st.builds(Chain, counts, counts, counts, counts)
    | st.builds(End, counts)
)


@given(from_host)
def test_what_a_host_says_is_what_the_platform_hears(message) -> None:
    assert decode_from_host(encode(message)) == message


@given(from_platform)
def test_what_the_platform_says_is_what_a_host_hears(message) -> None:
    assert decode_from_platform(encode(message)) == message


@given(from_host, from_platform)
def test_neither_takes_what_is_for_the_other(said, told) -> None:
    with pytest.raises(DecodeError, match="kind"):
        decode_from_platform(encode(said))
    with pytest.raises(DecodeError, match="kind"):
        decode_from_host(encode(told))


def understood_or_refused(payload: bytes) -> bool:
    """Whoever takes it can say it again and means the same."""
    for decode in (decode_from_host, decode_from_platform):
        with contextlib.suppress(DecodeError):
            message = decode(payload)
            assert decode(encode(message)) == message
    return True


@given(st.binary(max_size=400))
def test_any_bytes_are_a_message_or_a_decode_error(payload: bytes) -> None:
    assert understood_or_refused(payload)


plain = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats()
    | st.text(max_size=20)
    | st.binary(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=2),
    max_leaves=12,
)


@given(st.integers(0, 12), st.lists(plain | st.sampled_from(NASTY), max_size=8))
def test_any_fields_are_a_message_or_a_decode_error(kind: int, fields: list) -> None:
    payload = packed([VERSION, kind, *fields])
    assert understood_or_refused(payload)


@given(from_host | from_platform, st.data())
def test_a_message_with_some_of_its_bytes_changed_is_a_message_or_a_decode_error(message, data) -> None:
    payload = bytearray(encode(message))
    for at in data.draw(st.lists(st.integers(0, len(payload) - 1), max_size=4)):
        payload[at] = data.draw(st.integers(0, 255))
    assert understood_or_refused(bytes(payload))


class Metres(float):
    """As units of users are, that return numbers of a library."""


@pytest.mark.parametrize(
    ("value", "heard"),
    [(Metres(2.5), 2.5), (frozenset({"b", "a"}), ("a", "b")), ((Metres(1.0), NO_VALUE), (1.0, NO_VALUE))],
)
def test_values_become_plain_on_the_way(value, heard) -> None:
    (sample,) = decode_from_host(encode(HostOutput(1, 0, 0, False, (Sample(1, 2, value),)))).samples
    assert sample.value == heard
    assert type(sample.value) in {float, tuple}


@pytest.mark.parametrize(
    "value",
    [
        [1],
        {"a": 1},
        object(),
        float("nan"),
        (1.0, float("inf")),
        2**64,
        "\ud800",
        "x" * MAX_BYTES,
        ((((((1,),),),),),),
        b"x",
    ],
)
def test_a_value_that_cannot_be_said_is_told_where_it_arises(value) -> None:
    with pytest.raises(ContentError):
        pack_sample(Sample(1, 2, value))


@pytest.mark.parametrize(
    "quality",
    [Quality(2.0), Quality(float("nan")), Quality(1.0, ((1.0, 2.0),)), Quality(1.0, ((float("inf"),),)), Quality("x")],
)
def test_so_is_a_quality_that_is_none(quality) -> None:
    with pytest.raises(ContentError):
        pack_sample(Sample(1, 2, 3.0, quality))


@pytest.mark.parametrize("valid_us", [2**63, -(2**63) - 1, 1.5, "now", None])
def test_so_is_a_time_that_is_none(valid_us) -> None:
    with pytest.raises(ContentError):
        pack_sample(Sample(1, valid_us, 3.0))


def test_a_quality_becomes_plain_on_the_way() -> None:
    sample = Sample(1, 2, 3.0, Quality(1, ((Metres(4.0),),)))
    assert decode_from_host(encode(HostOutput(1, 0, 0, False, (sample,)))).samples == (
        Sample(1, 2, 3.0, Quality(1.0, ((4.0,),))),
    )


@given(st.lists(st.tuples(st.integers(0, 2), st.integers(0, SAMPLES_BYTES // 2)), max_size=50), st.integers(0, 60))
def test_samples_travel_together_as_far_as_a_message_reaches_and_in_order(given_samples, most) -> None:
    backlog = Backlog()
    for number, (mark, size) in enumerate(given_samples):
        assert backlog.put(mark, number.to_bytes(2) + bytes(size)) == 0
    taken = list(backlog.take(most))
    numbers = [int.from_bytes(each[:2]) for _, together in taken for each in together]
    assert numbers == list(range(min(most, len(given_samples))))
    for mark, together in taken:
        assert sum(map(len, together)) <= SAMPLES_BYTES
        assert {given_samples[int.from_bytes(each[:2])][0] for each in together} == {mark}


def test_what_waits_is_bounded_in_number_and_in_bytes_and_the_newest_stay() -> None:
    many, large = Backlog(), Backlog()
    assert sum(many.put(0, number.to_bytes(2)) for number in range(KEPT + 5)) == 5
    assert sum(large.put(0, bytes(30_000)) for _ in range(KEPT)) == KEPT - KEPT_BYTES // 30_000
    assert next(iter(many.take(1))) == (0, [(5).to_bytes(2)])
    assert many.dropped == 5


def test_a_message_that_is_too_long_is_not_said() -> None:
    offered = tuple(UnitOffer(f"u{number}", "s" * 64, ("t" * 64,) * 8, False, 0, "", 0) for number in range(200))
    with pytest.raises(ContentError, match="at most"):
        encode(Register(1, "m", False, offered, ()))


def test_long_words_are_cut_and_not_refused() -> None:
    assert len(decode_from_host(encode(HostFault(1, "\ud800" + "x" * 9999))).said) == 300
