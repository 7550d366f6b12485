"""Offers and calls: the right proposal is taken, the next when it fails, and none is made twice (thesis 9.2.3, FIPA SC00029)."""

from collections import Counter
from pathlib import Path

import pytest

from dyknow.agents.capabilities.calls.bids import OF_ONE, Bids
from dyknow.agents.capabilities.calls.calls import Calls
from dyknow.agents.effects import Specify
from dyknow.agents.specification.specification_part import SpecificationPart
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import (
    CallForStream,
    CreateMulticast,
    LeaveProposal,
    StreamProposal,
    TakeProposal,
)
from tests.agents.capabilities.calls.market import CALL, Market, offer
from tests.box import Box

P = Performative
FIVE = {
    "1": offer(
        1, "sample every 300ms, max delay 200ms, min certainty 0.9"
    ),  # cheap, and not on the grid that is wanted
    "2": offer(2, "sample every 100ms, max delay 200ms, min certainty 0.5"),  # not sure enough
    "3": offer(7),
    "4": offer(4),
    "5": offer(0.5, to="9"),  # the cheapest, and not for us
}


def proposals(box: Box) -> Counter[tuple[str, str | None]]:
    """How often each platform has proposed in each conversation."""
    return Counter((act.sender.unit, act.conversation_id) for act in box.acts(head=StreamProposal.head))


def calls(box: Box) -> Counter[str]:
    """How often each platform was called."""
    return Counter(act.receiver.unit for act in box.acts("0", head=CallForStream.head))


def test_of_five_offers_the_right_one_is_taken_and_when_it_dies_the_next_within_two_seconds(wire):
    market = Market(wire, FIVE)
    assert market.takes_us("4", 3) < 3_000_000
    assert market.news("refused") == [("refused", "5"), ("refused", "1"), ("refused", "2")]
    wire.kill("4")
    assert market.takes_us("3", 2) < 2_000_000
    assert market.news("taken", "failed") == [("taken", "4"), ("failed", "4"), ("taken", "3")]
    assert set(proposals(wire).values()) == {1}, "one proposal in each conversation"
    assert set(calls(wire).values()) == {1}, "and each platform is called once"
    assert {value for _, value in market.samples()} == {4.0, 3.0}


def test_what_a_platform_promises_counts_as_far_as_it_is_trusted(wire):
    market = Market(wire, {"3": offer(7), "4": offer(4)}, call="")
    believes = (
        "sort percept(symbol in text, x_m in m, y_m in m)\nsource percept camera\nstrmgen percepts[4] = camera\n"
        'strmgen beliefs = believe("yard.toml", percepts[4] as camera trust 0.5)\n'
    )
    yard = Path("examples/world/yard.toml").read_text("utf-8")
    wire.happens("0", Specify(wire.now_us, believes + CALL, "a.kpl", (("yard.toml", yard),)))
    wire.run(2)
    assert market.news("refused", "taken") == [("refused", "4"), ("taken", "3")]


def test_what_is_promised_counts_as_far_as_the_file_of_the_federation_trusts_a_platform(wire):
    for unit, cost in (("3", 7), ("4", 4)):
        wire.join(unit)
        wire.specify(unit, offer(cost))
    wire.join("0", trusted={"4": 0.5})
    wire.specify("0", CALL)
    wire.run(2)
    told = [each for each in wire.nodes["0"].results if each["event"] == "call"]
    assert [(each["what"], each["unit"]) for each in told if each["what"] in {"refused", "taken"}] == [
        ("refused", "4"), ("taken", "3"),
    ]  # fmt: skip


@pytest.mark.parametrize(("costs", "unit"), [((3, 3, 3), "1"), ((3, 2, 2), "2"), ((0, 0, 0), "1")])
def test_of_equal_costs_the_unit_that_sorts_first_is_taken(wire, costs, unit):
    market = Market(wire, {str(at + 1): offer(cost) for at, cost in enumerate(costs)})
    wire.run(1.5)
    assert market.news("taken") == [("taken", unit)]


