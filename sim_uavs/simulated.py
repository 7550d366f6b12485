"""The kind of vehicle `simulated`: an autopilot in this process and the feed that hears it, over real MAVLink on loopback."""

from dataclasses import replace
from typing import Any

from dyknow.agents.effects import InjectFault
from dyknow.agents.specification.options import RunOptions
from dyknow.model.errors import Refused
from dyknow.proxies.mavlink.feed import MavlinkFeed
from dyknow.runtime.configuration.config import SimulatedVehicleConfig
from dyknow.runtime.vehicles import Vehicle, VehiclePorts, vehicle_kind
from dyknow.sim_uavs.autopilot.server import AutopilotServer
from dyknow.sim_uavs.dynamics.faults import parse_fault, parse_fault_at
from dyknow.sim_uavs.dynamics.flight_plans import plan_of
from dyknow.sim_uavs.dynamics.scenarios import ORIGIN, scenario
from dyknow.sim_uavs.dynamics.settings import HomePlace, Peer

SETTLE_US = 3_000_000
"""How long after the start routes begin, unless the configuration says when."""


@vehicle_kind("simulated")
def simulated(table: SimulatedVehicleConfig, ports: VehiclePorts) -> Vehicle:
    """One vehicle of a scenario.

    Raises:
        TextError: there is no such scenario, or fault.
        Refused: the ground station's address is none.
    """
    origin = ORIGIN if table.origin is None else HomePlace(*table.origin)
    situation = scenario(table.scenario, table.count, table.seed, origin)
    unit = situation.units[table.index]
    flown = unit.vehicle(table.index % 254 + 1, persona=table.persona, airborne=situation.depot is None)
    settings: dict[str, Any] = {}
    carried, hoist = None, None
    if situation.streets is not None:
        from dyknow.sim_uavs.roads.layouts import network_of
        from dyknow.sim_uavs.streets import carried_over, roads_of

        carried, settings["cameras"] = carried_over(situation, unit, table.seed)
        flown = replace(flown, has_mount=True)
        if ports.config[RunOptions].roads is None:
            settings["roads"] = network_of(roads_of(situation))
    if situation.depot is not None:
        from dyknow.sim_uavs.depot import at_work, loader

        carried, settings["cameras"], hoist = at_work(situation, unit, table.seed, ports.config.hosts)
        flown = loader(flown, situation.depot)
    if table.gcs is not None:
        flown = replace(flown, peers=(*flown.peers, _address(table.gcs)))
    flown = replace(flown, faults=tuple(map(parse_fault_at, table.faults)))
    server = AutopilotServer(
        flown, clock=ports.clock, wall_us=ports.node_clock.now_us, carried=carried, on_image=ports.post, hoist=hoist
    )
    feed = MavlinkFeed(f"udpout:127.0.0.1:{server.port}", flown.system_id, ports.post, ports.now_us, driven=True)
    start_us = ports.now_us() + SETTLE_US if table.start_us is None else table.start_us

    def inject(fault: InjectFault) -> None:
        duration_us = None if fault.until_us is None else fault.until_us - server.now_us()
        text = fault.kind if fault.value is None else f"{fault.kind}={fault.value}"
        server.inject(parse_fault(text), duration_us)

    settings |= {"control": True, "simulated": True, "limits": ports.limits()}
    if situation.depot is None:
        settings["plan"] = plan_of(unit.route, start_us)
    return Vehicle((server, feed), settings, feed.command, inject)


def _address(text: str) -> Peer:
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit():
        raise Refused(f"--gcs: got {text!r}, expected HOST:PORT, e.g. 127.0.0.1:14550", "text")
    return host, int(port)
