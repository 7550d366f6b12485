"""Chronicles over the live streams of a platform, asked for from elsewhere (thesis 8.2, language.md)."""

import pytest

from dyknow import Sample, prototypes_in, source
from dyknow.agents.config import PlatformConfig
from dyknow.agents.monitoring.recognitions import MOST_OF_ONE, Recognitions
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Expected, Reason, Recognise, Recognised
from dyknow.sim_uavs.world.world import World

TURN = """
chronicle turns[?car, ?from, ?to] {
    event(link[?car]:(?from, no_link), t1)
    event(link[?car]:(no_link, ?to), t2)
    t1 < t2
    t2 - t1 <= 1s
}
"""
PERIOD_US = 500_000


@source("link")
def links(from_us):
    """A car that turns every two seconds, between two links."""
    for n in range(1_000_000):
        valid_us = (from_us // PERIOD_US + 1 + n) * PERIOD_US
        yield valid_us, ("l1", "no_link", "l2", "no_link")[valid_us // PERIOD_US % 4]


@pytest.fixture
def world():
    found = World(1, truth_us=None)
    ours = {each.name: each for each in prototypes_in([links])}
    for unit in ("0", "1"):
        found.add(unit, PlatformConfig(unit, 0, catalogue=ours.get))
    found.specify("1", "source link links\nstrmgen link[a] = links\n")
    found.run_for(1)
    return found


def ask(world, **given):
    return world.ask("0", "1", Recognise(**{"text": TURN, "timeout_s": 8.0, **given}), Performative.SUBSCRIBE)


def recognised(dialogue):
    return [said for said in dialogue.results if isinstance(said, Recognised)]


def running(world):
    return [
        label
        for label in world.platform("1").ports.network.labels()
        if world.platform("1").ports.network.generator(label).subscriptions
    ]


def test_each_instance_is_told_when_it_is_certain_and_the_end_when_the_time_is_over(world):
    assert running(world) == []
    dialogue = ask(world, delay_s=0.2)
    world.run_for(6)
    found = recognised(dialogue)
    assert len(found) in {4, 5}
    assert {(each.bindings["?from"], each.bindings["?to"]) for each in found} == {("l1", "l2"), ("l2", "l1")}
    for each in found:
        assert each.chronicle == "turns"
        assert each.recognised_us == each.instants["t2"] == each.instants["t1"] + PERIOD_US
    heard_us = {e.act.seq: e.at_us for e in world.platform("0").ports.agent.audit_log.entries if e.direction == "in"}
    times = [(said.recognised_us, heard_us[act.seq]) for act, said in dialogue.said if isinstance(said, Recognised)]
    assert all(200_000 <= at_us - certain_us <= 300_000 for certain_us, at_us in times)
    world.run_for(4)
    assert dialogue.said[-1][1] == Reason(text="its time is over")
    assert running(world) == []


def test_who_does_not_want_to_know_any_more_ends_it(world):
    dialogue = ask(world, timeout_s=600.0)
    world.run_for(4)
    world.cancel("0", "1", dialogue.conversation)
    world.run_for(1)
    heard = len(recognised(dialogue))
    world.run_for(4)
    assert heard
    assert len(recognised(dialogue)) == heard
    assert running(world) == []
    assert world.platform("1").part(Recognitions).deadline_us is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("chronicle turns { event(", "never closed"),
        ("domain d = {a}\n", "at least one chronicle"),
        ("chronicle t[?a] { event(link[?a]:(?, l1), t1) event(link[?a]:(?, l2), t2) t1 < t2 t2 < t1 }", "t1"),
    ],
)
def test_what_cannot_be_recognised_is_refused_in_words(world, text, said):
    dialogue = ask(world, text=text)
    world.run_for(1)
    ((act, why),) = dialogue.said
    assert act.performative is not Performative.AGREE
    assert isinstance(why, Reason)
    assert said in why.text
    assert running(world) == []


def test_one_member_watches_for_no_more_than_a_few_and_leaves_room_for_others(world):
    world.add_command_centre("cc")
    world.run_for(1)
    dialogues = [ask(world) for _ in range(MOST_OF_ONE + 1)]
    world.run_for(1)
    assert [dialogue.said[0][0].performative.value for dialogue in dialogues] == ["agree"] * MOST_OF_ONE + ["refuse"]
    other = world.ask("cc", "1", Recognise(text=TURN, timeout_s=8.0), Performative.SUBSCRIBE)
    world.run_for(1)
    assert other.said[0][0].performative.value == "agree", "there is room for others"


def test_what_may_become_an_instance_is_told_as_it_begins_and_when_it_is_over(world):
    dialogue = ask(world, delay_s=0.2, partial=True)
    world.run_for(6)
    told = [said for said in dialogue.results if isinstance(said, Expected)]
    begun = [each for each in told if not each.over]
    left = [each for each in begun if set(each.instants) == {"t1"}]
    assert {(each.bindings["?car"], each.bindings["?from"]) for each in left} == {("a", "l1"), ("a", "l2")}
    assert all(each.missing == ("event(link[?car]:(no_link, ?to), t2)",) for each in left)
    assert all(each.until_us - each.instants["t1"] == 1_001_000 for each in left)
    ends = [each.model_copy(update={"over": False}) for each in told if each.over]
    assert ends
    assert all(begun.index(each) >= 0 for each in ends)
    assert len(recognised(dialogue)) in {4, 5}
    world.cancel("0", "1", dialogue.conversation)
    world.run_for(1)
    assert running(world) == []


def test_samples_that_come_later_than_they_may_are_reported(world):
    part = world.platform("1").part(Recognitions)
    dialogue = ask(world, delay_s=0.0)
    world.run_for(1)
    (opened,) = part._open.values()
    network = world.platform("1").ports.network
    generator = network.generator("link[a]")
    now_us = network.now_us
    generator.push(Sample(now_us, now_us - PERIOD_US // 2, "l3"))
    world.run_for(2)
    assert opened.watch.ignored["late"] == 1
    assert [said.text for said in dialogue.results if isinstance(said, Reason) and "1 late" in said.text]


def test_no_chronicle_tells_of_a_stream_what_its_requester_may_not_see(world):
    label = 'label car-link : link in text "where a car is"\n'
    for receiver, seen in (("9", False), ("0", True)):
        export = f"{label}source link links\nstrmgen link[a] = links\nexport car-link = link[a] to {receiver}\n"
        world.specify("1", export)
        world.run_for(1)
        dialogue = ask(world)
        world.run_for(9)
        assert bool(recognised(dialogue)) is seen
        assert any("car-link" in said.text for said in dialogue.results if isinstance(said, Reason)) is not seen
