"""Fences that a ground station uploads: served and kept by the autopilots, read and kept by the platform."""

from queue import Queue

import pytest
from pymavlink.dialects.v20 import all as mavlink

from dyknow.agents.places import fences_of
from dyknow.model.errors import Refused
from dyknow.navigation.fences import FenceArea, FenceKind
from dyknow.navigation.vehicle import FenceReport, Report
from dyknow.proxies.mavlink.feed import MavlinkFeed
from dyknow.runtime.clock import NodeClock
from dyknow.sim_uavs.autopilot.server import AutopilotServer
from dyknow.sim_uavs.dynamics.flight import Mode
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from dyknow.sim_uavs.dynamics.settings import PersonaName, VehicleConfig, VehicleSettings
from dyknow.sim_uavs.dynamics.vehicles import SimulatedVehicle
from tests.sim_uavs.piloted import HOME, NORTH_DEG, START_US, Piloted
from tests.sim_uavs.station import Station

BOTH = pytest.mark.parametrize("persona", ["ardupilot", "px4"])
FENCE = mavlink.MAV_MISSION_TYPE_FENCE
WALL = FenceArea(FenceKind.EXCLUSION, centre=(HOME.latitude_deg + 100 * NORTH_DEG, HOME.longitude_deg), radius_m=20.0)
SQUARE = tuple((HOME.latitude_deg + n * NORTH_DEG, HOME.longitude_deg + e * NORTH_DEG) for n, e in ((-50, -250), (250, -250), (250, 250), (-50, 250)))  # fmt: skip
YARD = FenceArea(FenceKind.INCLUSION, SQUARE)


def fenced(persona: PersonaName, *areas: FenceArea) -> Piloted:
    """A vehicle that hovers at home within its fence, which its platform has read."""
    flown = Piloted(persona)
    flown.settings.fence_on = 2.0 if persona == "px4" else 1.0
    flown.settings.fence_kinds = 4.0
    flown.settings.fence_highest_m = flown.settings.fence_radius_m = 1000.0
    upload(flown, areas)
    flown.vehicle.lists.restart()
    flown.pilot.on_report(FenceReport(0, areas=areas, is_union=persona == "px4"), flown.now_us)
    flown.run(1.0)
    return flown


def upload(flown: Piloted, areas: tuple[FenceArea, ...]) -> None:
    flown.vehicle.autopilot.fence.take(areas)


def items(*areas: FenceArea) -> list:
    found = []
    for area in areas:
        command = {
            (FenceKind.INCLUSION, True): 5001,
            (FenceKind.EXCLUSION, True): 5002,
            (FenceKind.INCLUSION, False): 5003,
        }.get((area.kind, bool(area.corners)), 5004)
        for latitude_deg, longitude_deg in area.corners or (area.centre,):
            found.append(
                mavlink.MAVLink_mission_item_int_message(
                    1, 1, len(found), 0, command, 0, 1, len(area.corners) or area.radius_m, 0.0, 0.0, 0.0,
                    round(latitude_deg * 1e7), round(longitude_deg * 1e7), 0.0, FENCE,
                )
            )  # fmt: skip
    return found


def sent(station: Station, uploaded: list) -> int:
    """The result of an upload."""
    told = station.send(mavlink.MAVLink_mission_count_message(1, 1, len(uploaded), FENCE))
    while not (final := [m for m in told if m.get_type() == "MISSION_ACK"]):
        (request,) = [m for m in told if m.get_type() == "MISSION_REQUEST_INT"]
        assert request.mission_type == FENCE
        told = station.send(uploaded[request.seq])
    assert final[0].mission_type == FENCE
    return final[0].type


@BOTH
def test_a_fence_is_uploaded_read_back_and_cleared_and_the_mission_is_another_list(persona: PersonaName) -> None:
    station = Station(persona)
    uploaded = items(YARD, WALL)
    assert sent(station, uploaded) == mavlink.MAV_MISSION_ACCEPTED
    (count,) = station.send(mavlink.MAVLink_mission_request_list_message(1, 1, FENCE))
    assert count.count == 5
    for one in uploaded:
        (back,) = station.send(mavlink.MAVLink_mission_request_int_message(1, 1, one.seq, FENCE))
        for name in ("seq", "command", "param1", "x", "y", "mission_type"):
            assert getattr(back, name) == getattr(one, name)
    (count,) = station.send(mavlink.MAVLink_mission_request_list_message(1, 1, 0))
    assert count.count == 0
    (ack,) = station.send(mavlink.MAVLink_mission_clear_all_message(1, 1, FENCE))
    assert ack.type == mavlink.MAV_MISSION_ACCEPTED
    assert station.vehicle.fence.areas == ()


def test_a_fence_that_is_wrong_is_refused_and_the_one_before_is_kept() -> None:
    station = Station("px4")
    sent(station, items(YARD))
    wrong = items(YARD)
    wrong[2].param1 = 7.0
    assert sent(station, wrong) == mavlink.MAV_MISSION_INVALID
    assert len(station.vehicle.fence.areas) == 1


