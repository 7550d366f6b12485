"""Named profiles: a formula, its thresholds, and the states it wants. Data in profiles.toml, in this folder.

A profile holds text; kpl/running/profiles.py makes a formula of it. `self` is the platform's own unit and
`units` the domain of all platforms; both are named where the formula is read.
"""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import Any, Final, TypeAlias, get_args

from dyknow.model.errors import TextError
from dyknow.model.instants import US_PER_S, parse_duration
from dyknow.model.toml_texts import tables_of
from reasoning.features.derivation import ALTITUDE, FEATURES, HEIGHT, needed_labels
from reasoning.features.well_clear import AMONG_SMALL, Thresholds
from reasoning.formulas.evaluation import NoValuePolicy

Threshold: TypeAlias = float | str
"""A number, or a time with suffix."""

AIRCRAFT: Final = "traffic"
"""The name of aircraft that are no members, in formulas of profiles."""
_WORD: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_VOLUME: Final = ("DMOD", "ZTHR", "TAUMOD_S", "TCOA_S")
_KEYS: Final = {
    "formula",
    "sample",
    "max_delay",
    "meaning",
    "thresholds",
    "close_after",
    "no_value",
    "vertical",
    "fence",
    "starts_avoidance",
}


@dataclass(frozen=True, slots=True)
class Profile:
    """One named monitor.

    Attributes:
        formula: in the language of formulas, with the names of `thresholds` as constants.
        sample_us: period of its states; max_delay_us: how long a state waits for its inputs.
        vertical: the label that stands for the altitude.
        fence: corners (latitude_deg, longitude_deg), for `fence_margin`.
        starts_avoidance: whether its alarms start a manoeuvre, where platforms may give way.
    """

    name: str
    formula: str
    sample_us: int
    max_delay_us: int
    thresholds: Mapping[str, Threshold] = field(default_factory=dict)
    meaning: str = ""
    close_after: int = 2
    no_value: NoValuePolicy = "undecided"
    vertical: str = ALTITUDE
    fence: tuple[tuple[float, float], ...] = ()
    starts_avoidance: bool = False

    @property
    def volume(self) -> Thresholds:
        """The volume of `well_clear` and `time_to_violation`: DMOD, ZTHR, TAUMOD_S and TCOA_S, where it has them."""
        named = zip(_VOLUME, AMONG_SMALL, strict=True)
        return Thresholds(*(_seconds(self.thresholds.get(name, usual)) for name, usual in named))

    @property
    def features(self) -> tuple[str, ...]:
        """Derived features that the formula names."""
        text = re.sub(r"#[^\n]*", "", self.formula)
        return tuple(name for name in dict.fromkeys(_WORD.findall(text)) if name in FEATURES)

    @property
    def labels(self) -> tuple[str, ...]:
        """Semantic labels that the formula needs of each unit it is about, and a manoeuvre if its alarms start one."""
        manoeuvre = ("heli-position", "heli-altitude", "heli-velocity") if self.starts_avoidance else ()
        return tuple(dict.fromkeys((*needed_labels(self.features, self.vertical), *manoeuvre)))

    @property
    def pairwise(self) -> bool:
        """Whether it is about the unit and another one."""
        return any(FEATURES[name].arity == 2 for name in self.features)


@cache
def builtin_profiles() -> Mapping[str, Profile]:
    """The profiles that come with this package, by name."""
    return parse_profiles(
        files("reasoning.monitoring").joinpath("profiles.toml").read_text(encoding="utf-8"), "profiles.toml"
    )


def parse_profiles(text: str, file: str = "") -> dict[str, Profile]:
    """Profiles from TOML, one table each, by name.

    Raises:
        TextError: if it is no TOML, or a table lacks or misnames something; formulas are not looked into.
    """
    try:
        tables = tables_of(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise TextError(f"no TOML: {error}", file=file) from None
    return {name: _profile(name, table, file) for name, table in tables.items()}


def _profile(name: str, table: Any, file: str) -> Profile:
    if not isinstance(table, dict):
        raise TextError(f"{name} is not a table", file=file, repair=f"[{name}]")
    for key in table:
        if key not in _KEYS:
            raise TextError(f"{name}: there is no {key}", file=file, repair=", ".join(sorted(_KEYS)))
    for key in ("formula", "sample", "max_delay"):
        if not isinstance(table.get(key), str):
            raise TextError(f"{name}: {key} is missing or no text", file=file, repair=f'{key} = "..."')
    thresholds = _of_kind(name, table, "thresholds", dict, {}, file)
    no_value = table.get("no_value", "undecided")
    if no_value not in get_args(NoValuePolicy):
        raise TextError(f"{name}: no_value is {no_value!r}", file=file, repair=", ".join(get_args(NoValuePolicy)))
    vertical = table.get("vertical", ALTITUDE)
    if vertical not in {ALTITUDE, HEIGHT}:
        raise TextError(f"{name}: vertical is {vertical!r}", file=file, repair=f"{ALTITUDE} or {HEIGHT}")
    close_after = _of_kind(name, table, "close_after", int, 2, file)
    if close_after < 1:
        raise TextError(f"{name}: close_after is {close_after}", file=file, repair="close_after = 2")
    return Profile(
        name=name,
        formula=table["formula"].strip(),
        sample_us=parse_duration(table["sample"]),
        max_delay_us=parse_duration(table["max_delay"]),
        thresholds={key.upper(): _threshold(name, key, value) for key, value in thresholds.items()},
        meaning=str(table.get("meaning", "")),
        close_after=close_after,
        no_value=no_value,
        vertical=vertical,
        fence=_fence(name, _of_kind(name, table, "fence", list, [], file), file),
        starts_avoidance=_of_kind(name, table, "starts_avoidance", bool, False, file),
    )


def _of_kind(name: str, table: Mapping[str, Any], key: str, kind: type, default: Any, file: str) -> Any:
    value = table.get(key, default)
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise TextError(f"{name}: {key} is {value!r}", file=file, repair=f"{key} as in the built-in profiles")
    return value


def _threshold(name: str, key: str, value: Any) -> Threshold:
    """A number, or a time that parses; numbers may come as text."""
    if isinstance(value, str):
        try:
            return float(value)
        except ValueError:
            parse_duration(value)
            return value
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    raise TextError(f"{name}: the threshold {key} is {value!r}", repair='a number, or a time such as "10s"')


def _seconds(value: Threshold) -> float:
    return parse_duration(value) / US_PER_S if isinstance(value, str) else value


def _fence(name: str, corners: list[Any], file: str) -> tuple[tuple[float, float], ...]:
    try:
        fence = tuple((float(latitude), float(longitude)) for latitude, longitude in corners)
    except (TypeError, ValueError):
        raise TextError(f"{name}: a fence is a list of corners", file=file, repair="[[58.40, 15.67], ...]") from None
    if fence and len(fence) < 3:
        raise TextError(f"{name}: a fence has at least three corners, here are {len(fence)}", file=file)
    return fence
