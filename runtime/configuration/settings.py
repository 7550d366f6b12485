"""The settings of a federation and its platforms: from flags, then `DYKNOW_*` variables, then TOML files.

There are two files of the same keys: `--config FILE.toml` goes before the federation's own file, `--federation FILE.toml`,
which has a `name`, and whose relative paths are relative to it.
"""

import os
import re
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BeforeValidator, Field, ValidationError

from dyknow.model.errors import WrongCall, did_you_mean
from runtime.configuration.config import Strict
from runtime.configuration.toml import explained, read_model, read_toml

Persona: TypeAlias = Literal["ardupilot", "ardupilot-3.3", "px4"]
_NAME = re.compile(r"(?=.{1,64}\Z)[a-z0-9][a-z0-9_-]*")


def _split(given: Any) -> Any:
    """A text, such as a variable, holds several items with commas between them."""
    return tuple(part.strip() for part in given.split(",") if part.strip()) if isinstance(given, str) else given


def _instant_text(given: Any) -> Any:
    """TOML has dates of its own: they become the ISO text that instants are read from."""
    return given.isoformat() if isinstance(given, datetime) else given


Items: TypeAlias = Annotated[tuple[str, ...], BeforeValidator(_split)]
InstantText: TypeAlias = Annotated[str, BeforeValidator(_instant_text)]
"""An instant as `runtime.configuration.instants.instant_us` reads it."""


class ClockFile(Strict):
    """`[clock]`: the federation's clock runs `speed` times faster than the wall from `epoch` on."""

    epoch: InstantText | None = None
    speed: float = Field(default=1.0, gt=0, le=1000)


class UnitFile(Strict):
    """`[unit.U]`: the settings of platform U alone. At most one of `mavlink` and `replay`."""

    persona: Persona | None = None
    trust: float = Field(default=1.0, ge=0, le=1)
    """How far the other platforms trust it."""
    avoidance: bool | None = None
    shedding: bool = True
    """Whether it may send its streams less often while its machine has too much to do."""
    gcs: str | None = None
    mavlink: str | None = None
    sysid: int | None = Field(default=None, ge=1, le=255)
    compid: int | None = Field(default=None, ge=0, le=255)
    control: bool | Literal["auto"] = False
    """Whether the platform may command its vehicle; `auto`: and interrupt its missions to give way."""
    floor_m: float | None = None
    ceiling_m: float | None = None
    range_m: float | None = None
    elevation: Path | None = None
    """Heights of the ground, above which the floor is, too."""
    signing_key: Path | None = None
    unsigned: bool = False
    forward: str | None = None
    """A ground station that gets what the vehicle sends."""
    forward_commands: bool = False
    """Whether what that station sends reaches the vehicle."""
    forward_beyond: bool = False
    """Whether that station may be on another machine."""
    replay: Path | None = None
    from_: str | None = Field(default=None, alias="from")
    epoch: InstantText | None = None
    listen: Items | None = None
    connect: Items | None = None
    translation: Path | None = None
    profiles: Path | None = None
    spec: Path | None = None
    """A specification, taken in again whenever the file changes."""
    modules: Items = Field(default=(), alias="units")
    """Modules, or files that end with .py, with sources and computational units of the specification."""
    learnt: Path | None = None
    """Directory in which what its streams of beliefs learn is kept."""
    feed: Path | None = None
    roads: Path | None = None
    """Roads on which linked objects are."""
    govern: str | None = None
    admit: Literal["refuse", "longer"] | None = None


class Settings(Strict):
    """Every option that may come from elsewhere than a flag; None where it is not set: the command's default holds."""

    federation: str = "default"
    listen: Items | None = None
    connect: Items | None = None
    discover: Literal["multicast", "none"] | None = None
    interface: str | None = None
    json_lines: bool = Field(default=False, alias="json")
    roster: Path | None = None
    key: Path | None = None
    """The private key to sign with, instead of the one in the roster's folder."""
    ontology: Path | None = None
    """File of semantic labels that not every platform has."""
    extensions: Items = ()
    """Modules with commands, or with parts of platforms; see `agents.extensions`."""
    units: int | None = Field(default=None, ge=0, le=250)
    scenario: str | None = None
    seed: int | None = None
    duration: str | None = None
    gcs: str | None = None
    persona: Persona | None = None
    avoidance: bool | None = None
    speed: float | None = Field(default=None, gt=0, le=1000)
    timeout: str | None = None
    log_level: Literal["debug", "info", "warning", "error"] | None = None
    """From which level on `join` shows what happens."""
    journal: Path | None = None
    """Directory in which each platform records what reaches it, as `<unit>.mcap`, again with every start."""
    encounters: Path | None = None
    """Directory in which each platform keeps a record of each encounter, as `<unit>-<other>-<time>.mcap`."""
    clock: ClockFile = ClockFile()
    by_unit: dict[str, UnitFile] = Field(default_factory=dict, alias="unit")


