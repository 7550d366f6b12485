"""A member that asks, and what does not belong to it: bytes, names and acts of others."""

from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.federation import keys
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.members.command_centre import CommandCentre
from dyknow.federation.members.directory import DirectoryFacilitator
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.codec import decode_act, encode_act, encode_description
from dyknow.federation.messages.contents import Hold, Query, Specification, SpecificationText, Tasks
from dyknow.federation.messages.receipts import RECEIPT_AGENT
from dyknow.federation.security.trust import Roster, RosterMember, Signer, Trust
from dyknow.federation.transport import Arrived, Put
from tests.strategies import examples

NOW_US = 1_800_000_000_000_000
INBOX = keys.act("cc-1", "0", "interface")


def _centre() -> CommandCentre:
    found = CommandCentre("cc-1", NOW_US)
    found.start(NOW_US)
    return found


@settings(max_examples=examples(200))
@given(st.binary(max_size=200), st.sampled_from([INBOX, "hb/0", "x/0/battery/0a1b2c3d", "q/0/battery", "nonsense"]))
def test_bytes_that_mean_nothing_are_counted_and_change_nothing(payload: bytes, key: str) -> None:
    centre = _centre()
    centre.on_event(Arrived(key, NOW_US, payload), NOW_US)
    assert centre.platforms(all_kinds=True) == []


def test_an_act_under_a_foreign_name_is_counted_not_heard() -> None:
    centre = _centre()
    act = Act(Performative.INFORM, AgentName("interface", "1"), AgentName("interface", "cc-1"), Hold().expr(), seq=1)
    centre.on_event(Arrived(INBOX, NOW_US, encode_act(act)), NOW_US)
    assert centre.refused["sender and key differ"] == 1


def test_a_request_to_the_command_centre_is_refused() -> None:
    centre = _centre()
    act = Act(
        Performative.REQUEST,
        AgentName("interface", "0"),
        AgentName("interface", "cc-1"),
        Hold().expr(),
        conversation_id="0-0-1",
        reply_with="r1",
        seq=1,
    )
    effects = centre.on_event(Arrived(INBOX, NOW_US, encode_act(act)), NOW_US)
    [answer] = [decode_act(effect.payload)[0] for effect in effects if isinstance(effect, Put)]
    assert (answer.performative, answer.in_reply_to) == (Performative.REFUSE, "r1")


def test_silence_ends_a_dialogue_by_its_reply_by() -> None:
    centre = _centre()
    dialogue, _ = centre.say("0", Performative.QUERY_REF, Tasks(), NOW_US, within_us=1_000_000)
    now_us = NOW_US
    while not dialogue.over:
        now_us = max(now_us, centre.deadline_us)
        centre.on_time(now_us)
    assert now_us <= NOW_US + 1_000_000
    assert dialogue.trouble
    assert centre.member.acts.conversations.conversations() == []


def test_only_questions_with_pages_stay_open_for_more() -> None:
    centre = _centre()
    latest, _ = centre.say("0", Performative.QUERY_REF, Query(semantic_label="battery"), NOW_US)
    between = Query(semantic_label="battery", op="between", from_us=0, to_us=1)
    paged, _ = centre.say("0", Performative.QUERY_REF, between, NOW_US)
    standing = {
        found.opening.conversation_id: found.standing for found in centre.member.acts.conversations.conversations()
    }
    assert (standing[latest.conversation], standing[paged.conversation]) == (False, True)


def test_a_specification_of_several_pages_is_received_whole() -> None:
    centre = _centre()
    dialogue, effects = centre.say("0", Performative.QUERY_REF, Specification(), NOW_US)
    [asked] = [decode_act(effect.payload)[0] for effect in effects if isinstance(effect, Put)]
    for number, text in enumerate(("stream a = ", "b\n")):
        page = SpecificationText(text=text, number=0, last=0, at_us=1, more=number == 0)
        act = Act(
            Performative.INFORM,
            AgentName("interface", "0"),
            AgentName("interface", "cc-1"),
            page.expr(),
            conversation_id=asked.conversation_id,
            in_reply_to=asked.reply_with,
            seq=number + 1,
        )
        centre.on_event(Arrived(INBOX, NOW_US, encode_act(act)), NOW_US)
        assert dialogue.over is (number == 1)
    assert "".join(page.text for page in dialogue.results if isinstance(page, SpecificationText)) == "stream a = b\n"


def test_the_clock_is_learned_from_the_first_platform_that_says_what_it_is_under_its_own_name() -> None:
    centre, own = _centre(), FederationClock(NOW_US - 1_000_000, 10.0)
    said = encode_description(DirectoryFacilitator("1", 7, "uav", NOW_US, clock=own).description())
    centre.on_event(Arrived(keys.announcement("2"), NOW_US, said), NOW_US)
    assert centre.clock.speed == 1.0
    centre.on_event(Arrived(keys.announcement("1"), NOW_US, b"\xc1"), NOW_US)
    assert sum(centre.member.refused.values()) == 1
    centre.on_event(Arrived(keys.announcement("1"), NOW_US, said), NOW_US)
    assert (centre.clock.epoch_us, centre.clock.speed) == (NOW_US - 1_000_000, 10.0)


def _trust(unit: str, seeds: dict[str, bytes], now_us: int = NOW_US) -> Trust:
    members = {
        name: RosterMember(name, Signer(seed, "test").public_key, "command-centre" if name == "cc" else "uav")
        for name, seed in seeds.items()
    }
    return Trust.of(Roster(members), seeds[unit], "test", now_us)


def test_with_a_roster_an_act_is_believed_once_and_its_replay_only_acknowledged() -> None:
    seeds = {"cc": bytes(range(32)), "0": bytes(32)}
    centre = CommandCentre("cc-1", NOW_US, trust=_trust("cc", seeds))
    centre.start(NOW_US)
    act = Act(
        Performative.REQUEST,
        AgentName("interface", "0"),
        AgentName("interface", "cc-1"),
        Hold().expr(),
        conversation_id="0-0-2",
        reply_with="r1",
        seq=1,
        created_us=NOW_US + 1,
    )
    unsigned = Arrived(INBOX, NOW_US + 2, encode_act(act))
    assert not [effect for effect in centre.on_event(unsigned, NOW_US + 2) if isinstance(effect, Put)]
    signed = Arrived(INBOX, NOW_US + 2, encode_act(act, Signer(seeds["0"], "test")))
    assert [effect for effect in centre.on_event(signed, NOW_US + 2) if isinstance(effect, Put)]
    again = [effect for effect in centre.on_event(signed, NOW_US + 3) if isinstance(effect, Put)]
    assert again
    assert all(effect.key.endswith(RECEIPT_AGENT) for effect in again), "a receipt, and no second answer"
    assert centre.refused == {"unsigned": 1, "replayed": 1}
