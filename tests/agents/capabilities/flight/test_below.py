"""Landing above another member's vehicle is refused while that is in the air."""

import pytest

from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Land, MonitorProximity, Reason
from tests.box import Box, Vehicle

P = Performative


def over(wire: Box, altitude_m: float = 80.0, north_m: float = 0.0, *, watched: bool = True) -> Box:
    """Platform 0 flies at 130 m, its home at 50 m; 1 is at that altitude, and as far north."""
    wire.join("0", Vehicle(altitude_m=130.0), control=True)
    wire.join("1", Vehicle(altitude_m=altitude_m, north_m=north_m), control=True)
    wire.centre()
    wire.run(1.0)
    if watched:
        wire.question("cc", "0", MonitorProximity())
        wire.run(2.5)
    return wire


def landed(wire: Box, unit: str = "0") -> tuple[Performative, str, str | None]:
    """The first answer to the order, its words and its code."""
    question = wire.question("cc", unit, Land())
    wire.run(1.0)
    said = question.answers[0]
    reason = said.content if isinstance(said.content, Reason) else Reason(text="")
    return said.act.performative, reason.text, reason.code


def test_it_is_refused_and_the_refusal_names_the_other_and_its_height(wire: Box) -> None:
    performative, text, code = landed(over(wire, north_m=9.0))
    assert (performative, code) == (P.REFUSE, "occupied")
    assert text.startswith("1 is in the air below, 30 m above home, 9 m away horizontally")
    assert wire.vehicle("0").commands == []


@pytest.mark.parametrize(("altitude_m", "north_m"), [(80.0, 25.0), (51.0, 0.0), (150.0, 0.0)])
def test_one_that_is_aside_on_the_ground_or_above_is_no_reason(wire: Box, altitude_m: float, north_m: float) -> None:
    assert landed(over(wire, altitude_m, north_m))[0] is P.AGREE


def test_the_lower_one_may_land_and_one_that_is_not_known_is_no_reason(wire: Box) -> None:
    assert landed(over(wire), "1")[0] is P.AGREE


def test_without_a_monitor_the_other_is_not_known(wire: Box) -> None:
    assert landed(over(wire, watched=False))[0] is P.AGREE


def test_one_that_has_just_fallen_silent_is_still_there_for_twenty_seconds(wire: Box) -> None:
    over(wire)
    wire.vehicle("1").is_silent = True
    wire.run(12.0)
    assert landed(wire)[2] == "occupied"
    wire.run(12.0)
    assert landed(wire)[0] is P.AGREE
