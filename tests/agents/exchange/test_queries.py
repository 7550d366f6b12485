"""Queries by semantic label: latest, at and between, of one platform and of all, with whoever does not answer named."""

from collections.abc import Callable

import pytest

from dyknow import US_PER_S, Sample, print_span
from dyknow.agents.platform import Platform
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.codec import decode_heartbeat
from dyknow.federation.messages.contents import (
    Answers,
    Content,
    Query,
    QueryStream,
    Reason,
    Samples,
    Search,
    SearchResult,
    StreamSamples,
)
from tests.box import Box, Question, Vehicle

P = Performative
LABEL = "heli-altitude"
CAPACITY = 4096 + 1024  # samples a local history may hold before it forgets


@pytest.fixture
def quiet(wire: Box) -> Platform:
    """Platform 0, whose vehicle says nothing, so that its samples are those of the test; and a command centre."""
    platform = wire.join("0", Vehicle(is_silent=True), simulated=True)
    wire.centre()
    wire.run(1.0)
    return platform


def push(platform: Platform, *samples: tuple[int, int, float]) -> None:
    """Samples of the label as (available, valid, altitude)."""
    history = platform.ports.network.generator(platform.built.gateway.local(LABEL)).history
    for available_us, valid_us, altitude in samples:
        history.add(Sample(available_us, valid_us, (altitude,)))


def ask(wire: Box, unit: str = "0", **query: object) -> Question:
    return wire.asked("cc", unit, Query(semantic_label=LABEL, **query), P.QUERY_REF)


def altitudes(contents: list[Content | None]) -> list[float]:
    """The values of all pages, in order."""
    return [
        reading.value["altitude_m"]  # type: ignore[index]  # no page of these tests holds no value
        for said in contents
        if isinstance(said, Samples)
        for reading in said.samples
    ]


def test_the_latest_is_the_sample_that_held_last_not_the_one_that_came_last(wire: Box, quiet: Platform) -> None:
    t = wire.now_us - US_PER_S
    push(quiet, (t, t, 1.0), (t + 1, t + 200_000, 2.0), (t + 2, t + 100_000, 3.0), (t + 3, t + 200_000, 4.0))
    assert altitudes(ask(wire).contents) == [4.0], "of equal valid times the one that was available last"


@pytest.mark.parametrize(
    ("at_us", "altitude"),
    [(0, 1.0), (99_999, 1.0), (100_000, 3.0), (150_000, 3.0), (399_999, 3.0), (400_000, 5.0), (900_000, 5.0)],
)
def test_at_an_instant_the_most_recent_sample_holds_through_ties_and_gaps(
    wire: Box, quiet: Platform, at_us: int, altitude: float
) -> None:
    t = wire.now_us - US_PER_S
    push(quiet, (t, t, 1.0), (t + 100_000, t + 100_000, 2.0), (t + 100_001, t + 100_000, 3.0))
    push(quiet, (t + 500_000, t + 400_000, 5.0))
    assert altitudes(ask(wire, op="at", at_us=t + at_us).contents) == [altitude]


def test_a_correction_that_came_late_holds_from_when_it_was_valid(wire: Box, quiet: Platform) -> None:
    t = wire.now_us - US_PER_S
    push(quiet, (t, t, 1.0), (t + 1, t + 300_000, 3.0), (t + 2, t + 100_000, 2.0))
    assert altitudes(ask(wire, op="at", at_us=t + 200_000).contents) == [2.0]
    assert altitudes(ask(wire, op="at", at_us=t + 300_000).contents) == [3.0]


def test_the_future_is_refused_as_not_yet(wire: Box, quiet: Platform) -> None:
    push(quiet, (wire.now_us, wire.now_us, 1.0))
    question = ask(wire, op="at", at_us=wire.now_us + 5 * US_PER_S)
    assert question.performatives == [P.REFUSE]
    assert "not yet: 5.0 s in the future" in question.reason


def test_before_the_first_sample_nothing_held(wire: Box, quiet: Platform) -> None:
    t = wire.now_us - US_PER_S
    push(quiet, (t, t, 1.0))
    question = ask(wire, op="at", at_us=t - 1)
    assert question.performatives == [P.FAILURE]
    assert question.reason == f"1 us before the first {LABEL} that is held, 1.0 s ago"


@pytest.mark.parametrize("query", [{"op": "at", "at_us": 0}, {"op": "between", "from_us": 0, "to_us": 50_000}])
def test_before_the_history_fails_and_names_its_start(wire: Box, quiet: Platform, query: dict[str, object]) -> None:
    t = wire.now_us - CAPACITY * 100
    push(quiet, *((t + 100 * n, t + 100 * n, float(n)) for n in range(CAPACITY)))
    starts_us = quiet.ports.network.generator(quiet.built.gateway.local(LABEL)).history.starts_us
    assert starts_us is not None
    assert starts_us > t + 50_000
    shifted = {name: t + value if isinstance(value, int) else value for name, value in query.items()}
    question = ask(wire, **shifted)
    assert question.performatives == [P.FAILURE]
    asked_us = shifted.get("at_us", shifted.get("from_us"))
    assert f"{print_span(starts_us - asked_us)} before the first {LABEL} that is held, " in question.reason
    assert altitudes(ask(wire, op="at", at_us=starts_us).contents) == [(starts_us - t) / 100]


