"""What one member states about sessions moves nobody: with a roster, a session is opened anew on own evidence or by two witnesses."""

from random import Random

import pytest

from agents.platform import Platform
from federation.transport import Reopen, UndeclareToken
from tests.agents.rosters import trust
from tests.box import Box, Vehicle

LIES = ("hears nobody", "hears a platform that crashed", "hears units that there are not", "any of these, in turn")


def fleet(seed: int) -> Box:
    wire = Box(seed)
    for number in range(3):
        wire.join(str(number), Vehicle(north_m=500.0 * number), trust=trust(str(number)))
    wire.centre("cc", trust=trust("cc"))
    wire.run(2)
    return wire


def lie(wire: Box, which: str, draw: Random) -> None:
    """Platform 2 states in each heartbeat that it hears something else than it does."""
    liveness = wire.member("2").directory._liveness
    lies = {LIES[0]: [], LIES[1]: ["1"], LIES[2]: [*map(str, range(50, 90))]}

    def heard(_now_us: int) -> list[str]:
        return [*lies.get(which, lies[draw.choice(LIES[:3])])]

    liveness.heard = heard  # type: ignore[method-assign]


def opened_anew(wire: Box) -> set[str]:
    return {unit for _at_us, unit, effect in wire.wire.noted if isinstance(effect, Reopen)}


def conditions(platform: Platform) -> list[str]:
    return [each.text for each in platform._conditions()]


@pytest.mark.parametrize("which", LIES)
@pytest.mark.parametrize("seed", range(2))
def test_a_lie_about_hearing_closes_no_session(which: str, seed: int) -> None:
    wire = fleet(seed)
    if which == LIES[1]:
        wire.kill("1")
    lie(wire, which, Random(seed))
    wire.run(60)
    assert opened_anew(wire) <= {"2"}
    assert wire.member("0").directory.is_present("2")
    if which != LIES[3]:
        assert any("2 states alone" in text for text in conditions(wire.platform("0")))


def test_a_member_that_withdraws_its_token_and_beats_on_closes_no_session() -> None:
    wire = fleet(0)
    member = wire.member("2")
    for token in member.directory._tokens():
        wire.wire.perform("2", UndeclareToken(token))
    wire.run(30)
    assert opened_anew(wire) <= {"2"}


def test_what_was_stated_is_no_longer_shown_when_it_ends() -> None:
    wire = fleet(0)
    liveness = wire.member("2").directory._liveness
    lie(wire, LIES[0], Random(0))
    wire.run(15)
    assert any("states alone" in text for text in conditions(wire.platform("0")))
    del liveness.heard
    wire.run(15)
    assert not any("states alone" in text for text in conditions(wire.platform("0")))
