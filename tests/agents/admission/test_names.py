"""Two platforms of one name: the later one gives way (9.3.3: a unit number is a unique identifier)."""

import pytest

from dyknow.agents.config import PlatformConfig
from dyknow.agents.directory.directory import JOINING_US
from dyknow.agents.effects import Halt, Note
from dyknow.agents.platform import Platform
from dyknow.federation import keys
from dyknow.federation.members.member import DUPLICATES
from dyknow.federation.messages.codec import Heartbeat, encode_description, encode_heartbeat
from dyknow.federation.messages.descriptions import Description
from dyknow.federation.transport import Arrived
from tests.agents.admission.test_hostile import roster, trust
from tests.box import Box

NOW_US = 1_700_000_000_000_000


def heard(platform: Platform, boot: int, seconds: float) -> list[object]:
    """What a platform does about heartbeats of its own name, five a second."""
    found: list[object] = []
    for beat in range(1, round(seconds * 5) + 1):
        at_us = NOW_US + beat * 200_000
        said = Heartbeat(platform.unit, boot, beat, at_us, 1)
        found += platform.on_event(Arrived(keys.heartbeat(platform.unit), at_us, encode_heartbeat(said)), at_us)
    return [effect for effect in found if isinstance(effect, Halt | Note)]


def test_the_later_of_two_platforms_of_one_name_gives_way_and_the_earlier_stays() -> None:
    later = Platform(PlatformConfig("1", boot=20), NOW_US)
    assert [type(effect) for effect in heard(later, boot=10, seconds=3)] == [Halt]
    earlier = Platform(PlatformConfig("1", boot=10), NOW_US)
    assert [type(effect) for effect in heard(earlier, boot=20, seconds=3)] == [Note]


def test_one_that_flies_or_has_a_roster_stays_and_notes_it_once() -> None:
    flying = Platform(PlatformConfig("1", boot=20), NOW_US - JOINING_US)
    kept = heard(flying, boot=10, seconds=60)
    assert [type(effect) for effect in kept] == [Note]
    assert "stays" in kept[0].text
    among_members = Platform(PlatformConfig("0", boot=20, trust=trust("0")), NOW_US)
    assert [type(effect) for effect in heard(among_members, boot=10, seconds=60)] == [Note]


def test_names_by_the_thousand_cost_no_memory() -> None:
    platform = Platform(PlatformConfig("1", boot=20), NOW_US - JOINING_US)
    for boot in range(1000, 3000):
        heard(platform, boot, seconds=0.2)
    assert len(platform.ports.member._duplicates) == DUPLICATES


@pytest.mark.parametrize("signed", [True, False], ids=["roster", "open"])
@pytest.mark.parametrize("boot", [1, None], ids=["older", "its own"])
def test_another_clock_ends_no_platform_that_flies(wire: Box, signed: bool, boot: int | None) -> None:
    """The member 1 says under its own name that its clock runs twice as fast, and that it was first."""
    for unit in "01":
        wire.join(unit, trust=trust(unit) if signed else None)
    wire.run(JOINING_US / 1e6)
    life = boot or wire.platform("1").config.boot
    wire.kill("1")
    wire.run(4.0)
    for beat in range(1, 50):
        said = Heartbeat("1", life, beat, wire.now_us, 1)
        fast = Description(
            unit="1", boot=life, version=1, kind="uav", clock_speed=2.0, roster=roster().fingerprint if signed else None
        )
        wire.put(keys.heartbeat("1"), encode_heartbeat(said))
        wire.put(keys.announcement("1"), encode_description(fast))
        wire.run(0.2)
    assert wire.nodes["0"].halted == []
    told = [note for note in wire.nodes["0"].notes if "clock" in note]
    assert len(told) == 1
    assert "1 is in this federation and" in told[0]
    entry = wire.platform("0").ports.directory.entry("1")
    assert entry is not None
    assert entry.refusal is not None
    assert entry.services == ()


def test_the_last_heartbeats_of_an_earlier_life_end_nobody() -> None:
    platform = Platform(PlatformConfig("1", boot=20), NOW_US)
    assert heard(platform, boot=10, seconds=1) == []