def test_between_is_inclusive_ordered_by_valid_then_available_time_and_holds_corrections(
    wire: Box, quiet: Platform
) -> None:
    t = wire.now_us - US_PER_S
    push(quiet, (t, t, 1.0), (t + 1, t + 200_000, 3.0), (t + 2, t + 100_000, 2.0), (t + 3, t + 200_000, 3.5))
    push(quiet, (t + 4, t + 300_000, 4.0))
    assert altitudes(ask(wire, op="between", from_us=t, to_us=t + 300_000).contents) == [1.0, 2.0, 3.0, 3.5, 4.0]
    assert altitudes(ask(wire, op="between", from_us=t + 100_000, to_us=t + 200_000).contents) == [2.0, 3.0, 3.5]
    assert altitudes(ask(wire, op="between", from_us=t + 1, to_us=t + 99_999).contents) == []
    assert altitudes(ask(wire, op="between", from_us=t - 5, to_us=wire.now_us + US_PER_S).contents)[0] == 1.0


def test_5_3_2_the_nth_the_last_and_a_slice_are_counted_as_samples_became_available(wire: Box, quiet: Platform) -> None:
    t = wire.now_us - US_PER_S
    push(quiet, *((t + n, t + n * 10_000 * (-1) ** n, float(n)) for n in range(6)))
    nths = [altitudes(ask(wire, op="nth", n=n).contents) for n in range(6)]
    assert nths == [[5.0], [4.0], [3.0], [2.0], [1.0], [0.0]]
    assert altitudes(ask(wire, op="last", n=2).contents) == [4.0, 5.0]
    assert altitudes(ask(wire, op="last", n=99).contents) == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0], "as many as there are"
    assert altitudes(ask(wire, op="slice", i=1, j=3).contents) == [1.0, 2.0, 3.0]
    for query in ({"op": "nth", "n": 6}, {"op": "slice", "i": 0, "j": 6}):
        (said,) = ask(wire, **query).contents
        assert isinstance(said, Reason)
        assert "held" in said.text


def test_a_slice_longer_than_an_act_comes_in_pages_of_a_semantic_label_and_of_a_streams_own(
    wire: Box, quiet: Platform
) -> None:
    t = wire.now_us - US_PER_S
    push(quiet, *((t + n, t + n, float(n)) for n in range(600)))
    expected = [float(n) for n in range(600)]
    assert altitudes(ask(wire, op="slice", i=0, j=599).contents) == expected
    own = str(quiet.built.gateway.local(LABEL))
    asked = wire.asked("cc", "0", QueryStream(stream=own, op="last", n=600), P.QUERY_REF)
    pages = [said for said in asked.contents if isinstance(said, StreamSamples)]
    assert [page.more for page in pages] == [True, True, False]
    assert [reading.value["altitude_m"] for page in pages for reading in page.samples] == expected  # type: ignore[index]


def test_a_label_that_nobody_has_is_refused_with_those_there_are(wire: Box, quiet: Platform) -> None:
    question = wire.asked("cc", "0", Query(semantic_label="heli-altitud"), P.QUERY_REF)
    assert question.performatives == [P.REFUSE]
    assert LABEL in question.reason


def test_without_a_sample_there_is_a_failure_and_no_value_is_invented(wire: Box, quiet: Platform) -> None:
    question = ask(wire)
    assert question.performatives == []  # the vehicle may have started just now
    wire.run(1.0)
    assert question.performatives == [P.FAILURE]
    assert question.reason == f"{LABEL} had no sample, and none came within 1 s"


@pytest.mark.parametrize("scope", ["local", "global"])
def test_the_first_sample_answers_who_asked_before_it(wire: Box, quiet: Platform, scope: str) -> None:
    question = ask(wire, scope=scope)
    assert question.performatives == []
    now_us = quiet.clock.federation_us(wire.now_us)
    quiet.ports.network.generator(quiet.built.gateway.local(LABEL)).push(Sample(now_us, now_us, (31.0,)))
    wire.run(0.1)
    (content,) = question.contents
    (samples,) = content.answers if isinstance(content, Answers) else (content,)
    assert altitudes([samples]) == [31.0]


# Everybody


@pytest.fixture
def eight(wire: Box) -> list[str]:
    units = [str(number) for number in range(8)]
    for unit in units:
        wire.join(unit, Vehicle(east_m=500.0 * int(unit), altitude_m=100.0 + int(unit)), simulated=True)
    wire.centre()
    wire.run(2.0)
    return units


