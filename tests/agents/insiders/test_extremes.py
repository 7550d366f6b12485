"""The last number that is understood is borne by whoever counts on from there; the fuzz notices who is moved."""

import pytest

from agents.flight.arbiter import Commander
from federation.messages import contents
from federation.messages.contents.parts import LAST_GENERATION, next_generation
from navigation.vehicle import HoldOrder
from tests.agents.insiders.federations import HostileFederation, OrderGiven


def test_a_generation_is_counted_on_until_the_last_one():
    assert next_generation(0) == 1
    assert next_generation(LAST_GENERATION) == LAST_GENERATION


def test_an_order_that_no_member_may_give_is_noticed():
    """The command centre speaks where it is taken to be silent."""
    federation = HostileFederation("hover", 1)
    federation.world.ask("cc", "0", contents.Hold())
    federation.world.run_for(0.5)
    with pytest.raises(AssertionError, match="HoldOrder"):
        federation.check()
    assert federation.orders == [OrderGiven("0", HoldOrder(), Commander.ORDER, "")]
