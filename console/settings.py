"""Options: from flags, then `DYKNOW_*` variables, then a TOML file (`--config`), then the federation's own file."""

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from pydantic import BeforeValidator, Field, ValidationError
from pydantic_settings import BaseSettings, EnvSettingsSource, NoDecode, SettingsConfigDict

from console.errors import WrongCall, did_you_mean
from console.federations import Discover, FederationFile, Persona, read_federation
from console.toml import explained, read_toml

_NAME = re.compile(r"(?=.{1,64}\Z)[a-z0-9][a-z0-9_-]*")


def _parted(given: Any) -> Any:
    """A variable holds several endpoints with commas between."""
    return tuple(part.strip() for part in given.split(",") if part.strip()) if isinstance(given, str) else given


Endpoints: TypeAlias = Annotated[tuple[str, ...], NoDecode, BeforeValidator(_parted)]


class Settings(BaseSettings):
    """Every option that may come from elsewhere than a flag; None where nobody set it: the command's default holds."""

    model_config = SettingsConfigDict(env_prefix="DYKNOW_", extra="forbid", frozen=True, env_ignore_empty=True)

    federation: str = "default"
    listen: Endpoints | None = None
    connect: Endpoints | None = None
    discover: Discover | None = None
    interface: str | None = None
    json_lines: bool = Field(default=False, validation_alias="dyknow_json")
    roster: Path | None = None
    units: int | None = Field(default=None, ge=1, le=250)
    scenario: str | None = None
    seed: int | None = None
    duration: str | None = None
    gcs: str | None = None
    persona: Persona | None = None
    avoidance: bool | None = None
    speed: float | None = Field(default=None, gt=0, le=1000)
    timeout: str | None = None


OPTION_KEYS = tuple("json" if name == "json_lines" else name for name in Settings.model_fields)
"""The keys of a configuration file, and, upper case after `DYKNOW_`, the variables."""


def load(flags: Mapping[str, Any], config: Path | None) -> tuple[Settings, FederationFile | None]:
    """The options of one call, and the federation's file if `--federation` names one.

    Raises:
        WrongCall: unknown keys, values of a wrong type, files that cannot be read: with place and remedy.
    """
    config = config or (Path(given) if (given := os.environ.get("DYKNOW_CONFIG")) else None)
    configured = read_toml(config) if config else {}
    settings = _layered(flags, configured, config, {})
    if not settings.federation.endswith(".toml"):
        return _named(settings, settings.federation), None
    file = read_federation(Path(settings.federation))
    return _named(_layered(flags, configured, config, _options_of(file)), file.name), file


def _layered(
    flags: Mapping[str, Any], configured: Mapping[str, Any], config: Path | None, lowest: Mapping[str, Any]
) -> Settings:
    """Settings from four layers, the first that sets an option wins."""
    unknown = [key for key in configured if key not in OPTION_KEYS]
    if unknown:
        said = [f"{config}: unknown key {key!r}.{did_you_mean(key, OPTION_KEYS)}" for key in unknown]
        raise WrongCall("\n".join(said))

    variables = EnvSettingsSource(Settings)()
    merged = {**_keyed(lowest), **_keyed(configured), **variables, **_keyed(flags)}
    try:
        return Settings(**merged)
    except ValidationError as error:
        raise WrongCall("\n".join(explained(error, _place(error, flags, config, configured), "", Settings))) from None


def _keyed(layer: Mapping[str, Any]) -> dict[str, Any]:
    """The layer under the keys that the model reads."""
    return {"dyknow_json" if key in {"json", "json_lines"} else key: value for key, value in layer.items()}


def _place(error: ValidationError, flags: Mapping[str, Any], config: Path | None, configured: Mapping[str, Any]) -> str:
    """Where the first mistyped option was set."""
    name = str(error.errors()[0]["loc"][0]).removeprefix("dyknow_")
    if name in flags:
        return f"--{name.replace('_', '-')}"
    if f"DYKNOW_{name.upper()}" in os.environ:
        return f"the variable DYKNOW_{name.upper()}"
    return str(config) if name in configured else "the federation's file"


def _named(settings: Settings, name: str) -> Settings:
    """The settings with the federation's plain name; it becomes one chunk of a key."""
    if not _NAME.fullmatch(name):
        raise WrongCall(
            f"--federation: {name!r} cannot name a federation; write lower-case letters, digits, - and _ "
            "(at most 64), or the path of a file that ends with .toml."
        )
    return settings.model_copy(update={"federation": name})


def _options_of(file: FederationFile) -> dict[str, Any]:
    """The options that a federation's file sets."""
    names = (
        "scenario",
        "seed",
        "persona",
        "avoidance",
        "duration",
        "listen",
        "connect",
        "discover",
        "interface",
        "roster",
    )
    found = {name: given for name in names if (given := getattr(file, name)) is not None}
    if file.units:
        found["units"] = file.units
    return found | {"speed": file.clock.speed}
