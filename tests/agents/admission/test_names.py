"""Two platforms of one name: the later one gives way (9.3.3: a unit number is a unique identifier)."""

from agents.config import PlatformConfig
from agents.effects import Halt, Note
from agents.platform import Platform
from federation import keys
from federation.messages.codec import Heartbeat, encode_heartbeat
from federation.transport import Arrived

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


def test_the_last_heartbeats_of_an_earlier_life_end_nobody() -> None:
    platform = Platform(PlatformConfig("1", boot=20), NOW_US)
    assert heard(platform, boot=10, seconds=1) == []