def test_one_frozen_platform_of_eight_delays_nobody_elses_answer(wire: Box, eight: list[str]) -> None:
    """As `dyknow query` does it: each platform is asked itself."""
    wire.freeze("3")
    questions = {unit: wire.question("cc", unit, Query(semantic_label=LABEL), P.QUERY_REF) for unit in eight}
    wire.run(0.01)
    answered = {unit for unit, question in questions.items() if question.answers}
    assert answered == set(eight) - {"3"}
    wire.run(3.0)
    assert questions["3"].answers == []
    assert questions["3"].failed


@pytest.mark.parametrize("query", [{}, {"op": "at"}, {"op": "between"}])
def test_of_a_question_to_all_the_missing_one_is_named_and_the_others_answers_are_there(
    wire: Box, eight: list[str], query: dict[str, object]
) -> None:
    at_us = wire.now_us - 500_000
    instants = {"at": {"at_us": at_us}, "between": {"from_us": at_us - 300_000, "to_us": at_us}}
    wire.freeze("3")
    asked = Query(semantic_label=LABEL, scope="global", **query, **instants.get(str(query.get("op")), {}))
    question = wire.question("cc", "0", asked, P.QUERY_REF)
    wire.run(1.9)
    (answers,) = question.contents
    assert isinstance(answers, Answers)
    assert {said.unit for said in answers.answers} == set(eight) - {"3"}
    assert {len(said.samples) for said in answers.answers} == ({4} if query.get("op") == "between" else {1})
    assert [missing.unit for missing in answers.missing] == ["3"]
    assert answers.missing[0].reason


def test_a_platform_that_lacks_the_instant_says_so_and_the_others_answer(wire: Box, eight: list[str]) -> None:
    at_us = wire.now_us - 500_000
    wire.join("8", Vehicle(east_m=5_000.0), simulated=True)
    wire.run(1.0)
    question = wire.question("cc", "0", Query(semantic_label=LABEL, op="at", at_us=at_us, scope="global"), P.QUERY_REF)
    wire.run(0.2)
    (answers,) = question.contents
    assert isinstance(answers, Answers)
    assert {said.unit for said in answers.answers} == set(eight)
    assert [missing.unit for missing in answers.missing] == ["8"]
    assert f"before the first {LABEL} that is held, " in answers.missing[0].reason


@pytest.mark.parametrize(("by", "least"), [("select", "newest"), ("select", "best"), ("merge", "mean")])
def test_of_all_answers_one_is_selected_or_made(wire: Box, eight: list[str], by: str, least: str) -> None:
    wire.freeze("3")
    question = wire.question("cc", "0", Query(semantic_label=LABEL, scope="global", **{by: least}), P.QUERY_REF)
    wire.run(1.9)
    (answers,) = question.contents
    assert isinstance(answers, Answers)
    assert answers.merged is not None
    assert [missing.unit for missing in answers.missing] == ["3"]


@pytest.fixture
def missing(wire: Box, eight: list[str]) -> Callable[[], tuple[str, ...]]:
    """Whom platform 0 misses."""

    def asked() -> tuple[str, ...]:
        (found,) = wire.asked("cc", "0", Search(), P.QUERY_REF).contents
        assert isinstance(found, SearchResult)
        return found.missing_units

    return asked


def test_who_fell_silent_is_missed_until_it_returns(wire: Box, missing: Callable[[], tuple[str, ...]]) -> None:
    assert missing() == ()
    wire.freeze("3")
    wire.run(1.5)
    assert missing() == ("3",)
    wire.run(0.5)
    wire.wire.expire("3")
    wire.run(3.0)
    assert missing() == ("3",), "gone from the directory, not from memory, also when its session expires"
    wire.run(90.0)
    assert missing() == ("3",)
    wire.thaw("3")
    wire.run(1.0)
    assert missing() == ()


def test_who_fell_silent_and_returns_is_not_missed(wire: Box, missing: Callable[[], tuple[str, ...]]) -> None:
    wire.freeze("3")
    wire.run(5.0)
    wire.thaw("3")
    wire.run(1.0)
    assert missing() == ()


def test_who_left_is_not_missed(wire: Box, missing: Callable[[], tuple[str, ...]]) -> None:
    wire.leave("5")
    wire.run(1.0)
    assert missing() == ()


def test_who_crashed_is_missed_within_a_second(wire: Box, missing: Callable[[], tuple[str, ...]]) -> None:
    wire.kill("6")
    wire.run(0.9)
    assert missing() == ("6",)


def test_who_crashed_is_not_said_to_be_heard_once_it_is_gone(wire: Box, eight: list[str]) -> None:
    wire.kill("6")
    wire.run(0.6)
    gone_us = wire.now_us
    wire.run(0.5)
    beats = [
        decode_heartbeat(c.put.payload) for c in wire.wire.log if c.at_us > gone_us and c.put.key.startswith("hb/")
    ]
    assert {beat.unit for beat in beats} == set(eight) - {"6"} | {"cc"}
    assert not any("6" in beat.hears for beat in beats)