def test_what_is_offered_is_not_produced_before_it_is_taken_nor_after_the_call(wire):
    Market(wire, {"1": offer(1)}, call="")
    wire.run(1)
    network = wire.platform("1").part(SpecificationPart).instance.network
    exported = wire.platform("1").ports.translation.local_label("gas-level", "1")
    assert network.generator(exported).history.get_size() == 0
    wire.specify("0", CALL)
    wire.run(2)
    assert network.generator(exported).history.get_size() > 5
    assert [task.name for task in wire.platform("1").built.tasks.all()] == ["call-for-stream"]
    wire.specify("0", "")
    wire.run(1)
    assert wire.platform("1").built.tasks.all() == []
    assert wire.platform("1").part(Bids)._standing == {}
    assert not network.generator(exported).subscriptions


def test_the_reserve_is_left_when_the_call_is_over(wire):
    Market(wire, {"1": offer(1), "2": offer(2)})
    wire.run(2)
    assert len(wire.platform("2").part(Bids)._standing) == 1
    wire.specify("0", "")
    wire.run(0.5)
    assert wire.platform("2").part(Bids)._standing == {}
    assert [act.performative for act in wire.acts("0", "2", LeaveProposal.head)] == [P.REJECT_PROPOSAL]


def test_who_proposes_for_nothing_and_brings_nothing_is_left_for_the_next_and_asked_no_more(wire):
    market = Market(wire, {"1": offer(0), "2": offer(9)})
    market.certainty["1"] = None
    assert market.takes_us("2", 4) < 3_000_000
    wire.run(3)
    wire.kill("2")
    wire.run(12)
    assert market.news("taken", "failed", "open")[-4:] == [
        ("failed", "1"), ("taken", "2"), ("failed", "2"), ("open", ""),
    ]  # fmt: skip
    assert calls(wire)["1"] == 1
    assert any("no sample as promised" in note for note in wire.nodes["0"].notes)


def test_samples_that_are_less_sure_than_promised_are_no_delivery_and_are_not_passed_on(wire):
    market = Market(wire, {"1": offer(0, "sample every 100ms, max delay 200ms, min certainty 0.9"), "2": offer(9)})
    wire.run(2)
    market.certainty["1"] = 0.4
    assert market.takes_us("2", 3) < 2_000_000
    assert market.news("failed") == [("failed", "1")]


def test_a_third_of_what_was_promised_is_too_little(wire):
    market = Market(wire, {"1": offer(0), "2": offer(9)})
    wire.run(2)
    market.every["1"] = 3
    assert market.takes_us("2", 6) < 5_000_000
    assert any("samples came as promised" in note for note in wire.nodes["0"].notes)


@pytest.mark.parametrize(
    ("how", "period"),
    [("killed", "60s"), ("frozen", "500ms"), ("frozen", "60s")]
    + [
        pytest.param(how, each, marks=pytest.mark.full)
        for how in ("killed", "frozen")
        for each in ("100ms", "2s", "10s")
    ],
)
def test_however_rarely_it_is_to_bring_something_one_that_is_no_longer_heard_is_replaced_within_two_seconds(
    wire, how, period
):
    market = Market(wire, {"1": offer(1), "2": offer(2)}, CALL.replace("every 100ms", f"every {period}"))
    wire.run(2)
    assert market.news("taken") == [("taken", "1")]
    since_us = wire.now_us
    if how == "killed":
        wire.kill("1")
    else:
        wire.cut(["1"], ["0", "2"])
    while len(market.news("taken")) < 2:
        wire.run(0.05)
    assert wire.now_us - since_us < 2_000_000
    assert market.news("taken", "failed")[1:] == [("failed", "1"), ("taken", "2")]
    wire.wire.mend_all()
    wire.run(3)
    assert market.news("taken", "failed", "open")[-1] == ("taken", "2")


