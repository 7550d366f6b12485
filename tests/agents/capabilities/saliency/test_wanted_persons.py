"""A person is wanted by its scores; one that only one channel has scored is looked at again from around."""

from pathlib import Path

import pytest

from dyknow import NO_VALUE
from dyknow.agents.capabilities.cameras.cameras import Cameras
from dyknow.federation.messages.contents import WantObject
from dyknow.federation.messages.dialogue import Dialogue
from tests.agents.capabilities.attention.chase import said
from tests.agents.capabilities.saliency.rescuing import Rescue

SPECIFICATION = (Path(__file__).parents[4] / "examples" / "emergency" / "persons.kpl").read_text("utf-8")
WANTED = "thermal[injured] > 0.6 and colour[injured] > 0.58"


def wanted(rescue: Rescue, description: str = WANTED) -> Dialogue:
    rescue.world.specify("0", SPECIFICATION, "persons.kpl")
    rescue.world.run_for(2.0)
    return rescue.world.ask(
        "cc", "0", WantObject(symbol="injured", type="persons", description=description, recover="yes")
    )


def until(rescue: Rescue, dialogue: Dialogue, text: str) -> list[str]:
    for _ in range(120):
        told = [each for _, each in said(dialogue)]
        if any(text in each for each in told):
            return told
        rescue.world.run_for(1.0)
    raise AssertionError(told)


@pytest.mark.full
def test_of_two_persons_in_view_the_command_centre_is_asked_which() -> None:
    rescue = Rescue(1, 1, over=[(12.8, 42.0)], image_us=200_000)
    told = until(rescue, wanted(rescue), "asks: ")
    assert "asks: which" in told[-1]


@pytest.mark.full
def test_a_person_that_only_the_colour_camera_has_scored_is_looked_at_from_around(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rescue = Rescue(1, 1, over=[(-12.0, 42.0)], image_us=200_000)
    push = Cameras._push

    def half(self: Cameras, label: object, name: str, valid_us: int, value: tuple[object, ...], now_us: int) -> None:
        """West of the person nothing is warm."""
        if name == "person-percepts" and rescue.east_m(0) < 8.0:
            value = (*value[:6], NO_VALUE, *value[7:])
        push(self, label, name, valid_us, value, now_us)

    monkeypatch.setattr(Cameras, "_push", half)
    told = until(rescue, wanted(rescue, f"{WANTED} and x_m[injured] < 20"), "anchored: injured is")
    kinds = [each.partition(":")[0] for each in told]
    assert kinds[1:4] == ["halted", "plan", "flies"], told
    assert "case 2" in told[1], told
    assert any(each.startswith("anchored: ") and "it was looked at again" in each for each in told), told
