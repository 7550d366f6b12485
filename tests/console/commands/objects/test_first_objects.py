"""How long `dyknow objects` waits for the first object of platforms that have just started."""

from types import SimpleNamespace
from typing import Any, cast

from dyknow import US_PER_S
from dyknow.console.commands.objects.picture import LOOK_S, NEW_US, FirstObjects
from dyknow.runtime.client import Client

STARTED_US = 1_700_000_000_000_000


class Waiting:
    """A client of one platform, whose time goes by waiting alone."""

    def __init__(self, label: str, age_us: int, ahead_us: int = 0) -> None:
        self.time_us = STARTED_US + age_us
        entry = SimpleNamespace(boot=(STARTED_US + ahead_us) // 1000)
        view = SimpleNamespace(entry=entry, labels=(label,))
        self.centre = SimpleNamespace(platforms=lambda: [view, SimpleNamespace(entry=None, labels=())])

    def now_us(self) -> int:
        return self.time_us

    def wait_for(self, _condition: Any, timeout_s: float) -> bool:
        self.time_us += round(timeout_s * 1e6)
        return False

    def waited_us(self) -> int:
        """How long it waits if no object comes."""
        first, since_us = FirstObjects(cast("Client", self)), self.time_us
        while first.may_come():
            pass
        return self.time_us - since_us


def test_objects_of_platforms_that_have_just_started_are_waited_for_and_not_those_of_others() -> None:
    assert NEW_US - 5 * US_PER_S <= Waiting("object-tracks", 5 * US_PER_S).waited_us() < NEW_US
    assert Waiting("believed-objects", 0).waited_us() >= NEW_US
    assert Waiting("object-tracks", NEW_US).waited_us() == 0
    assert Waiting("heli-position", 0).waited_us() == 0


def test_a_platform_that_says_it_will_start_later_is_not_waited_for_longer() -> None:
    assert Waiting("object-tracks", 0, ahead_us=NEW_US // 2).waited_us() <= NEW_US + LOOK_S * 1e6
    assert Waiting("object-tracks", 0, ahead_us=2 * NEW_US).waited_us() == 0
