"""The directory: who is there, what they offer, who is gone, and who is deaf."""

from collections.abc import Sequence
from itertools import pairwise, permutations

from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.federation import keys
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.members.directory import LEAVING, DirectoryFacilitator, unit_order
from dyknow.federation.members.liveness import (
    NameConflict,
    PeerState,
    PlatformAppeared,
    PlatformGone,
    PlatformReturned,
    PlatformSuspected,
)
from dyknow.federation.members.member import Member
from dyknow.federation.members.offers import LabelAppeared, LabelGone, ServiceAppeared, ServiceGone, Visibility
from dyknow.federation.members.replicas import UNASKED_US, PlatformRefused
from dyknow.federation.messages.codec import Heartbeat, decode_description, decode_heartbeat
from dyknow.federation.messages.descriptions import ConditionEntry
from dyknow.federation.transport import Answer, Answered, Ask, Asked, DeclareToken, Put, UndeclareToken
from dyknow.sim_uavs.world.sessions import SessionLink
from tests.federation.directories import ALARMS, ALTITUDE, FEDERATION, POSITION, Directories, three

US = 1_000_000


def described(directory: DirectoryFacilitator) -> bytes:
    """What it says of itself."""
    (answer,) = (said for said in directory.on_asked(Asked(1, "", 0, b"")) if isinstance(said, Answer))
    return answer.payload


def test_platforms_find_each_other_and_what_they_offer() -> None:
    box = three()
    for unit in box.nodes:
        entries = box.directory(unit).entries()
        assert [entry.unit for entry in entries] == ["0", "1", "2"]
        assert all(entry.services == (FEDERATION,) and entry.labels == (POSITION,) for entry in entries)
        assert all(entry.state is PeerState.ALIVE for entry in entries)
        assert len(box.seen(unit, PlatformAppeared, ServiceAppeared, LabelAppeared)) == 6
        assert not box.seen(unit, PlatformSuspected, PlatformGone)


def test_a_late_joiner_is_known_to_all_and_knows_all_within_half_a_second() -> None:
    box = three()
    box.enter("7")
    box.run(0.5)
    assert box.present("7") == {"0", "1", "2"}
    assert all("7" in box.present(unit) for unit in ("0", "1", "2"))
    assert all(entry.labels for unit in box.nodes for entry in box.directory(unit).entries())


def test_what_a_platform_is_need_not_be_asked() -> None:
    box = three()
    box.enter("7")
    box.run(2)
    box.declare("0", [FEDERATION, ALARMS], [ALTITUDE])
    box.run(2)
    assert all(box.present(unit) == set(box.nodes) - {unit} for unit in box.nodes)
    assert [entry.unit for entry in box.directory("7").search(service="alarms")] == ["0"]
    assert [box.asks(unit) for unit in box.nodes] == [0] * 4


def test_an_announcement_that_is_lost_is_asked_for() -> None:
    box = three()
    box.wire.drop = lambda _sender, _receiver, put: put.key == keys.announcement("0")
    box.declare("0", [FEDERATION, ALARMS], [POSITION])
    box.run(0.5)
    assert [entry.unit for entry in box.directory("1").search(service="alarms")] == ["0"]
    assert (box.asks("1"), box.asks("2")) == (1, 1)
    box.run(10.5)
    assert box.asks("1") > 1, "what is known is confirmed now and then"


def test_a_service_is_described_with_the_way_to_it() -> None:
    box = Directories()
    box.enter("0", [FEDERATION, ALARMS])
    box.enter("1")
    box.run(1)
    (found,) = box.directory("1").search(service="alarms")
    assert {offer.service: offer.visibility for offer in found.services} == {
        "alarms": Visibility.PUBLIC,
        "dyknow-federation": Visibility.PROTECTED,
    }


def test_what_is_offered_anew_or_no_more_is_told_to_all() -> None:
    box = three()
    box.declare("0", [FEDERATION, ALARMS], [ALTITUDE])
    box.run(0.1)
    for unit in ("1", "2"):
        changes = box.seen(unit, ServiceAppeared, ServiceGone, LabelAppeared, LabelGone)[-3:]
        assert changes == [LabelGone("0", POSITION), ServiceAppeared("0", ALARMS), LabelAppeared("0", ALTITUDE)]
        assert [entry.unit for entry in box.directory(unit).search(label="heli-altitude")] == ["0"]
    assert not box.seen("1", PlatformSuspected), "the new platform token is declared before the old one goes"
    assert box.directory("0").declare([FEDERATION, ALARMS], [ALTITUDE], box.now_us) == []


