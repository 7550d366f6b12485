"""A federation as a TOML file describes it: name, clock, endpoints, roster, scenario, and what is special per unit."""

from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from console.errors import WrongCall
from console.toml import read_model

Persona: TypeAlias = Literal["ardupilot", "px4"]
Discover: TypeAlias = Literal["multicast", "none"]


def _instant_text(given: Any) -> Any:
    """TOML has dates of its own: they become the ISO text that instants are read from."""
    return given.isoformat() if isinstance(given, datetime) else given


InstantText: TypeAlias = Annotated[str, BeforeValidator(_instant_text)]
"""An instant as `console.instants.instant_us` reads it."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class ClockFile(_Strict):
    """`[clock]`: the federation's clock runs `speed` times faster than the wall from `epoch` on."""

    epoch: InstantText | None = None
    speed: float = Field(default=1.0, gt=0, le=1000)


class UnitFile(_Strict):
    """`[unit.U]`: what platform U has that the others have not. At most one of `mavlink` and `replay`."""

    persona: Persona | None = None
    avoidance: bool | None = None
    gcs: str | None = None
    mavlink: str | None = None
    sysid: int | None = Field(default=None, ge=1, le=255)
    control: bool = False
    replay: Path | None = None
    from_: str | None = Field(default=None, alias="from")
    epoch: InstantText | None = None
    listen: tuple[str, ...] | None = None
    connect: tuple[str, ...] | None = None
    translation: Path | None = None
    profiles: Path | None = None


class FederationFile(_Strict):
    """The whole file; every key but `name` may be missing. Relative paths are relative to the file."""

    name: str
    clock: ClockFile = ClockFile()
    units: int | None = Field(default=None, ge=0, le=250)
    scenario: str | None = None
    seed: int | None = None
    persona: Persona | None = None
    avoidance: bool | None = None
    duration: str | None = None
    listen: tuple[str, ...] | None = None
    connect: tuple[str, ...] | None = None
    discover: Discover | None = None
    interface: str | None = None
    roster: Path | None = None
    journal: Path | None = None
    """Directory in which each platform keeps what reaches it, as `<unit>.mcap`, anew with every start."""
    unit: dict[str, UnitFile] = Field(default_factory=dict)


def read_federation(path: Path) -> FederationFile:
    """The federation that `path` describes, its paths made absolute.

    Raises:
        WrongCall: naming file, line and remedy.
    """
    found = read_model(path, FederationFile)
    base = path.resolve().parent
    units = {}
    for unit, special in found.unit.items():
        if special.mavlink and special.replay:
            raise WrongCall(f"{path}: [unit.{unit}] has both mavlink and replay; a platform has one vehicle: keep one.")
        changes = {
            name: base / given for name in ("replay", "translation", "profiles") if (given := getattr(special, name))
        }
        units[unit] = special.model_copy(update=changes)
    whole = {name: base / given for name in ("roster", "journal") if (given := getattr(found, name))}
    return found.model_copy(update={"unit": units, **whole})
