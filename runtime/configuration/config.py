"""The configuration of one platform process, as `dyknow up` and `dyknow join` hand it over (JSON, validated here)."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field


class Strict(BaseModel):
    """Unknown keys are errors: a misspelt option must not be ignored."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class WireConfig(Strict):
    """How processes of one federation find each other."""

    federation: str = "default"
    listen: tuple[str, ...] = ()
    local: str | None = None
    """A further endpoint on loopback, which programs of this machine dial: see `runtime.configuration.local_endpoints`."""
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


class SimulatedVehicleConfig(Strict):
    """A simulated UAV with its own MAVLink autopilot in the same process."""

    kind: Literal["simulated"] = "simulated"
    scenario: str = "hover"
    index: int = Field(0, ge=0)
    count: int = Field(1, ge=1)
    seed: int = 0
    persona: Literal["ardupilot", "ardupilot-3.3", "px4"] = "ardupilot"
    gcs: str | None = None
    origin: tuple[float, float, float] | None = None
    """Where the scenario takes place: latitude and longitude in degrees, metres above mean sea level of the ground."""
    start_us: int | None = None
    """Federation time at which routes begin; None: when the process starts."""
    faults: tuple[str, ...] = ()
    """Faults that begin by themselves, as `dropped-box at load+4s`."""


class MavlinkVehicle(Strict):
    """Any vehicle that speaks MAVLink."""

    kind: Literal["mavlink"] = "mavlink"
    endpoint: str
    sysid: int | None = Field(None, ge=1, le=255)
    compid: int | None = Field(None, ge=0, le=255)
    """The autopilot's component id; None: 1, or that of the only component that says it is an autopilot."""
    control: bool | Literal["auto"] = False
    """Whether the platform may command it; `auto`: and interrupt its missions to give way."""
    signing_key: Path | None = None
    forward: str | None = None
    """A ground station that gets what the vehicle sends, `udp://127.0.0.1:14550`."""
    forward_commands: bool = False
    """Whether what that station sends reaches the vehicle."""
    unsigned: bool = False
    """Whether the vehicle may be commanded over a network without a key."""


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


class NodeConfig(Strict):
    """One platform process."""

    unit: str
    wire: WireConfig = WireConfig()
    clock: ClockConfig = ClockConfig()
    vehicle: Vehicle = Field(default_factory=NoVehicle)
    trust: TrustConfig = TrustConfig()
    trusted: dict[str, Annotated[float, Field(ge=0, le=1)]] = Field(default_factory=dict)
    """How far other platforms are trusted, by unit; others wholly."""
    avoidance: bool = True
    shedding: bool = True
    period_ms: int = Field(100, ge=10, le=10_000)
    floor_m: float = Field(10.0, allow_inf_nan=False)
    ceiling_m: float = Field(120.0, allow_inf_nan=False)
    range_m: float = Field(1000.0, gt=0, allow_inf_nan=False)
    elevation: Path | None = None
    """Heights of the ground, above which the floor is, too."""
    ontology: Path | None = None
    """Semantic labels that not every platform has."""
    translation: Path | None = None
    profiles: Path | None = None
    journal: Path | None = None
    encounters: Path | None = None
    """Directory in which it keeps a record of each encounter."""
    spec: Path | None = None
    """A specification of knowledge processing, taken in again whenever the file changes."""
    units: tuple[str, ...] = ()
    """Modules with sources and computational units of the specification."""
    extensions: tuple[str, ...] = ()
    """Extensions that bring parts of the platform, by entry point or module; see `agents.extensions`."""
    govern_ms: float | None = Field(None, gt=0, le=60_000)
    """While delays are longer than this the periods of the least important streams are lengthened."""
    admit: Literal["refuse", "longer"] = "refuse"
    """Declarations that there is no time for: refused, or served at a longer period until there is."""
    learnt: Path | None = None
    """Directory in which it keeps what its streams of beliefs learn."""
    feed: Path | None = None
    """Samples of the specification's sources."""
    roads: Path | None = None
    """Roads on which linked objects are, unless the specification names others."""
    hosts: Path | None = None
    """The socket at which knowledge process hosts of this machine register."""
    metrics: int | None = Field(None, ge=1, le=65_535)
    """The port of this machine at which figures for Prometheus, and health, are read."""
    duration_s: float | None = Field(None, gt=0)