def test_a_condition_that_comes_or_goes_is_known_to_all_at_once() -> None:
    box = three()
    condition = ConditionEntry(text="no GPS fix", since_us=box.now_us)
    for conditions in ((condition,), ()):
        box.declare("0", [FEDERATION], [POSITION], conditions)
        box.run(0.1)
        entries = [box.directory(unit).entry("0") for unit in ("1", "2")]
        assert [entry.conditions for entry in entries if entry] == [conditions, conditions]
        assert box.directory("0").entries()[0].conditions == conditions
    assert not box.seen("1", PlatformSuspected)


def test_a_killed_platform_is_gone_within_a_second() -> None:
    box = three()
    killed_us = box.now_us
    box.kill("2")
    box.run(1)
    for unit in ("0", "1"):
        assert box.present(unit) == {"0", "1"} - {unit}
        assert box.when(unit, PlatformGone, "2") - killed_us < US * 0.6
        assert box.seen(unit, LabelGone, ServiceGone, PlatformGone) == [
            LabelGone("2", POSITION),
            ServiceGone("2", FEDERATION),
            PlatformGone("2", 1002, "token withdrawn"),
        ]


def test_heartbeats_that_were_under_way_do_not_keep_a_killed_platform() -> None:
    box = Directories(link=SessionLink(jitter_us=0, reordering=1.0, late_us=300_000))
    box.enter("0")
    box.enter("1")
    box.run(3.1)
    killed_us = box.now_us
    box.kill("1")
    box.run(3)
    assert box.when("0", PlatformGone, "1") - killed_us < US
    assert "1" not in box.present("0")


def test_a_silent_platform_is_suspected_after_one_second_and_gone_after_two_and_a_half() -> None:
    box = three()
    frozen_us = box.now_us
    box.freeze("2")
    box.run(1.3)
    entry = box.directory("0").entry("2")
    assert entry is not None
    assert entry.state is PeerState.SUSPECT
    assert frozen_us + 0.8 * US <= box.when("0", PlatformSuspected, "2") <= frozen_us + 1.01 * US
    box.run(2)
    assert frozen_us + 2.3 * US <= box.when("0", PlatformGone, "2") <= frozen_us + 2.51 * US
    box.thaw("2")
    box.run(3.0)
    assert box.present("0") == {"1", "2"}, "as soon as the links have been made again"
    assert box.present("2") == {"0", "1"}
    assert not box.seen("2", PlatformGone), "who stood still itself cannot judge others"


def test_a_token_that_returns_in_time_keeps_everything() -> None:
    box = three()
    token = box.token("2")
    directory = box.directory("0")
    assert directory.on_token(token, False, box.now_us) == [PlatformSuspected("2", 1002, "token withdrawn")]
    assert directory.on_token(token, True, box.now_us + 400_000) == [PlatformReturned("2", 1002)]
    box.run(3)
    assert "2" in box.present("0")


def test_a_lost_token_is_outvoted_by_heartbeats() -> None:
    box = three()
    token = box.token("2")
    box.directory("0").on_token(token, False, box.now_us)
    box.run(5)
    assert box.seen("0", PlatformReturned) == [PlatformReturned("2", 1002)]
    assert not box.seen("0", PlatformGone)


def test_a_new_incarnation_replaces_the_old_one_at_once() -> None:
    box = three()
    box.vanish("2")
    box.enter("2", [ALARMS])
    box.run(0.5)
    assert box.seen("0", PlatformGone, PlatformAppeared)[-2:] == [
        PlatformGone("2", 1002, "restarted"),
        PlatformAppeared("2", 1003, "uav"),
    ]
    (found,) = box.directory("0").search(service="alarms")
    assert (found.unit, found.boot) == ("2", 1003)
    box.kill("2")
    box.run(1)
    assert box.present("0") == {"1"}, "its own token is known from that of its predecessor"


