"""Named profiles: a formula, its thresholds, and the states it wants. Data in profiles.toml, in this folder.

A profile holds text; kpl/running/profiles.py makes a formula of it. `self` is the platform's own unit and
`units` the domain of all platforms; both are named where the formula is read.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import Final, TypeAlias, get_args

from dyknow.documents.documents import toml_document
from dyknow.documents.tables import DocumentTable, is_number, shown
from dyknow.model.errors import TextError
from dyknow.model.instants import US_PER_S, parse_duration
from dyknow.reasoning.features.derivation import ALTITUDE, FEATURES, HEIGHT, needed_labels
from dyknow.reasoning.features.well_clear import AMONG_SMALL, Thresholds
from dyknow.reasoning.formulas.evaluation import NoValuePolicy

Threshold: TypeAlias = float | str
"""A number, or a time with suffix."""

AIRCRAFT: Final = "traffic"
"""The name of aircraft that are no members, in formulas of profiles."""
_WORD: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_VOLUME: Final = ("DMOD", "ZTHR", "TAUMOD_S", "TCOA_S")


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
        files("dyknow.reasoning.monitoring").joinpath("profiles.toml").read_text(encoding="utf-8"), "profiles.toml"
    )


def parse_profiles(text: str, file: str = "") -> dict[str, Profile]:
    """Profiles from TOML, one table each, by name.

    Raises:
        TextError: if it is no TOML, or a table lacks or misnames something; formulas are not looked into.
    """
    document = toml_document(text, file, "[mine], then formula, sample and max_delay, one a line")
    found = {name: _profile(name, table) for name, table in DocumentTable(document).named().items()}
    document.end()
    return found


def _profile(name: str, table: DocumentTable) -> Profile:
    formula, sample, max_delay = (table.text(key, None) for key in ("formula", "sample", "max_delay"))
    thresholds = table.table("thresholds")
    found = Profile(
        name=name,
        formula=formula.strip(),
        sample_us=_duration(table, "sample", sample),
        max_delay_us=_duration(table, "max_delay", max_delay),
        thresholds={key.upper(): _threshold(thresholds, key) for key in thresholds.entries},
        meaning=table.text("meaning", ""),
        close_after=table.whole("close_after", 2, 1, 1_000_000),
        no_value=table.text("no_value", "undecided", get_args(NoValuePolicy)),  # type: ignore[arg-type] # one of these
        vertical=table.text("vertical", ALTITUDE, (ALTITUDE, HEIGHT)),
        fence=_fence(table),
        starts_avoidance=table.flag("starts_avoidance"),
    )
    table.end()
    return found


def _duration(table: DocumentTable, key: str, text: str) -> int:
    try:
        return parse_duration(text)
    except TextError as wrong:
        if key in table:
            table.wrong(key, wrong.message, f'{key} = "200ms"')
        return US_PER_S


def _threshold(table: DocumentTable, key: str) -> Threshold:
    """A number, or a time that parses; numbers may come as text."""
    value = table.get(key)
    if isinstance(value, str):
        try:
            return float(value)
        except ValueError:
            _duration(table, key, value)
            return value
    if not is_number(value):
        table.wrong(key, f"a number or a time is expected, got {shown(value)}", f'{key} = 10, or "10s"')
        return 0.0
    return float(value)


def _seconds(value: Threshold) -> float:
    return parse_duration(value) / US_PER_S if isinstance(value, str) else value


def _fence(table: DocumentTable) -> tuple[tuple[float, float], ...]:
    corners = table.get("fence") or []
    try:
        fence = tuple((float(latitude), float(longitude)) for latitude, longitude in corners)
    except (TypeError, ValueError):
        table.wrong("fence", f"a list of corners is expected, got {shown(corners)}", "fence = [[58.40, 15.67], ...]")
        return ()
    if fence and len(fence) < 3:
        table.wrong("fence", f"at least three corners are expected, got {len(fence)}", "fence = [[58.40, 15.67], ...]")
    return fence