@BOTH
def test_the_platform_reads_it_over_the_wire_and_offers_it(persona: PersonaName) -> None:
    station_items = items(YARD, WALL)
    flown = Piloted(persona)
    for message in (mavlink.MAVLink_mission_count_message(1, 1, len(station_items), FENCE), *station_items):
        flown.vehicle._send(message, flown.now_us)
    value = flown.vehicle.autopilot._persona.on_wire
    name, one = ("GF_ACTION", 1.0) if persona == "px4" else ("FENCE_ENABLE", 1.0)
    kind = next(each for each in flown.vehicle.autopilot._persona.parameters if each.name == name)
    flown.vehicle._send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), value(kind, one), 6), flown.now_us)
    flown.vehicle.lists.restart()
    flown.run(2.0)
    fence = flown.pilot.bounds.fence
    assert fence is not None
    assert [area.kind for area in fence.areas] == [FenceKind.INCLUSION, FenceKind.EXCLUSION]
    assert fence.areas[1].radius_m == 20.0
    assert fence.is_union is (persona == "px4")
    offered = fences_of(flown.pilot.bounds, flown.pilot.limits, {})
    assert [each.name for each in offered][2:] == [
        "autopilot: inclusion fence (4 corners)", "autopilot: exclusion fence (circle of 20 m)",
    ]  # fmt: skip
    assert len(offered[2].corners) == 4
    with pytest.raises(Refused, match="straight way there crosses the autopilot's exclusion fence"):
        flown.goto(200.0)
    with pytest.raises(Refused, match="not 2 m outside of the autopilot's exclusion fence"):
        flown.goto(100.0)
    with pytest.raises(Refused, match="not 2 m inside the autopilot's inclusion fence"):
        flown.goto(-49.0)
    flown.goto(60.0)
    flown.until(lambda: flown.flight.body.position.north > 59.0)


@BOTH
def test_the_autopilot_refuses_a_place_outside_in_its_own_way(persona: PersonaName) -> None:
    flown = fenced(persona, WALL)
    flown.pilot.bounds.fence = None
    flown.goto(100.0)
    flown.run(1.5)
    errand = flown.pilot.errand
    assert errand is not None
    if persona == "px4":
        assert flown.until(lambda: "Reposition is outside geofence" in errand.reason, within_s=4.0) < 4.0
    else:
        assert errand.reason.startswith("autopilot: failed")
    assert flown.flight.body.position.horizontal < 2.0


@pytest.mark.parametrize(
    ("persona", "on", "mode"),
    [("ardupilot", 1.0, Mode.RTL), ("px4", 1.0, Mode.GUIDED), ("px4", 3.0, Mode.RTL), ("px4", 5.0, Mode.LAND)],
)
def test_a_vehicle_that_flies_into_an_exclusion_does_what_its_parameter_says(
    persona: PersonaName, on: float, mode: Mode
) -> None:
    flown = fenced(persona, WALL)
    flown.settings.fence_on = on
    assert flown.flight.go_to(Vector(200.0, 0.0, -50.0)).value == "accepted", "only the place is judged"
    flown.until(lambda: flown.flight.body.position.north > 82.0)
    flown.run(0.5)
    assert flown.flight.mode is mode


def test_several_inclusions_are_all_kept_by_one_and_any_by_the_other() -> None:
    other = FenceArea(
        FenceKind.INCLUSION, centre=(HOME.latitude_deg + 240 * NORTH_DEG, HOME.longitude_deg), radius_m=60.0
    )
    for persona, options, is_taken in (("ardupilot", 0.0, False), ("ardupilot", 2.0, True), ("px4", 0.0, True)):
        flown = fenced(persona)
        flown.settings.fence_options = options
        upload(flown, (YARD, other))
        assert (flown.flight.go_to(Vector(20.0, 0.0, -50.0)).value == "accepted") is is_taken


def test_a_vehicle_without_bytes_has_its_fence_from_its_configuration() -> None:
    settings = VehicleSettings(fence_on=1.0, fence_kinds=4.0)
    vehicle = SimulatedVehicle(VehicleConfig(1, HOME, airborne_m=50.0, fence=(WALL,), settings=settings), START_US)
    (told,) = [report for report in vehicle.on_time(START_US + 100_000, 7) if isinstance(report, FenceReport)]
    assert told == FenceReport(7, areas=(WALL,))
    assert vehicle.flight.go_to(Vector(100.0, 0.0, -50.0)).value == "outside the fence"


@BOTH
def test_a_feed_reads_it_from_a_vehicle_on_a_socket(persona: PersonaName) -> None:
    posted: Queue[Report] = Queue()
    feed = MavlinkFeed("udpin:127.0.0.1:0", 1, posted.put, NodeClock().now_us)
    peer = feed.port.address
    settings = VehicleSettings(fence_on=1.0, fence_kinds=4.0)
    config = VehicleConfig(1, HOME, persona, airborne_m=50.0, fence=(YARD, WALL), settings=settings, peers=(peer,))
    feed.start()
    try:
        with AutopilotServer(config):
            while not (isinstance(report := posted.get(timeout=10.0), FenceReport) and report.areas):
                pass
    finally:
        feed.stop()
    assert [area.kind for area in report.areas] == [FenceKind.INCLUSION, FenceKind.EXCLUSION]
    assert report.areas[1].radius_m == 20.0
