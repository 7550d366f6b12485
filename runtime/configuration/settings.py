"""The settings of a federation and its platforms: from flags, then `DYKNOW_*` variables, then TOML files.

There are two files of the same keys: `--config FILE.toml` goes before the federation's own file, `--federation FILE.toml`,
which has a `name`, and whose relative paths are relative to it.
"""

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError

from dyknow.agents.options import (
    BASE,
    Items,
    Modules,
    OptionPath,
    OptionsTable,
    Strict,
    composed,
    is_everywhere,
    platform_options,
    with_everywhere,
)
from dyknow.model.errors import WrongCall, did_you_mean
from dyknow.runtime.configuration.config import VEHICLE_OPTIONS, EndpointOptions, InstantText, ReplayOptions
from dyknow.runtime.configuration.toml import explained, read_model, read_toml

_NAME = re.compile(r"(?=.{1,64}\Z)[a-z0-9][a-z0-9_-]*")


class ClockFile(Strict):
    """`[clock]`: the federation's clock runs `speed` times faster than the wall from `epoch` on."""

    epoch: InstantText | None = None
    speed: float = Field(default=1.0, gt=0, le=1000)


@composed(*VEHICLE_OPTIONS, *platform_options())
class UnitFile(OptionsTable):
    """`[unit.U]`: the settings of platform U alone. At most one of `mavlink` and `replay`."""

    trust: float = Field(default=1.0, ge=0, le=1)
    """How far the other platforms trust it."""
    listen: Items | None = None
    connect: Items | None = None

    def over(self, others: "UnitFile") -> "UnitFile":
        """These settings, and those of others where these are not set."""
        return others.model_copy(update={name: getattr(self, name) for name in self.model_fields_set})


@with_everywhere(*UnitFile.MODELS)
class Settings(Strict):
    """Every option that may come from elsewhere than a flag; None where it is not set: the command's default holds."""

    federation: str = "default"
    listen: Items | None = None
    connect: Items | None = None
    discover: Literal["multicast", "none"] | None = None
    interface: str | None = None
    json_lines: bool = Field(default=False, alias="json")
    roster: OptionPath | None = None
    key: OptionPath | None = None
    """The private key to sign with, instead of the one in the roster's folder."""
    ontology: OptionPath | None = None
    """File of semantic labels that not every platform has."""
    extensions: Modules = ()
    """Modules with commands, or with parts of platforms; see `dyknow.agents.extensions`."""
    units: int | None = Field(default=None, ge=0, le=250)
    scenario: str | None = None
    seed: int | None = None
    duration: str | None = None
    speed: float | None = Field(default=None, gt=0, le=1000)
    timeout: str | None = None
    log_level: Literal["debug", "info", "warning", "error"] | None = None
    """From which level on `join` shows what happens."""
    journal: OptionPath | None = None
    """Directory in which each platform records what reaches it, as `<unit>.mcap`, again with every start."""
    clock: ClockFile = ClockFile()
    by_unit: dict[str, UnitFile] = Field(default_factory=dict, alias="unit")

    def for_all(self) -> UnitFile:
        """The options of all platforms, for each without its own."""
        fields = (
            name for model in UnitFile.MODELS for name, field in model.model_fields.items() if is_everywhere(field)
        )
        given = {name: value for name in fields if (value := getattr(self, name)) is not None}
        return UnitFile().model_copy(update=given)


class FederationFile(Settings):
    """The settings of a federation in its own file."""

    name: str


_TABLES = ("clock", "unit")
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
    clock = layers.get("clock")
    if isinstance(clock, ClockFile | dict):
        layers.setdefault("speed", clock.speed if isinstance(clock, ClockFile) else clock.get("speed", 1.0))
    try:
        return Settings.model_validate(layers)
    except ValidationError as error:
        place = _place(error, flags, variables, config, configured)
        raise WrongCall("\n".join(explained(error, place, "", Settings))) from None


def read_federation(path: Path) -> dict[str, Any]:
    """The settings in a federation's file by key, its paths made absolute.

    Raises:
        WrongCall: naming file, line and remedy.
    """
    raw = read_toml(path)
    if "federation" in raw:
        raise WrongCall(f"{path}: unknown key 'federation'. Did you mean 'name'?")
    if isinstance(raw.get("units"), dict):
        raise WrongCall(f"{path}: units is how many platforms there are, not a table. Did you mean 'unit'?")
    file = read_model(path, FederationFile, {BASE: path.resolve().parent})
    for unit, own in file.by_unit.items():
        if own[EndpointOptions].mavlink and own[ReplayOptions].replay:
            raise WrongCall(f"{path}: [unit.{unit}] has both mavlink and replay; a platform has one vehicle: keep one.")
    keys = {name: field.alias or name for name, field in FederationFile.model_fields.items()}
    settings = {keys[name]: getattr(file, name) for name in file.model_fields_set}
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
