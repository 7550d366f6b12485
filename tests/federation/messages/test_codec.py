import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.federation.messages import codec
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.codec import Heartbeat, Ping, Pong, Range, Recovered, StreamSample
from dyknow.federation.messages.descriptions import Description, LabelEntry, ServiceEntry
from dyknow.federation.messages.sexpr import MAX_DEPTH, Expr, QuotedText
from dyknow.model.errors import ContentError, DecodeError
from dyknow.model.sample import MAX_BRANCH, SURE, Predicted, Quality
from dyknow.model.values import NO_VALUE
from tests.federation import schema
from tests.federation.mutants import encode
from tests.federation.strategies import ACTS, COUNTS, INSTANTS

FLOATS = st.floats(-1e30, 1e30)
SCALARS = st.one_of(FLOATS, st.integers(-(2**63), 2**63 - 1), st.booleans(), st.text(max_size=5), st.just(NO_VALUE))
SAMPLE = (
    st.integers(1, 2**62),
    INSTANTS,
    st.one_of(SCALARS, st.lists(SCALARS | st.lists(FLOATS, max_size=2).map(tuple), max_size=4).map(tuple)),
)
COVARIANCES = st.integers(0, 3).flatmap(
    lambda size: st.lists(st.lists(FLOATS, min_size=size, max_size=size).map(tuple), min_size=size, max_size=size).map(
        tuple
    )
)
PREDICTIONS = st.none() | st.builds(
    Predicted, INSTANTS, st.sampled_from(["", "left", "x" * MAX_BRANCH]), st.floats(0, 1)
)
QUALITIES = st.just(SURE) | st.builds(Quality, st.floats(0, 1), COVARIANCES, PREDICTIONS)
SAMPLES = st.lists(st.builds(StreamSample, *SAMPLE, QUALITIES), max_size=4)
ACT = Act(Performative.INFORM, AgentName("interface", "1"), AgentName("interface", "0"), Expr("done"), "1-1-1")


@given(ACTS)
def test_an_act_comes_back_as_it_was_sent(act: Act) -> None:
    payload = codec.encode_act(act)
    again, signature, _ = codec.decode_act(payload)
    assert again == act
    assert signature is None
    assert str(again) == str(act), "symbols and texts apart"
    assert schema.act(payload)


@given(ACTS, st.binary(min_size=64, max_size=64))
def test_the_signature_is_over_the_bytes_that_travel(act: Act, mark: bytes) -> None:
    over: list[bytes] = []

    def sign(body: bytes) -> bytes:
        over.append(body)
        return mark

    payload = codec.encode_act(act, sign)
    assert codec.decode_act(payload)[1:] == (mark, over[0])


@given(COUNTS, SAMPLES)
def test_samples_come_back_as_they_were_sent(boot: int, samples: list[StreamSample]) -> None:
    payload = codec.encode_samples(boot, samples)
    assert codec.decode_samples(payload) == (boot, tuple(samples), (), 1)
    assert schema.samples(payload)
    riders = (codec.Rider("heli-altitude", "0123abcd", tuple(samples)), codec.Rider("heli-height", "deadbeef", ()))
    payload = codec.encode_samples(boot, samples, riders=riders)
    assert codec.decode_samples(payload) == (boot, tuple(samples), riders, 1)
    assert schema.samples(payload)
    payload = codec.encode_samples(boot, samples, riders=riders, every=8)
    assert codec.decode_samples(payload) == (boot, tuple(samples), riders, 8)
    assert schema.samples(payload)
    answer = Recovered(boot, 1, 5, samples)
    assert codec.decode_recovered(codec.encode_recovered(answer)) == answer


