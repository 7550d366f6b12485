"""What one member has delegated to a platform, or follows there, is bounded, and what others ask for stays possible."""

from hashlib import sha256

import pytest

from dyknow.agents.capabilities.calls.bids import OF_A_CENTRE
from dyknow.agents.exchange.dormant import MOST_OF_ONE as WAITING
from dyknow.agents.subscribers import OF_ONE as FOLLOWED
from dyknow.agents.tasks.life import OF_ONE
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import (
    ActList,
    Acts,
    Alarms,
    CallForStream,
    CheckFormula,
    MonitorProximity,
    Query,
    Reason,
)
from dyknow.federation.security.trust import Role, Roster, RosterMember, Signer, Trust
from dyknow.federation.shares import ACTS_BURST
from tests.agents.capabilities.calls.market import offer
from tests.agents.rosters import trust
from tests.box import EPOCH, Box, Question, Vehicle

P = Performative


def code(asked: Question) -> str | None:
    reason = asked.contents[-1]
    return reason.code if isinstance(reason, Reason) else None


def test_tasks_of_one_member_leave_room_for_those_of_others(wire: Box) -> None:
    for unit in "012":
        wire.join(unit, Vehicle(north_m=3000.0 * int(unit)), trust=trust(unit))
    wire.centre("cc", trust=trust("cc"))
    wire.run(1.5)
    check = CheckFormula(text="eventually altitude[0] > 10000", timeout_s=60.0)
    asked = [wire.asked("2", "0", MonitorProximity()) for _ in range(OF_ONE)]
    assert [each.performatives[0] for each in asked] == [P.AGREE] * OF_ONE
    for content in (MonitorProximity(), check):
        refused = wire.asked("2", "0", content)
        assert (refused.performatives, code(refused)) == ([P.REFUSE], "too-many-tasks")
    assert wire.asked("1", "0", MonitorProximity()).performatives[0] is P.AGREE
    assert wire.asked("cc", "0", check).performatives[0] is P.AGREE
    wire.cancel("2", "0", asked[0].conversation)
    wire.run(0.2)
    assert wire.asked("2", "0", check).performatives[0] is P.AGREE
    wire.run(2.0)
    assert wire.member("0").directory.is_present("1")


def test_subscriptions_of_one_member_leave_room_for_those_of_others(wire: Box) -> None:
    for unit in "01":
        wire.join(unit, Vehicle(north_m=3000.0 * int(unit)))
    wire.centre("cc")
    wire.run(1.5)
    asked = [wire.asked("1", "0", Alarms(), P.SUBSCRIBE) for _ in range(FOLLOWED + 1)]
    assert [each.performatives for each in asked] == [*[[P.AGREE]] * FOLLOWED, [P.REFUSE]]
    assert code(asked[-1]) == "too-many-subscriptions"
    assert wire.asked("cc", "0", Alarms(), P.SUBSCRIBE).performatives == [P.AGREE]


def named(unit: str) -> Trust:
    """Of a member, or of one of its names: `obs-1` has the key of `obs`."""
    roles: dict[str, Role] = {"0": "uav", "1": "uav", "obs": "observer", "cc": "command-centre"}
    seeds = {each: sha256(each.encode()).digest() for each in roles}
    members = {
        each: RosterMember(each, Signer(seed, "default").public_key, roles[each]) for each, seed in seeds.items()
    }
    return Trust.of(Roster(members), seeds[unit.partition("-")[0]], "default", EPOCH - 1_000_000)


@pytest.fixture
def by_names(wire: Box) -> Box:
    for unit in "01":
        wire.join(unit, Vehicle(north_m=3000.0 * int(unit)), trust=named(unit))
    for stem in ("obs", "cc"):
        for unit in (stem, *(f"{stem}-{number}" for number in range(1, 6))):
            wire.centre(unit, trust=named(unit))
    wire.run(1.5)
    return wire


def names(stem: str) -> list[str]:
    return [stem, *(f"{stem}-{number}" for number in range(1, 6))]


def test_an_observer_has_one_share_of_acts_under_all_its_names_and_a_command_centre_more(by_names: Box) -> None:
    accepted: dict[str, int] = {}
    for stem in ("obs", "cc"):
        asked = [
            by_names.question(unit, "0", ActList(), P.QUERY_REF) for unit in names(stem) for _ in range(int(ACTS_BURST))
        ]
        by_names.run(0.5)
        accepted[stem] = sum(P.INFORM in each.performatives for each in asked)
    assert ACTS_BURST <= accepted["obs"] < 1.5 * ACTS_BURST
    assert accepted["cc"] == len(names("cc")) * ACTS_BURST
    assert by_names.asked("1", "0", ActList(), P.QUERY_REF).performatives[0] is P.INFORM


def test_an_observer_has_one_share_of_subscriptions_under_all_its_names(by_names: Box) -> None:
    asked = {
        stem: [by_names.asked(unit, "0", Acts(), P.SUBSCRIBE) for unit in names(stem) for _ in range(4)]
        for stem in ("obs", "cc")
    }
    assert [each.performatives[0] for each in asked["obs"]].count(P.AGREE) == FOLLOWED
    assert {code(each) for each in asked["obs"][FOLLOWED:]} <= {"too-many-subscriptions", "too-many-acts"}
    assert all(each.performatives[0] is P.AGREE for each in asked["cc"])


def test_acts_that_end_parts_are_counted_by_member(by_names: Box) -> None:
    containment = by_names.platform("0").containment
    containment.is_on = True
    for number in range(1, 4):
        containment.caught(f"Part.fail {number}", ValueError(), f"obs-{number}", by_act=True)
    by_names.run(0.5)
    assert not any(containment.is_heard(unit) for unit in names("obs"))
    assert containment.is_heard("1")


def test_queries_that_wait_for_a_stream_have_a_share_of_each_member(by_names: Box) -> None:
    waiting = [by_names.question(unit, "0", Query(semantic_label="battery"), P.QUERY_REF) for unit in names("obs") * 6]
    others = [by_names.question(unit, "0", Query(semantic_label="battery"), P.QUERY_REF) for unit in ("1", "cc")]
    by_names.run(0.3)
    assert [each.performatives for each in others] == [[], []], "they wait"
    assert [each.performatives for each in waiting].count([]) == WAITING
    by_names.run(1.5)


def test_the_proposals_for_a_member_are_counted_under_all_its_names(by_names: Box) -> None:
    by_names.specify("0", offer(1.0))
    by_names.run(1.0)

    def called(unit: str, number: int) -> Question:
        content = CallForStream(
            call=f"{unit}-{number}", semantic_label="gas-level", sample_period_s=0.1, delay_s=0.5, min_certainty=0.5
        )
        return by_names.question(unit, "0", content, P.CFP)

    asked = [called(unit, number) for number in range(OF_A_CENTRE // len(names("cc")) + 2) for unit in names("cc")]
    by_names.run(0.3)
    performatives = [each.performatives[0] for each in asked]
    assert performatives.count(P.PROPOSE) == OF_A_CENTRE
    assert {code(each) for each in asked if each.performatives == [P.REFUSE]} == {"busy"}
    other = called("1", 1)
    by_names.run(0.1)
    assert other.performatives == [P.PROPOSE]
