"""Kinds of vehicles by name, as the configuration names them.

A kind is registered by the module that builds it. The kinds of real vehicles are registered here; a room above, such
as the simulator, registers its own, and the process is started with the name of that module (`--vehicles`).
"""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from dyknow.agents.capabilities.flight.options import FlightOptions
from dyknow.agents.effects import InjectFault
from dyknow.agents.places import FlightLimits
from dyknow.federation.members.clock import FederationClock
from dyknow.model.errors import Refused, UnitError
from dyknow.navigation.vehicle import Command, Report
from dyknow.runtime.clock import NodeClock
from dyknow.runtime.configuration.config import NodeConfig

if TYPE_CHECKING:
    from dyknow.proxies.mavlink.port import MavlinkPort


class VehiclePart(Protocol):
    """A thread or socket of a vehicle: started with the process, stopped with it."""

    def start(self) -> None: ...
    def stop(self) -> None: ...


def _no_command(command: Command) -> None:
    raise Refused(f"{type(command.order).__name__}: this platform has no vehicle that can be commanded", "no-vehicle")


def _no_fault(fault: InjectFault) -> None:
    raise Refused(f"{fault.kind}: only simulated vehicles take faults", "not-simulated")


@dataclass(frozen=True)
class Vehicle:
    """A vehicle, ready to start.

    Attributes:
        parts: started in this order, stopped in the opposite one.
        settings: fields of `PlatformConfig` that follow from it.
        command: gives it an order; raises Refused.
        inject: makes it fail; raises Refused, or TextError for an unknown fault.
    """

    parts: Sequence[VehiclePart] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    command: Callable[[Command], None] = _no_command
    inject: Callable[[InjectFault], None] = _no_fault

    def start(self) -> None:
        for part in self.parts:
            part.start()

    def stop(self) -> None:
        for part in reversed(self.parts):
            part.stop()


