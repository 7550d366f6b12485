"""The configuration of one platform process, as `dyknow up` and `dyknow join` hand it over (JSON, validated here).

The options of vehicles are here, next to the tables of vehicles that are made of them; those of parts stand with the parts,
see `dyknow.agents.options`.
"""

from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeAlias

from pydantic import BeforeValidator, Field, model_validator

from dyknow.agents.options import (
    Everywhere,
    Flag,
    Modules,
    OptionPath,
    Options,
    OptionsTable,
    Strict,
    composed,
    platform_options,
)

Persona: TypeAlias = Literal["ardupilot", "ardupilot-3.3", "px4"]


def _instant_text(given: Any) -> Any:
    """TOML has dates of its own: they become the ISO text that instants are read from."""
    return given.isoformat() if isinstance(given, datetime) else given


InstantText: TypeAlias = Annotated[str, BeforeValidator(_instant_text)]
"""An instant as `dyknow.runtime.configuration.instants.instant_us` reads it."""


class SimulatedOptions(Options):
    """A simulated vehicle."""

    COMMANDS = ("up",)

    gcs: Annotated[str | None, Flag(metavar="HOST:PORT"), Everywhere()] = Field(
        None, description="Every autopilot also speaks MAVLink to this UDP port."
    )
    persona: Annotated[Persona, Flag(), Everywhere()] = Field(
        "ardupilot", description="Whose MAVLink dialect the autopilots speak."
    )


class EndpointOptions(Options):
    """The endpoint of a vehicle that speaks MAVLink."""

    COMMANDS = ("join",)

    mavlink: Annotated[str | None, Flag(metavar="ENDPOINT")] = Field(
        None, description="udpin:, udpout: or tcp:127.0.0.1:14550, or serial:/dev/ttyACM0:57600."
    )


class MavlinkOptions(Options):
    """A vehicle that speaks MAVLink."""

    COMMANDS = ("join",)

    sysid: Annotated[int | None, Flag(metavar="S")] = Field(
        None, ge=1, le=255, description="Which vehicle, when several send there."
    )
    compid: Annotated[int | None, Flag(metavar="C")] = Field(
        None, ge=0, le=255, description="The component that is its autopilot."
    )
    control: Annotated[
        bool | Literal["auto"],
        BeforeValidator(lambda given: True if given == "guided" else given),
        Flag(metavar="[auto]", typed=Literal["guided", "auto"] | None),
    ] = Field(False, description="The platform may command the vehicle; auto: and interrupt its missions.")
    signing_key: Annotated[OptionPath | None, Flag(metavar="FILE")] = Field(
        None, description="Key of MAVLink 2 signing; frames without it are refused."
    )
    unsigned: Annotated[bool, Flag()] = Field(False, description="Command the vehicle over a network without a key.")
    forward: Annotated[str | None, Flag(metavar="DESTINATION")] = Field(
        None, description="A ground station that hears the vehicle, too: udp://127.0.0.1:14550."
    )
    forward_commands: Annotated[bool, Flag()] = Field(
        False, description="Commands of that station reach the vehicle; missions then wait."
    )
    forward_beyond: Annotated[bool, Flag()] = Field(False, description="That station may be on another machine.")


class ReplayOptions(Options):
    """A recorded flight."""

    COMMANDS = ("join",)

    replay: Annotated[OptionPath | None, Flag(metavar="FILE")] = Field(
        None, description="A recorded flight: .tlog, .bin, .ulg or .mcap."
    )
    from_: Annotated[str, Flag(metavar="TIME")] = Field(
        "0s", alias="from", description="Where in the recording to begin, after its first position."
    )
    epoch: Annotated[InstantText | None, Flag(metavar="TIME")] = Field(
        None, description="When that is played; recordings may share it. [default: now]"
    )


VEHICLE_OPTIONS: Final = (SimulatedOptions, EndpointOptions, MavlinkOptions, ReplayOptions)


class WireConfig(Strict):
    """How processes of one federation find each other."""

    federation: str = "default"
    listen: tuple[str, ...] = ()
    local: str | None = None
    """A further endpoint on loopback, dialled by programs of this machine: `dyknow.runtime.configuration.local_endpoints`."""
    connect: tuple[str, ...] = ()
    discover: Literal["multicast", "none"] = "multicast"
    interface: str = "lo"
    lease_ms: int = Field(2000, ge=500, le=60_000)
    open: bool = False
    """Without a roster every process that reaches a platform may command it: beyond loopback only if allowed here."""
    security: Path | None = None
    """JSON file with mTLS and access-control settings, made by `dyknow roster`."""
    roster: Path | None = None
    """The roster, which says whose certificates are admitted; read again whenever it changes."""