def test_a_sample_that_is_rarely_due_and_does_not_come_is_missed_within_two_seconds(wire):
    market = Market(wire, {"1": offer(1), "2": offer(2)}, CALL.replace("every 100ms", "every 5s"))
    wire.run(12)
    assert market.news("taken") == [("taken", "1")]
    market.certainty["1"] = None
    due_us = -(-wire.now_us // 5_000_000) * 5_000_000
    while len(market.news("taken")) < 2:
        wire.run(0.05)
    assert wire.now_us - due_us < 2_000_000
    assert any("no sample as promised for 6.2" in note for note in wire.nodes["0"].notes)


def test_a_call_without_offers_waits_says_so_and_takes_the_first_that_comes(wire):
    market = Market(wire, {})
    wire.run(2)
    assert market.news() == [("open", "")]
    [condition] = wire.platform("0").part(Calls).conditions()
    assert "call for gas-level" in condition.text
    wire.join("3")
    wire.specify("3", offer(2))
    wire.run(1)
    assert market.news("taken") == [("taken", "3")]
    assert not wire.platform("0").part(Calls).conditions()


def test_a_newcomer_is_a_reserve_and_does_not_take_the_place_of_what_works(wire):
    market = Market(wire, {"1": offer(5)})
    wire.run(2)
    wire.join("2")
    wire.specify("2", offer(1))
    wire.run(2)
    assert market.news("taken") == [("taken", "1")]
    assert list(market.call.reserve) == ["2"]


def test_one_that_can_no_longer_is_left_at_once_and_may_be_asked_again(wire):
    market = Market(wire, {"1": offer(1), "2": offer(2)})
    wire.run(2)
    wire.specify("1", "")
    assert market.takes_us("2", 2) < 1_000_000
    wire.specify("2", "")
    wire.run(1)
    wire.specify("1", offer(1))
    assert market.takes_us("1", 10) < 10_000_000


def test_a_call_survives_a_cut_and_the_next_is_taken_on_the_other_side_of_it(wire):
    market = Market(wire, {"1": offer(1), "2": offer(2)})
    wire.run(2)
    wire.cut(["1"], ["0", "2"])
    assert market.takes_us("2", 4) < 3_000_000
    wire.wire.mend_all()
    wire.run(12)
    assert market.news("taken") == [("taken", "1"), ("taken", "2")]
    wire.kill("2")
    assert market.takes_us("1", 12) < 12_000_000
    wire.run(1)


def test_what_is_offered_at_a_cost_goes_to_none_that_did_not_call(wire):
    Market(wire, {"1": offer(3)}, call="")
    wire.centre()
    wire.run(1)
    multicast = CreateMulticast(semantic_labels=("gas-level",), sample_period_s=0.1, delay_s=0.5, to_units=("cc",))
    asked = wire.asked("cc", "1", multicast)
    assert (asked.performatives, asked.contents[0].code) == ([P.REFUSE], "offered")


# Hostile


def call_of(name="a-1", label="gas-level"):
    return CallForStream(call=name, semantic_label=label, sample_period_s=0.1, delay_s=0.5)


def test_a_second_proposal_for_one_call_is_refused_in_whatever_conversation_it_is_asked_for(wire):
    Market(wire, {"1": offer(3)}, call="")
    wire.centre()
    wire.run(1)
    asked = [wire.asked("cc", "1", call_of(), P.CFP) for _ in range(3)]
    assert [each.performatives for each in asked] == [[P.PROPOSE], [P.REFUSE], [P.REFUSE]]
    assert asked[1].contents[0].code == "proposed-already"


def test_a_flood_of_calls_leaves_few_proposals_and_the_others_are_served(wire):
    market = Market(wire, {"1": offer(3)}, call="")
    wire.centre()
    wire.run(1)
    asked = [wire.question("cc", "1", call_of(f"a-{at}"), P.CFP) for at in range(60)]
    wire.run(0.5)
    assert len(wire.platform("1").part(Bids)._standing) == OF_ONE
    assert Counter(each.performatives[0] for each in asked)[P.PROPOSE] == OF_ONE
    wire.specify("0", CALL)
    assert market.takes_us("1", 2) < 2_000_000


def test_a_label_that_is_not_offered_is_refused(wire):
    Market(wire, {"1": offer(3)}, call="")
    wire.centre()
    wire.run(1)
    asked = wire.asked("cc", "1", call_of(label="heli-position"), P.CFP)
    assert asked.contents[0].code == "no-offer"


def test_to_take_a_proposal_of_another_or_none_fails_and_sets_up_nothing(wire):
    Market(wire, {"1": offer(3)}, call="")
    wire.centre()
    wire.join("7")
    wire.run(1)
    asked = wire.asked("cc", "1", call_of(), P.CFP)
    for taken in (asked.conversation, "cc-1-1.1"):
        wire.speak("7", lambda m, now, taken=taken: m.acts.decide("1", taken, P.ACCEPT_PROPOSAL, TakeProposal(), now))
    wire.run(0.2)
    assert wire.platform("1").built.tasks.all() == []
    assert len(wire.platform("1").part(Bids)._standing) == 1, "that of the one who called stands"
    told = [act for act in wire.acts("1", "7") if act.performative is P.FAILURE]
    assert len(told) == 2


def test_a_proposal_after_the_call_is_over_is_rejected_and_forgotten(wire):
    market = Market(wire, {"1": offer(3), "2": offer(4)})
    late = {"is_on": True}
    wire.wire.drop = lambda sender, _receiver, put: late["is_on"] and sender == "1" and put.key.startswith("acl/")
    wire.run(2)
    assert market.news("taken") == [("taken", "2")]
    late["is_on"] = False
    wire.run(2)
    assert wire.platform("1").part(Bids)._standing == {}
    assert market.news("taken") == [("taken", "2")]


def test_a_proposal_in_the_conversation_of_another_counts_for_nothing(wire):
    market = Market(wire, {"1": offer(3)}, call="")
    wire.join("7")
    wire.run(1)
    wire.specify("0", CALL)
    wire.run(0.05)
    [conversation] = market.call._awaited or [
        market.call.reserve["1"].conversation if "1" in market.call.reserve else market.call.taken.conversation
    ]
    forged = StreamProposal(semantic_label="gas-level", cost=0.0, sample_period_s=0.1, delay_s=0.1, certainty=1.0)

    def say(member, now_us):
        act = member.acts._act(P.PROPOSE, "0", forged, conversation)._replace(protocol="fipa-contract-net")
        member.acts._handle(member.acts.conversations.send(act, now_us)[1], now_us)

    wire.speak("7", say)
    wire.run(2)
    assert market.news("taken") == [("taken", "1")]
    assert "7" not in market.call.reserve


def test_the_loss_of_a_caller_frees_what_was_proposed_to_it(wire):
    Market(wire, {"1": offer(1), "2": offer(2)})
    wire.run(2)
    wire.kill("0")
    wire.run(5)
    assert wire.platform("2").part(Bids)._standing == {}


def said_of(box: Box, unit: str) -> list[str]:
    """What the caller shows of a platform, as a command centre sees it."""
    entry = box.member("cc").directory.entry("0")
    assert entry is not None
    return [one.text for one in entry.conditions if one.text.startswith(f"platform {unit} ")]


@pytest.mark.parametrize("seed", range(3))
def test_who_wins_call_after_call_and_brings_nothing_is_named_and_taken_last(wire, seed):
    liar = str(1 + seed)
    market = Market(wire, {unit: offer(0 if unit == liar else 9 + int(unit)) for unit in "123"})
    wire.centre()
    market.certainty[liar] = None
    wire.run(8)
    assert said_of(wire, liar) == [], "once may be an accident"
    wire.specify("0", "")
    wire.specify("0", CALL)
    wire.run(5.5)
    assert said_of(wire, liar) == [f"platform {liar} has not kept 2 of 2 proposals that were taken"]
    assert market.news("taken")[-1][1] != liar
    since = len(market.news("taken"))
    wire.specify("0", "")
    wire.specify("0", CALL)
    wire.run(4)
    assert liar not in {unit for _, unit in market.news("taken")[since:]}, "others are taken first"
    for honest in {"1", "2", "3"} - {liar}:
        assert said_of(wire, honest) == []
    notes = [note for note in wire.nodes["0"].notes if "has not kept" in note]
    assert len(notes) == 1
    wire.run(601)
    assert said_of(wire, liar) == [], "it is forgotten after ten minutes"


def test_who_is_the_only_one_is_taken_though_it_has_not_kept_what_it_proposed(wire):
    market = Market(wire, {"1": offer(0)})
    market.certainty["1"] = None
    for _ in range(3):
        wire.run(4)
        wire.specify("0", "")
        wire.specify("0", CALL)
    market.certainty["1"] = 0.95
    assert market.takes_us("1", 3) < 3_000_000


def test_a_proposal_below_what_is_announced_is_not_believed_and_named(wire, monkeypatch):
    market = Market(wire, {"1": offer(9), "2": offer(5)}, call="")
    wire.centre()
    agreements = wire.platform("1").part(Bids)._agreements
    honest = agreements.offer_of
    monkeypatch.setattr(agreements, "offer_of", lambda label: honest(label)._replace(cost=0.0))
    wire.specify("0", CALL)
    assert market.takes_us("2", 3) < 3_000_000
    wire.run(1.0)
    assert said_of(wire, "1") == ["platform 1 proposes gas-level at cost 0 and announces it at 9"]
    assert said_of(wire, "2") == []
    assert market.call.refused["cost"] == 1