def test_a_platform_that_leaves_is_gone_at_once_and_may_come_back() -> None:
    box = three()
    box.speak("2", Member.leave)
    box.run(0.1)
    assert box.seen("0", PlatformGone) == [PlatformGone("2", 1002, "left")]
    box.run(20)
    assert not box.reopened("2")
    assert not box.reopened("0")
    box.speak("2", lambda member, now_us: member.take(member.directory.start(now_us), now_us))
    box.run(0.5)
    assert "2" in box.present("0")


def test_a_stale_token_alone_makes_nobody_appear() -> None:
    box = three()
    directory = box.directory("0")
    assert directory.on_token(keys.PlatformToken("dead", "9", "uav", 1), True, box.now_us) == []
    box.run(1)
    assert "9" not in box.present("0")
    assert directory.entry("9") is None


def test_another_platform_of_our_own_name_is_told_once() -> None:
    box = three()
    directory = box.directory("0")
    twin = Heartbeat("0", 77, 1, 0, 1)
    assert directory.on_heartbeat(twin, box.now_us) == [NameConflict("0", 77)]
    assert list(directory.on_heartbeat(twin._replace(seq=2), box.now_us)) == []


def test_a_platform_of_another_clock_or_roster_is_there_but_offers_nothing() -> None:
    mine = DirectoryFacilitator("0", 1, "uav", 0, clock=FederationClock(0, 1.0))
    for number, other in enumerate(
        [
            DirectoryFacilitator("1", 2, "uav", 0, clock=FederationClock(0, 10.0)),
            DirectoryFacilitator("2", 2, "uav", 0, roster="0123456789abcdef"),
        ]
    ):
        other.declare([FEDERATION], [POSITION], 0)
        mine.on_token(keys.PlatformToken("2", other.unit, "uav", 1), True, 1)
        mine.on_heartbeat(Heartbeat(other.unit, 2, 1, 0, 1), 2)
        (event,) = mine.on_announced(other.unit, described(other), 4)
        assert isinstance(event, PlatformRefused)
        assert event.code == ("clock" if number == 0 else "roster")
        assert [entry.unit for entry in mine.search(service="dyknow-federation")] == []
        assert len(mine.entries()) == number + 2


def test_a_description_that_is_malformed_or_of_another_is_not_taken_over() -> None:
    mine, other = DirectoryFacilitator("0", 1, "uav", 0), DirectoryFacilitator("2", 2, "uav", 0)
    mine.on_token(keys.PlatformToken("2", "1", "uav", 1), True, 1)
    mine.on_heartbeat(Heartbeat("1", 2, 1, 0, 1), 2)
    assert list(mine.on_announced("1", described(other), 4)) == []
    assert list(mine.on_announced("1", b"\x93\x01\x02", 4)) == []
    assert list(mine.on_announced("2", described(other), 4)) == [], "no heartbeat of it was heard"
    assert sum(mine.refused.values()) == 2
    (ask,) = (found for found in mine.on_time(2 + UNASKED_US) if isinstance(found, Ask))
    assert list(mine.on_answered(Answered(ask.question, ask.key, 4, described(other)))) == []
    assert list(mine.on_answered(Answered(ask.question, ask.key, 4, b"\x93\x01\x02"))) == []
    assert list(mine.on_answered(Answered(99, ask.key, 4, described(other)))) == []
    assert sum(mine.refused.values()) == 4


def test_heartbeats_go_out_five_times_a_second_with_whom_we_hear_and_our_tails() -> None:
    box = three()
    directory = box.directory("0")
    said = []
    for _ in range(10):
        now_us = directory.deadline_us
        found = directory.on_time(now_us, [("heli-position", "ab12cd34", 5)])
        said += [(now_us, decode_heartbeat(put.payload)) for put in found if isinstance(put, Put)]
    times = [at_us for at_us, _ in said]
    assert {later - earlier for earlier, later in pairwise(times)} == {200_000}
    assert {beat.hears for _, beat in said[:1]} == {("1", "2")}
    assert all(beat.tails == (("heli-position", "ab12cd34", 5),) for _, beat in said)
    leaving = directory.leave(times[-1])[-1]
    assert isinstance(leaving, Put)
    assert decode_heartbeat(leaving.payload).description == LEAVING