class ClockConfig(Strict):
    """The federation's clock: now = epoch + speed x (node clock - epoch)."""

    epoch_us: int | None = None
    speed: float = Field(1.0, gt=0, le=1000)
    yields: bool = False
    """Whether the epoch of a federation that is there already, at this speed, goes before ours."""
    skew_us: int = 0
    """A wrong node clock, for tests of a federation with wrong clocks."""


class SimulatedVehicleConfig(SimulatedOptions):
    """A simulated UAV with its own MAVLink autopilot in the same process."""

    kind: Literal["simulated"] = "simulated"
    scenario: str = "hover"
    index: int = Field(0, ge=0)
    count: int = Field(1, ge=1)
    seed: int = 0
    origin: tuple[float, float, float] | None = None
    """Where the scenario takes place: latitude and longitude in degrees, metres above mean sea level of the ground."""
    start_us: int | None = None
    """Federation time at which routes begin; None: when the process starts."""
    faults: tuple[str, ...] = ()
    """Faults that begin by themselves, as `dropped-box at load+4s`."""


class MavlinkVehicle(MavlinkOptions):
    """Any vehicle that speaks MAVLink."""

    kind: Literal["mavlink"] = "mavlink"
    endpoint: str


class ReplayedVehicle(Strict):
    """A recorded flight (.tlog, .bin, .ulg, .mcap)."""

    kind: Literal["replay"] = "replay"
    file: Path
    from_us: int = 0
    epoch_us: int | None = None
    """Federation time at which the recording's first position plus `from_us` is played; None: when the process starts."""


class RecordedVehicle(Strict):
    """A platform of a recorded federation (`dyknow record`)."""

    kind: Literal["recorded"] = "recorded"
    file: Path
    first_us: int
    """When the recording begins, in its own time."""
    from_us: int = 0
    begin_us: int
    """Federation time at which `from_us` after that is played."""
    labels: tuple[str, ...] = ()
    """The streams of this platform that were recorded."""
    alarms: bool = True
    """Whether recorded alarms are raised again."""
    stays: bool = False
    """Whether the platform stays when all is played."""


class NoVehicle(Strict):
    """A platform without a vehicle: an observer."""

    kind: Literal["none"] = "none"


Vehicle = Annotated[
    SimulatedVehicleConfig | MavlinkVehicle | ReplayedVehicle | RecordedVehicle | NoVehicle, Field(discriminator="kind")
]


class TrustConfig(Strict):
    """With a roster acts are signed and checked; without one the federation is open, on loopback only."""

    roster: Path | None = None
    key: Path | None = None


@composed(*platform_options())
class NodeConfig(OptionsTable):
    """One platform process; the options of its parts are those that `dyknow.agents.options.platform_options` lists."""

    unit: str
    wire: WireConfig = WireConfig()
    clock: ClockConfig = ClockConfig()
    vehicle: Vehicle = Field(default_factory=NoVehicle)
    trust: TrustConfig = TrustConfig()
    trusted: dict[str, Annotated[float, Field(ge=0, le=1)]] = Field(default_factory=dict)
    """How far other platforms are trusted, by unit; others wholly."""
    period_ms: int = Field(100, ge=10, le=10_000)
    ontology: OptionPath | None = None
    """Semantic labels that not every platform has."""
    journal: Path | None = None
    extensions: Modules = ()
    """Extensions that bring parts of the platform, by entry point or module; see `dyknow.agents.extensions`."""
    hosts: Path | None = None
    """The socket at which knowledge process hosts of this machine register."""
    metrics: int | None = Field(None, ge=1, le=65_535)
    """The port of this machine at which figures for Prometheus, and health, are read."""
    duration_s: float | None = Field(None, gt=0)

    @model_validator(mode="before")
    @classmethod
    def _of_older_journals(cls, given: Any) -> Any:
        """Journals of before had the duration `govern` in milliseconds."""
        if not isinstance(given, dict) or "govern_ms" not in given:
            return given
        limit_ms = given["govern_ms"]
        rest = {key: value for key, value in given.items() if key != "govern_ms"}
        return rest if limit_ms is None else {**rest, "govern": f"{limit_ms}ms"}
