"""The command centre and what does not belong to it: bytes, names and acts of others."""

from hypothesis import given, settings
from hypothesis import strategies as st

from console.centre import CommandCentre
from federation import keys
from federation.acts import Act, AgentName, Performative
from federation.clock import FederationClock
from federation.codec import encode_act, encode_description
from federation.contents import Hold, Query, Tasks
from federation.directory import Directory
from federation.transport import Arrived, Put

NOW_US = 1_800_000_000_000_000
INBOX = keys.act("cc-1", "0", "interface")


def _centre() -> CommandCentre:
    found = CommandCentre("cc-1", "test", NOW_US)
    found.start(NOW_US)
    return found


@settings(max_examples=200)
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
        conversation_id="c1",
        reply_with="r1",
        seq=1,
    )
    from federation.codec import decode_act

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
    assert centre.conversations.conversations() == []


def test_only_questions_with_pages_stay_open_for_more() -> None:
    centre = _centre()
    latest, _ = centre.say("0", Performative.QUERY_REF, Query(semantic_label="battery"), NOW_US)
    between = Query(semantic_label="battery", op="between", from_us=0, to_us=1)
    paged, _ = centre.say("0", Performative.QUERY_REF, between, NOW_US)
    assert (latest.paged, paged.paged) == (False, True)


def test_the_clock_is_learned_from_the_first_platform_that_says_what_it_is_under_its_own_name() -> None:
    centre, own = _centre(), FederationClock(NOW_US - 1_000_000, 10.0)
    said = encode_description(Directory("1", 7, "uav", NOW_US, clock=own).description())
    centre.on_event(Arrived(keys.announcement("2"), NOW_US, said), NOW_US)
    assert centre.clock.speed == 1.0
    centre.on_event(Arrived(keys.announcement("1"), NOW_US, b"\xc1"), NOW_US)
    assert sum(centre.refused.values()) == 1
    centre.on_event(Arrived(keys.announcement("1"), NOW_US, said), NOW_US)
    assert (centre.clock.epoch_us, centre.clock.speed) == (NOW_US - 1_000_000, 10.0)
