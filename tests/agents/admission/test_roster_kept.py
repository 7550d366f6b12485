"""A roster's file that cannot be used: shown as a condition until one that can be used is read."""

from collections.abc import Sequence

from dyknow.federation.security.trust import Roster, RosterMember
from dyknow.federation.transport import RosterKept, RosterRead
from tests.agents.rosters import trust
from tests.box import Box


def test_a_roster_that_cannot_be_used_is_a_condition_until_the_next_one(wire: Box) -> None:
    platform, other = wire.join("0", trust=trust("0")), wire.join("1", trust=trust("1"))
    wire.run(1.0)

    def conditions() -> Sequence[str]:
        entry = other.member.directory.entry("0")
        return [] if entry is None else [each.text for each in entry.conditions if "roster" in each.text]

    platform.on_event(RosterKept("the roster is not TOML", wire.now_us), wire.now_us)
    wire.run(1.0)
    assert conditions() == [
        "the roster's file cannot be used, and the roster before it is kept: the roster is not TOML"
    ]
    before = trust("0").roster
    later = Roster({**before.members, "9": RosterMember("9", b"k" * 32)}, None, before.identity, 1)
    platform.on_event(RosterRead(str(later), wire.now_us), wire.now_us)
    wire.run(1.0)
    assert conditions() == []
