"""Aircraft that are no members: a vehicle yields to each of them, and no act is sent to any."""

from dyknow.agents.capabilities.separation.neighbourhood import Neighbourhood
from dyknow.federation.messages.contents import MonitorProximity
from tests.agents.capabilities.separation.meetings import notes, orders
from tests.agents.capabilities.traffic.heard import Straight, listen
from tests.box import Box, Vehicle

DRONE = Straight("rid-stranger", east_m=200.0, altitude_m=101.0, east_m_s=-6.0, source="remote-id", error_m=3.0)


def flying(box: Box, **settings: object) -> int:
    box.join("0", Vehicle(altitude_m=100.0), control=True, **settings)
    box.join("1", Vehicle(north_m=900.0))
    box.centre()
    box.run(2.0)
    box.ask("cc", "0", MonitorProximity())
    box.run(1.0)
    return box.clock.federation_us(box.now_us)


def test_a_stranger_that_comes_at_a_vehicle_is_given_way_to(wire: Box) -> None:
    begun_us = flying(wire)
    listen(wire, "0", 25.0, DRONE, begun_us=begun_us)
    assert orders(wire, "0")
    assert any(line.endswith(" for rid-stranger") for line in notes(wire, "0"))
    assert orders(wire, "1") == []
    assert not wire.acts(head="avoid")


def test_one_that_passes_far_above_is_none_of_its_concern(wire: Box) -> None:
    begun_us = flying(wire)
    listen(wire, "0", 30.0, DRONE._replace(altitude_m=170.0), begun_us=begun_us)
    assert orders(wire, "0") == []


def test_one_that_is_no_longer_heard_is_no_traffic(wire: Box) -> None:
    begun_us = flying(wire)
    listen(wire, "0", 5.0, DRONE, begun_us=begun_us)
    part = wire.platform("0").part(Neighbourhood)
    assert "rid-stranger" in part.others.by_unit
    wire.run(25.0)
    assert "rid-stranger" not in part.others.by_unit