class FederationFile(Settings):
    """The settings of a federation in its own file."""

    name: str


_TABLES = ("clock", "unit")
_UNIT_PATHS = ("replay", "translation", "profiles", "signing_key", "spec", "learnt", "feed", "roads", "elevation")
OPTION_KEYS = tuple(field.alias or name for name, field in Settings.model_fields.items())
"""The keys of a configuration file; those but the tables are, upper case after `DYKNOW_`, the variables."""
VARIABLES = {key: f"DYKNOW_{key.upper()}" for key in OPTION_KEYS if key not in _TABLES}


def load(flags: Mapping[str, Any], config: Path | None) -> Settings:
    """The settings of one call.

    Args:
        flags: options that were given, by the names of the fields.
        config: the file of options; None: the one that DYKNOW_CONFIG names, if any.

    Raises:
        WrongCall: unknown keys, values of a wrong type, files that cannot be read: with place and remedy.
    """
    flags = {"json" if name == "json_lines" else name: value for name, value in flags.items()}
    config = config or (Path(given) if (given := os.environ.get("DYKNOW_CONFIG")) else None)
    configured = read_toml(config) if config else {}
    unknown = [key for key in configured if key not in OPTION_KEYS]
    if unknown:
        raise WrongCall("\n".join(f"{config}: unknown key {key!r}.{did_you_mean(key, OPTION_KEYS)}" for key in unknown))
    variables = {key: value for key, name in VARIABLES.items() if (value := os.environ.get(name))}
    layers = {**configured, **variables, **flags}
    federation = str(layers.get("federation", "default"))
    if federation.endswith(".toml"):
        layers = {**read_federation(Path(federation)), **layers}
        federation = layers["federation"] = layers.pop("name")
    if "federation" in layers:
        layers["federation"] = _checked_name(federation)
    if "clock" in layers and isinstance(layers["clock"], dict):
        layers.setdefault("speed", layers["clock"].get("speed", 1.0))
    try:
        return Settings.model_validate(layers)
    except ValidationError as error:
        place = _place(error, flags, variables, config, configured)
        raise WrongCall("\n".join(explained(error, place, "", Settings))) from None


def read_federation(path: Path) -> dict[str, Any]:
    """The settings in a federation's file, its paths made absolute.

    Raises:
        WrongCall: naming file, line and remedy.
    """
    raw = read_toml(path)
    if "federation" in raw:
        raise WrongCall(f"{path}: unknown key 'federation'. Did you mean 'name'?")
    if isinstance(raw.get("units"), dict):
        raise WrongCall(f"{path}: units is how many platforms there are, not a table. Did you mean 'unit'?")
    settings = read_model(path, FederationFile).model_dump(by_alias=True, exclude_unset=True)
    base = path.resolve().parent
    for unit, own in settings.get("unit", {}).items():
        if own.get("mavlink") and own.get("replay"):
            raise WrongCall(f"{path}: [unit.{unit}] has both mavlink and replay; a platform has one vehicle: keep one.")
        own.update({key: base / own[key] for key in _UNIT_PATHS if own.get(key)})
        if named := own.get("units"):
            own["units"] = tuple(str(base / name) if name.endswith(".py") else name for name in named)
    settings.update(
        {
            key: base / settings[key]
            for key in ("roster", "key", "journal", "encounters", "ontology")
            if settings.get(key)
        }
    )
    if named := settings.get("extensions"):
        settings["extensions"] = [str(base / name) if name.endswith(".py") else name for name in named]
    if settings.get("units") == 0:
        del settings["units"]
    return settings


def _place(
    error: ValidationError,
    flags: Mapping[str, Any],
    variables: Mapping[str, str],
    config: Path | None,
    configured: Mapping[str, Any],
) -> str:
    """Where the first mistyped option was set."""
    name = str(error.errors()[0]["loc"][0])
    if name in flags:
        return f"--{name.replace('_', '-')}"
    if name in variables:
        return f"the variable {VARIABLES[name]}"
    return str(config) if name in configured else "the federation's file"


def _checked_name(name: str) -> str:
    """The federation's plain name; it becomes one chunk of a key. Raises WrongCall."""
    if not _NAME.fullmatch(name):
        plain = re.sub(r"[^a-z0-9_-]+", "-", name.lower()).strip("-_")[:64]
        instead = f"write {plain}, for example: " if plain else "write "
        raise WrongCall(
            f"--federation: {name!r} cannot name a federation; {instead}lower-case letters, digits, - and _ "
            "(at most 64), or the path of a file that ends with .toml."
        )
    return name