def test_the_platform_token_is_declared_last_and_undeclared_first() -> None:
    directory = DirectoryFacilitator("0", 1, "uav", 0)
    directory.declare([FEDERATION], [POSITION], 0)
    tokens = [effect.key for effect in directory.start(0) if isinstance(effect, DeclareToken)]
    assert [isinstance(keys.parse_key(token), keys.PlatformToken) for token in tokens] == [False, False, True]
    undeclared = [effect.key for effect in directory.leave(1) if isinstance(effect, UndeclareToken)]
    assert undeclared == tokens[::-1]
    assert decode_description(directory.on_asked(Asked(1, "0/df", 0, b""))[0].payload).unit == "0"  # type: ignore[union-attr]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([0.0, 0.05, 0.2]))
def test_after_any_faults_all_directories_agree_within_five_seconds(seed: int, loss: float) -> None:
    lossy = SessionLink(delay_us=0, jitter_us=50_000, loss=loss)
    box, units = Directories(seed, link=lossy), ["0", "1", "2", "3"]
    for unit in units:
        box.enter(unit)
    for _ in range(6):
        box.run(box.random.random() * 4)
        unit = box.random.choice(units)
        others = [other for other in units if other != unit]
        match box.random.randrange(5):
            case 0 if unit in box.units:
                (box.kill if box.random.random() < 0.5 else box.vanish)(unit)
            case 1 if unit not in box.units:
                box.enter(unit, box.random.choice([[FEDERATION], [FEDERATION, ALARMS], []]))
            case 2 if unit in box.units:
                box.freeze(unit)
            case 3 if box.nodes[unit].frozen:
                box.thaw(unit)
            case 4 if box.random.random() < 0.7:
                box.partition([unit], others)
            case 4:
                for other in others:
                    box.wire.cut(unit, other)
    for one, other in permutations(units, 2):
        box.wire.set_link(one, other, lossy._replace(loss=0.0))
        box.wire.mend(one, other)
    for unit in units:
        box.thaw(unit)
    box.run(5)
    for unit in box.units:
        entries = box.directory(unit).entries()
        assert {entry.unit for entry in entries} == box.units
        for entry in entries:
            theirs = box.directory(entry.unit)
            assert (entry.boot, entry.version) == (theirs.boot, theirs.version)
            assert {offer.service for offer in entry.services} == {s.service for s in theirs.description().services}
            assert entry.labels == theirs.description().labels
        assert told(box.listener(unit).events) == box.units - {unit}


def told(events: Sequence[tuple[int, object]]) -> set[str]:
    """Who is there according to the events alone, which have to make sense one after the other."""
    there: dict[str, int] = {}
    offers: set[tuple[str, object]] = set()
    for _, event in events:
        match event:
            case PlatformAppeared(unit, boot):
                assert unit not in there
                there[unit] = boot
            case PlatformGone(unit, boot):
                assert there.pop(unit) == boot
                assert not any(owner == unit for owner, _ in offers), "offers go before their platform"
            case PlatformSuspected(unit, boot) | PlatformReturned(unit, boot):
                assert there[unit] == boot
            case ServiceAppeared(unit, offer) | LabelAppeared(unit, offer):
                assert unit in there
                assert (unit, offer) not in offers
                offers.add((unit, offer))
            case ServiceGone(unit, offer) | LabelGone(unit, offer):
                offers.remove((unit, offer))
    return set(there)


def test_the_usual_heartbeats_of_a_hundred_platforms_change_nothing() -> None:
    directory = DirectoryFacilitator("0", 1, "uav", 0)
    units = tuple(f"uav{number}" for number in range(100))
    for unit in units:
        directory.on_token(keys.PlatformToken("1", unit, "uav", 1), True, 0)
        directory.on_heartbeat(Heartbeat(unit, 1, 1, 0, 1), 0)
        directory.on_announced(unit, described(DirectoryFacilitator(unit, 1, "uav", 0)), 0)
    beats = [Heartbeat(unit, 1, seq, 0, 1, units) for seq in range(2, 102) for unit in units]
    told = [outcome for at, beat in enumerate(beats) for outcome in directory.on_heartbeat(beat, at * 2_000)]
    assert told == [], "the usual heartbeat changes nothing and asks nothing"
    assert len(directory.entries()) == 101


def test_units_are_listed_numbers_first_by_value() -> None:
    assert sorted(["10", "uav2", "9", "0", "cc-1"], key=unit_order) == ["0", "9", "10", "cc-1", "uav2"]
