"""A peer whose clock is not the federation's is named by every platform that compares with it, and nothing else follows."""

from dyknow.agents.config import PlatformConfig
from dyknow.federation.transport import Reopen
from tests.box import Box, Vehicle


def texts(box: Box, unit: str) -> list[str]:
    entry = box.member("cc").directory.entry(unit)
    assert entry is not None
    return [condition.text for condition in entry.conditions]


def test_a_clock_that_is_not_the_federations_is_shown_until_its_member_is_gone() -> None:
    box = Box(1)
    for unit in ("0", "1"):
        box.join(unit, Vehicle(east_m=500.0 * int(unit)))
    box.centre()
    box.add("2", PlatformConfig("2", 0, clock=box.clock), Vehicle(east_m=900.0), offset_us=5_000_000)  # type: ignore[arg-type]
    box.run(15)
    for unit in ("0", "1"):
        assert [text for text in texts(box, unit) if text.startswith("the clock of 2 is not")], texts(box, unit)
        assert not [text for text in texts(box, unit) if "clock of 1" in text or "clock of 0" in text]
        assert box.vehicle(unit).commands == []
    assert not any(isinstance(effect, Reopen) for _, _, effect in box.wire.noted)
    box.kill("2")
    box.run(10)
    assert not [text for unit in ("0", "1") for text in texts(box, unit) if "clock" in text]
