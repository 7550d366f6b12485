"""`python -m sim_uavs.node --config FILE`: one platform process with what it flies, simulated or real."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from agents.effects import InjectFault
from agents.pilot import FlightLimits
from dyknow.errors import Refused
from federation.clock import FederationClock
from navigation.vehicle import Command, Report
from proxies.mavlink_feed import MavlinkFeed
from proxies.recordings import Recording
from proxies.replay import Replay
from runtime.clock import NodeClock
from runtime.config import MavlinkVehicle, NodeConfig, ReplayedVehicle, SimulatedVehicle
from runtime.process import Fitted, serve
from sim_uavs.autopilot_server import AutopilotServer
from sim_uavs.faults import Fault, parse_fault
from sim_uavs.plans import plan_of
from sim_uavs.scenarios import ORIGIN, scenario
from sim_uavs.settings import Peer, Place

SETTLE_US = 3_000_000
"""How long after the start routes begin, unless the configuration says when."""


class SimulatedUav:
    """An autopilot and the feed that hears it, over real MAVLink on loopback."""

    def __init__(self, server: AutopilotServer, feed: MavlinkFeed, clock: FederationClock) -> None:
        self._server, self._feed, self._clock = server, feed, clock

    def start(self) -> None:
        self._server.start()
        self._feed.start()

    def stop(self) -> None:
        self._feed.stop()
        self._server.stop()

    def command(self, command: Command) -> None:
        self._feed.command(command)

    def inject(self, fault: InjectFault) -> None:
        """Raises TextError for a fault that is not known."""
        text = fault.kind if fault.value is None else f"{fault.kind}={fault.value}"
        found: Fault = parse_fault(text)
        duration_us = None if fault.until_us is None else fault.until_us - self._server.now_us()
        self._server.inject(found, duration_us)


class FlownVehicle:
    """A vehicle somewhere else, heard and commanded over MAVLink."""

    def __init__(self, feed: MavlinkFeed) -> None:
        self._feed = feed

    def start(self) -> None:
        self._feed.start()

    def stop(self) -> None:
        self._feed.stop()

    def command(self, command: Command) -> None:
        self._feed.command(command)

    def inject(self, fault: InjectFault) -> None:
        raise Refused(f"{fault.kind}: only simulated vehicles take faults")


class ReplayedFlight:
    """A recorded flight; it cannot be commanded."""

    def __init__(self, replay: Replay) -> None:
        self._replay = replay

    def start(self) -> None:
        self._replay.start()

    def stop(self) -> None:
        self._replay.stop()

    def command(self, command: Command) -> None:
        raise Refused(f"{type(command.order).__name__}: a recording cannot be commanded")

    def inject(self, fault: InjectFault) -> None:
        raise Refused(f"{fault.kind}: only simulated vehicles take faults")


def make_vehicle(
    config: NodeConfig,
    clock: FederationClock,
    node_clock: NodeClock,
    post: Callable[[Report], None],
    ended: Callable[[], None],
) -> Fitted:
    """What the configuration says this platform flies."""

    def now_us() -> int:
        return clock.federation_us(node_clock.now_us())

    limits = FlightLimits(config.floor_m, config.ceiling_m)
    vehicle = config.vehicle
    match vehicle:
        case SimulatedVehicle():
            return _simulated(vehicle, clock, node_clock, now_us, post, limits)
        case MavlinkVehicle():
            feed = MavlinkFeed(vehicle.endpoint, vehicle.sysid, post, now_us)
            return Fitted(FlownVehicle(feed), {"control": vehicle.control, "limits": limits})
        case ReplayedVehicle():
            return Fitted(ReplayedFlight(_replay(vehicle, clock, now_us, post, ended)), {})
        case _:
            return Fitted(None, {})


def _simulated(
    vehicle: SimulatedVehicle,
    clock: FederationClock,
    node_clock: NodeClock,
    now_us: Callable[[], int],
    post: Callable[[Report], None],
    limits: FlightLimits,
) -> Fitted:
    origin = ORIGIN if vehicle.origin is None else Place(*vehicle.origin)
    unit = scenario(vehicle.scenario, vehicle.count, vehicle.seed, origin).units[vehicle.index]
    flown = unit.vehicle(vehicle.index % 254 + 1, persona=vehicle.persona, airborne=True)
    if vehicle.gcs is not None:
        flown = _with_peer(flown, _address(vehicle.gcs))
    server = AutopilotServer(flown, clock=clock, wall_us=node_clock.now_us)
    feed = MavlinkFeed(f"udpout:127.0.0.1:{server.port}", flown.system_id, post, now_us, driven=True)
    start_us = vehicle.start_us if vehicle.start_us is not None else now_us() + SETTLE_US
    changes: dict[str, Any] = {
        "control": True,
        "simulated": True,
        "limits": limits,
        "plan": plan_of(unit.route, start_us),
    }
    return Fitted(SimulatedUav(server, feed, clock), changes)


def _with_peer(flown: Any, peer: Peer) -> Any:
    from dataclasses import replace

    return replace(flown, peers=(*flown.peers, peer))


def _address(text: str) -> Peer:
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit():
        raise Refused(f"--gcs {text!r} is no address; write HOST:PORT, e.g. 127.0.0.1:14550")
    return host, int(port)


def _replay(
    vehicle: ReplayedVehicle,
    clock: FederationClock,
    now_us: Callable[[], int],
    post: Callable[[Report], None],
    ended: Callable[[], None],
) -> Replay:
    recording = Recording.open(vehicle.file)
    epoch_us = vehicle.epoch_us if vehicle.epoch_us is not None else now_us()
    return Replay(
        recording, epoch_us, vehicle.from_us, post, now_us, speed=clock.speed, on_end=lambda _problem: ended()
    )


def main() -> int:
    """Read the configuration and run."""
    parser = argparse.ArgumentParser(prog="python -m sim_uavs.node", description=__doc__)
    parser.add_argument("--config", type=Path, required=True, help="JSON file with the configuration of the platform")
    path = parser.parse_args().config
    try:
        config = NodeConfig.model_validate_json(path.read_bytes())
    except (OSError, ValidationError) as wrong:
        parser.error(f"{path}: {wrong}")
    if config.vehicle.kind != "none":
        import filterpy.kalman  # noqa: F401  half a second: before the session opens, not while others wait for us
    return serve(config, make_vehicle)


if __name__ == "__main__":
    raise SystemExit(main())
