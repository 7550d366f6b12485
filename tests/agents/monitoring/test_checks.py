"""`dyknow check` over whatever streams a platform has: those of its specification like those of its vehicle (7.5)."""

from itertools import count
from typing import Any

import pytest

from dyknow import Label, Sample, prototypes_in, source
from dyknow.agents.monitoring.checks import Checks
from dyknow.agents.platform import Platform
from dyknow.agents.specification.specification_part import SpecificationPart
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import CheckFormula, Verdict
from dyknow.kpl import parse_specification
from tests.agents.specification.test_specification_part import Pair, places
from tests.box import Box

PERIOD_US = 100_000


@source("number")
def speeds(from_us: int) -> Any:
    """Faster and faster, and slow again."""
    return (
        (valid_us, float(valid_us // PERIOD_US % 40))
        for valid_us in count(-(-from_us // PERIOD_US) * PERIOD_US, PERIOD_US)
    )


@source("object")
def cars(from_us: int) -> Any:
    return ((valid_us, ("car1", "car2")) for valid_us in count(-(-from_us // 1_000_000) * 1_000_000, 1_000_000))


@source("link")
def links(from_us: int) -> Any:
    return (
        (valid_us, ("l1", "no_link")[valid_us // 500_000 % 2])
        for valid_us in count(-(-from_us // PERIOD_US) * PERIOD_US, PERIOD_US)
    )


SPECIFICATION = """
source number speeds
source object cars
source link links
source place places
strmgen speed[car1] = speeds
strmgen speed[car2] = speeds
strmgen car_ids = cars
strmgen link[car1] = links
strmgen pos[car1] = places
define LIMIT = 30
define fast[c] = speed[c] > LIMIT
"""


@pytest.fixture
def pair() -> Any:
    found = Pair("", "")
    found.world.platform("0").part(SpecificationPart).instance.offer(prototypes_in([speeds, cars, links, places]), 0)
    found.specify("0", SPECIFICATION)
    assert found.notes("0") == []
    return found


def asked(pair: Any, text: str, timeout_s: float = 8.0) -> tuple[list[Performative], Any]:
    dialogue = pair.world.ask("1", "0", CheckFormula(text=text, timeout_s=timeout_s), Performative.REQUEST)
    pair.world.run_for(timeout_s + 1)
    return [act.performative for act, _ in dialogue.said], dialogue.said[-1]


@pytest.mark.parametrize(
    ("text", "verdict", "label"),
    [
        ("eventually fast[car1]", "true", "speed[car1]"),
        ("always speed[car1] < LIMIT", "false", "speed[car1]"),
        ("always forall c in car_ids: not fast[c]", "false", "speed[car1]"),
        ('eventually[0, 2s] (link[car1] = "no_link" and speed[car2] >= 0)', "true", "link[car1]"),
    ],
)
def test_a_formula_over_streams_of_the_specification_is_decided_with_the_samples_that_did(
    pair: Any, text: str, verdict: str, label: str
) -> None:
    performatives, (_, said) = asked(pair, text)
    assert performatives == [Performative.AGREE, Performative.INFORM]
    assert isinstance(said, Verdict)
    assert (said.verdict, said.no_value, said.missing) == (verdict, (), ())
    assert said.valid_us is not None
    assert said.index is not None
    assert label in said.because[0].samples
    assert label in said.states
    assert parse_specification(said.states)
    network = pair.world.platform("0").ports.network
    assert not network.generator(Label.parse(label)).subscriptions, "who knows asks no more"


def test_a_formula_speaks_of_streams_of_the_specification_and_of_derived_features_together(pair: Any) -> None:
    pair.specify(
        "0", f"{SPECIFICATION}source altitude fed\nstrmgen alt[self] = fed\nexport heli-altitude = alt[self]\n"
    )
    instance = pair.world.platform("0").part(SpecificationPart).instance
    text = "always (speed[car1] < LIMIT or altitude[self] > 100)"
    dialogue = pair.world.ask("1", "0", CheckFormula(text=text, timeout_s=8.0), Performative.REQUEST)
    for _ in range(80):
        now_us = pair.world.platform("0").ports.network.now_us // PERIOD_US * PERIOD_US
        instance.push("fed", Sample(pair.world.platform("0").ports.network.now_us, now_us, (90.0,)))
        pair.world.run_for(0.1)
    said = dialogue.said[-1][1]
    assert (said.verdict, said.no_value, said.missing) == ("false", (), ())
    assert {label: value for one in said.because for label, value in one.samples.items()} == {
        "speed[car1]": 30.0,
        "altitude[0]": 90.0,
    }
    assert "heli-altitude[0] with sample every 100" in said.states
    assert not pair.world.platform("0").ports.network.has(Label("altitude", ("0",))), "who knows asks no more"


def test_what_brings_nothing_is_named_when_the_time_is_over(pair: Any) -> None:
    pair.specify("0", f"{SPECIFICATION}source number fed\nstrmgen speed[car3] = fed\n")
    _, (_, said) = asked(pair, "always (speed[car1] >= 0 and speed[car3] > 0)", 1.0)
    assert (said.verdict, said.no_value, said.missing) == ("undecided", ("speed[car3]",), ("speed[car3]",))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("always sped[car1] < 30", ("nothing here makes sped", "speed")),
        ("always speed[car9] < 30", ("nothing here makes speed[car9]", "write: speed[car")),
        ("always (speed[car1] < 30 and altitude[self] > 3)", ("heli-altitude",)),
        ("always forall c in cars_ids: fast[c]", ("there is no domain cars_ids", "car_ids")),
    ],
)
def test_what_cannot_be_checked_is_refused_in_words_and_leaves_nothing(
    pair: Any, text: str, words: tuple[str, ...]
) -> None:
    performatives, (_, said) = asked(pair, text, 0.5)
    assert len(performatives) == 1
    assert performatives[0] in {Performative.REFUSE, Performative.NOT_UNDERSTOOD}
    for each in words:
        assert each in str(said)
    assert pair.world.platform("0").part(Checks)._open == {}


def test_a_monitor_is_over_a_declared_stream_that_is_called_like_a_derived_feature(pair: Any) -> None:
    pair.specify("0", f"{SPECIFICATION}monitor slow = always not fast[car1]\n")
    pair.world.run_for(9)
    assert pair.told("0", "alarm-opened")
    assert pair.declared("0").instance.monitors.keys() == {"slow"}


# Streams of the vehicle


def test_a_formula_is_checked_until_it_is_decided(wire: Box, node: Platform) -> None:
    wire.run(1.0)
    question = wire.question("cc", "0", CheckFormula(text="eventually[0s, 2s] altitude[self] > 1000.0", timeout_s=9.0))
    wire.run(4.0)
    assert question.performatives == [Performative.AGREE, Performative.INFORM]
    (said,) = [c for c in question.contents if isinstance(c, Verdict)]
    assert (said.verdict, said.index is not None) == ("false", True)
    (because,) = said.because
    assert (because.part, because.holds) == ("altitude[0] > 1000.0", False)
    assert because.samples.keys() == {"altitude[0]"}
    assert because.until_us - because.since_us == 2_000_000
    assert node.part(Checks)._open == {}


def test_an_undecided_formula_names_what_never_had_a_value(wire: Box, node: Platform) -> None:
    """A vehicle that has reported where it is, and not how full its battery is."""
    wire.run(1.0)
    text = "always (battery[self] > 0.0 and altitude[self] > 0.0)"
    question = wire.question("cc", "0", CheckFormula(text=text, timeout_s=1.0))
    wire.run(2.0)
    (said,) = [c for c in question.contents if isinstance(c, Verdict)]
    assert (said.verdict, said.index) == ("undecided", None)
    assert said.no_value == ("battery[0]",)
    assert said.missing == ("battery[0]",)


def test_a_formula_about_a_stream_that_is_not_there_is_refused_and_leaves_nothing(wire: Box, node: Platform) -> None:
    question = wire.asked("cc", "0", CheckFormula(text="always xy_dist[self, 1] > 5.0"))
    assert question.performatives == [Performative.REFUSE]
    assert node.part(Checks)._open == {}
    assert node.part(Checks).deadline_us is None
    wire.run(3.0)


def test_who_does_not_want_to_know_any_more_cancels_the_check(wire: Box, node: Platform) -> None:
    wire.run(1.0)
    question = wire.asked("cc", "0", CheckFormula(text="always altitude[self] > 0.0", timeout_s=60.0))
    assert len(node.part(Checks)._open) == 1
    wire.cancel("cc", "0", question.conversation)
    wire.run(0.5)
    assert node.part(Checks)._open == {}
    assert node.ports.agent.conversations.conversations() == []