class SharedPorts:
    """MAVLink endpoints that are open in this process: vehicles of several platforms that speak at one share it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._open: dict[tuple[str, bytes | None], MavlinkPort] = {}

    def port(self, endpoint: str, key: bytes | None) -> "MavlinkPort":
        """The port of an endpoint, opened when it is first asked for; raises EndpointFailed."""
        from dyknow.proxies.mavlink.port import MavlinkPort

        with self._lock:
            if (endpoint, key) not in self._open:
                self._open[endpoint, key] = MavlinkPort(endpoint, key=key)
            return self._open[endpoint, key]


class VehiclePorts(NamedTuple):
    """The ports of a vehicle: configuration, clocks, a mailbox for its reports, and a callback for its end.

    `shared` has what it may share with vehicles of other platforms of this process; `happen` takes events that are no
    reports; `note` takes words for users.
    """

    config: NodeConfig
    clock: FederationClock
    node_clock: NodeClock
    post: Callable[[Report], None]
    ended: Callable[[], None]
    shared: "SharedPorts | None" = None
    happen: Callable[[Any], None] = lambda _event: None
    note: Callable[[str], None] = lambda _text: None

    def limits(self) -> FlightLimits:
        """Floor, ceiling and range of commanded flight, and the ground below; raises WrongCall for a file that is none."""
        options, elevation = self.config[FlightOptions], None
        if options.elevation is not None:
            from dyknow.runtime.configuration.elevation_files import read_elevation

            elevation = read_elevation(options.elevation)
            self.note(f"the floor of {options.floor_m:.0f} m is above the ground, too: {elevation}")
        return FlightLimits(options.floor_m, options.ceiling_m, options.range_m, elevation)

    def now_us(self) -> int:
        """Federation time."""
        return self.clock.federation_us(self.node_clock.now_us())


BuildVehicle = Callable[[Any, VehiclePorts], Vehicle]
"""(the `vehicle` table of the configuration, ports) -> the vehicle."""
_KINDS: dict[str, BuildVehicle] = {}


def vehicle_kind(name: str) -> Callable[[BuildVehicle], BuildVehicle]:
    """Register a function that builds vehicles of the kind `name`."""

    def register(build: BuildVehicle) -> BuildVehicle:
        _KINDS[name] = build
        return build

    return register


def build_vehicle(ports: VehiclePorts, modules: Sequence[str] = (), shared: SharedPorts | None = None) -> Vehicle:
    """The vehicle that the configuration names; `modules` register further kinds, and are imported only for them.

    Raises:
        UnitError: no module registers the kind.
    """
    table = ports.config.vehicle
    for module in modules if table.kind not in _KINDS else ():
        import_module(module)
    if table.kind not in _KINDS:
        raise UnitError(f"no vehicle is of kind {table.kind!r}; kinds are {', '.join(sorted(_KINDS))}")
    return _KINDS[table.kind](table, ports._replace(shared=shared or SharedPorts()))


@vehicle_kind("none")
def _none(_table: Any, _ports: VehiclePorts) -> Vehicle:
    """An observer."""
    return Vehicle()


@vehicle_kind("mavlink")
def _mavlink(table: Any, ports: VehiclePorts) -> Vehicle:
    """A vehicle outside this process, heard and commanded over MAVLink."""
    from dyknow.proxies.mavlink.endpoints import parse_endpoint
    from dyknow.proxies.mavlink.feed import MavlinkFeed
    from dyknow.proxies.mavlink.signing import insist_on_key, read_key

    key = None if table.signing_key is None else read_key(table.signing_key)
    endpoint = parse_endpoint(table.endpoint)
    insist_on_key(endpoint, "mavlink", control=bool(table.control), has_key=key is not None, unsigned=table.unsigned)
    port = (ports.shared or SharedPorts()).port(table.endpoint, key)
    feed = MavlinkFeed(port, table.sysid, ports.post, ports.now_us, compid=table.compid)
    parts: list[VehiclePart] = [feed]
    if table.forward is not None:
        from dyknow.proxies.outward.forwarding import Forwarder
        from dyknow.proxies.outward.outlets import parse_destination

        to = parse_destination(table.forward, beyond=True, kinds=("udp",))
        forwarder = Forwarder(
            to,
            lambda: feed.system,
            port,
            ports.post,
            ports.now_us,
            commands=table.forward_commands,
            takes_positions=feed.takes_positions,
        )
        port.forwards += (forwarder.on_frame,)
        parts.insert(0, forwarder)
    settings = {"control": bool(table.control), "missions": table.control == "auto", "limits": ports.limits()}
    return Vehicle(parts, settings, feed.command)


def _played(ports: VehiclePorts, problem: str, *, stays: bool = False) -> None:
    """A recording has been played, up to its end or to its damage."""
    if problem:
        ports.note(problem)
    if not stays:
        ports.ended()


@vehicle_kind("replay")
def _replay(table: Any, ports: VehiclePorts) -> Vehicle:
    """A recorded flight; it cannot be commanded."""
    from dyknow.proxies.recordings.formats import open_recording
    from dyknow.proxies.recordings.replay import Replay

    epoch_us = ports.now_us() if table.epoch_us is None else table.epoch_us
    replay = Replay(
        open_recording(table.file),
        epoch_us,
        table.from_us,
        ports.post,
        ports.now_us,
        speed=ports.clock.speed,
        on_end=partial(_played, ports),
    )
    return Vehicle((replay,))


@vehicle_kind("recorded")
def _recorded(table: Any, ports: VehiclePorts) -> Vehicle:
    """A platform of a recorded federation: it has streams and alarms, and no vehicle."""
    from dyknow.agents.playback.recorded_platform import RecordedPlatform
    from dyknow.runtime.recordings.playback import Playback

    playback = Playback(
        table, ports.config.unit, ports.happen, ports.now_us, ports.node_clock.now_us,
        speed=ports.clock.speed, on_end=partial(_played, ports, stays=table.stays),
    )  # fmt: skip
    return Vehicle((playback,), {"vehicle": False, "extensions": (RecordedPlatform,)})