def test_the_other_messages_come_back_as_they_were_sent() -> None:
    heartbeat = Heartbeat("0", 5, 6, 7, 8, ("1", "uav1"), (("heli-position", "ab12cd34", 9),))
    assert codec.decode_heartbeat(codec.encode_heartbeat(heartbeat)) == heartbeat
    question = Range("ab12cd34", 5, ((1, 2), (4, 4)))
    assert codec.decode_range(codec.encode_range(question)) == question
    assert codec.decode_ping(codec.encode_ping(Ping(-5))) == Ping(-5)
    assert codec.decode_pong(codec.encode_pong(Pong(1, 2, 3, 4))) == Pong(1, 2, 3, 4)
    description = Description(
        unit="0",
        boot=1,
        version=2,
        kind="uav",
        services=(ServiceEntry(agent="interface", service="alarms", visibility="public"),),
        labels=(LabelEntry(label="heli-position", sort="position", type_hash="ab12cd34", period_us=100_000),),
    )
    assert codec.decode_description(codec.encode_description(description)) == description


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"", "malformed"),
        (bytes(65_537), "oversized"),
        (b"\xc1", "malformed"),
        (b"\x93\x01\x05\x90\x00", "malformed"),
        (b"\x93\x01\x05", "malformed"),
        (b"\x92\x01\x05", "shape"),
        (b"\x93\x02\x05\x90", "version"),
        (b"\x93\xc3\x05\x90", "version"),
        (encode([1, -1, []]), "number"),
        (encode([1, True, []]), "number"),
        (encode([1, 2**63, []]), "number"),
        (encode([1, 5, [[0, 5, 1.0]]]), "number"),
        (encode([1, 5, [[1, 5.0, 1.0]]]), "number"),
        (encode([1, 5, [[1, 5]]]), "shape"),
        (encode([1, 5, [[1, 5, float("nan")]]]), "number"),
        (encode([1, 5, [[1, 5, [1.0, float("-inf")]]]]), "number"),
        (encode([1, 5, [[1, 5, 1.1e30]]]), "number"),
        (encode([1, 5, [[1, 5, [1.0, -1.1e30]]]]), "number"),
        (encode([1, 5, [[1, 6 * 10**16 + 1, 1.0]]]), "number"),
        (encode([1, 5, [[1, 5, "x" * 16_385]]]), "type"),
        (encode([1, 5, [[1, 5, b"x"]]]), "type"),
        (encode([1, 5, [[1, 5, {"a": 1}]]]), "type"),
        (encode([1, 5, [[1, 5, [[[[[1.0]]]]]]]]), "nesting"),
        (encode([1, 5, [[1, 5, 1.0]] * 1025]), "malformed"),
        (encode([1, 5, [[1, 5, 1.0, 1.0, [], 5]]]), "shape"),
        (encode([1, 5, [[1, 5, 1.0, 1.0, [], 5.0, "", 1.0]]]), "number"),
        (encode([1, 5, [[1, 5, 1.0, 1.0, [], 5, "x" * 65, 1.0]]]), "name"),
        (encode([1, 5, [[1, 5, 1.0, 1.0, [], 5, "\x1b[2J", 1.0]]]), "name"),
        (encode([1, 5, [[1, 5, 1.0, 1.0, [], 5, "", 1.5]]]), "number"),
        (encode([1, 5, [], 7]), "shape"),
        (encode([1, 5, [], [], []]), "number"),
        (encode([1, 5, [], [], 0]), "number"),
        (encode([1, 5, [], [], 17]), "number"),
        (encode([1, 5, [], [], 2, 2]), "shape"),
        (encode([1, 5, [], [["heli-altitude", "0123abcd"]]]), "shape"),
        (encode([1, 5, [], [["no label", "0123abcd", []]]]), "name"),
        (encode([1, 5, [], [["heli-altitude", "../*/**0", []]]]), "name"),
        (encode([1, 5, [], [["heli-altitude", "0123abcd", [[0, 5, 1.0]]]]]), "number"),
        (encode([1, 5, [], [["heli-altitude", "0123abcd", []]] * 17]), "shape"),
    ],
)
def test_samples_are_refused_for_a_reason(payload: bytes, reason: str) -> None:
    with pytest.raises(DecodeError) as refused:
        codec.decode_samples(payload)
    assert refused.value.reason == reason


def _with(at: int, value: object) -> bytes:
    body = [
        1,
        "inform",
        "interface@1",
        "interface@0",
        {"": "done"},
        "1-1-1",
        None,
        None,
        None,
        None,
        None,
        None,
        None,
        None,
        1,
        1,
        1,
        [],
    ]
    body[at] = value
    return encode([encode(body), None])


@pytest.mark.parametrize(
    ("at", "value", "reason"),
    [
        (0, 2, "version"),
        (1, "shout", "performative"),
        (2, "interface@all", "name"),
        (2, "interface@a/b", "name"),
        (3, "interface", "name"),
        (3, 5, "name"),
        (4, {"a": 1}, "content"),
        (4, 5, "content"),
        (4, {"": "Done"}, "head"),
        (4, {"": None, "a": 1}, "head"),
        (4, {"": "done", "a b": 1}, "name"),
        (4, {"": "done", "a": float("nan")}, "not finite"),
        (4, {"": "done", "a": b"\xff"}, "malformed"),
        (4, {"": "done", "a": 2**63}, "number"),
        (5, "a/b", "name"),
        (5, "a\n", "name"),
        (9, -1, "number"),
        (13, "interface@all", "name"),
        (15, True, "number"),
        (17, [1] * 257, "shape"),
        (17, [-1], "number"),
    ],
)
def test_acts_are_refused_for_a_reason(at: int, value: object, reason: str) -> None:
    with pytest.raises(DecodeError) as refused:
        codec.decode_act(_with(at, value))
    assert refused.value.reason == reason


def test_a_content_nests_as_deep_as_its_text() -> None:
    value: object = 5
    for _ in range(MAX_DEPTH - 1):
        value = [value]
    act = codec.decode_act(_with(4, {"": "done", "a": value}))[0]
    assert codec.decode_act(codec.encode_act(act))[0] == act
    with pytest.raises(DecodeError, match="nesting"):
        codec.decode_act(_with(4, {"": "done", "a": [value]}))


@pytest.mark.parametrize("value", [QuotedText("x") * 70_000, 2**70, object(), "\ud800"])
def test_what_no_act_can_carry_is_refused_where_it_is_said(value: object) -> None:
    with pytest.raises(ContentError):
        codec.encode_act(Act(ACT.performative, ACT.sender, ACT.receiver, Expr("done", {"a": value})))


def test_a_private_service_is_not_described() -> None:
    service = {"agent": "gateway", "service": "local-instance", "visibility": "private"}
    with pytest.raises(DecodeError, match="visibility"):
        codec.decode_description(
            encode([1, {"unit": "0", "boot": 1, "version": 1, "kind": "uav", "services": [service]}])
        )
