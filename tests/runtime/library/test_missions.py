"""A mission that is delegated to a platform whose vehicle has just been started."""

from types import SimpleNamespace
from typing import Any

import pytest

from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import FlyMission
from dyknow.model.errors import Refused
from dyknow.runtime.library.missions import agreed

MISSION = FlyMission(mission="m1", domain="", problem="", constraints="", actions=(), is_whole=False)


class Member:
    """Takes the place of a client: its requests are answered with these codes, "" agrees; a wait lasts as long as it may."""

    def __init__(self, codes: list[str]) -> None:
        self.codes, self.at_us = codes, 0
        self.centre = SimpleNamespace(follow=lambda *_: None)

    def now_us(self) -> int:
        return self.at_us

    def say(self, unit: str, *_: Any, **__: Any) -> Any:
        code = self.codes.pop(0) if len(self.codes) > 1 else self.codes[0]
        refusal = (Performative.REFUSE, SimpleNamespace(code=code, leader=None, generation=None)) if code else None
        return SimpleNamespace(unit=unit, said=[1], over=bool(code), trouble=code or None, refusal=refusal)

    def run(self) -> Any:
        job = agreed(self, "0", MISSION)  # type: ignore[arg-type]
        sent: Any = None
        while True:
            try:
                wait = job.send(sent)
            except StopIteration as over:
                return over.value
            sent = wait.condition()
            self.at_us += 0 if sent else round(wait.within_s * 1e6)


def test_a_platform_that_does_not_know_home_yet_is_asked_again() -> None:
    member = Member(["no-origin", "no-origin", ""])
    assert member.run().trouble is None
    assert member.at_us == 1_000_000


def test_one_that_never_knows_home_refuses_and_any_other_reason_holds_at_once() -> None:
    never = Member(["no-origin"])
    with pytest.raises(Refused):
        never.run()
    assert 15_000_000 <= never.at_us < 16_000_000
    busy = Member(["busy", ""])
    with pytest.raises(Refused):
        busy.run()
    assert busy.at_us == 0
