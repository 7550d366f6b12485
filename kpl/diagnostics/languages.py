"""Mistakes of each language, read from the TOML files next to this module at the first error, not before."""

import re
import tomllib
from collections.abc import Collection, Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Final, NamedTuple

from dyknow.model.labels import RESERVED
from dyknow.reasoning.chronicles.definition.domains import RESERVED as CHRONICLE_RESERVED

_IN_MONITOR: Final = "monitor m = {}"
_IN_CHRONICLE: Final = ("chronicle c {{ {} }}", "chronicle c {{ event(a, t1) {} }}")


class Mistake(NamedTuple):
    """A message, what to write instead, and samples; each stops the parser as the mistake does.

    `rewrites` are a pattern and a replacement that make the repair from the line of the mistake, where it matches.
    """

    message: str
    repair: str
    samples: tuple[str, ...]
    rewrites: tuple[str, str] | None = None

    def repaired(self, line: str) -> str:
        """The line as it should be; an example where it is too far from that."""
        if self.rewrites is not None and re.search(self.rewrites[0], line):
            return re.sub(*self.rewrites, line, count=1).strip()
        return self.repair


class TerminalGroup(NamedTuple):
    """Terminals that are named by one word where all of `needed` could stand, next to `others`."""

    needed: frozenset[str]
    word: str
    others: frozenset[str]


class Language(NamedTuple):
    """How one of our languages is mistyped.

    Attributes:
        operators, words: those of other languages, and ours.
        reserved: words that cannot be names; `keywords` are those, as terminals, that can be expected where names cannot.
        empty: message and repair for a text that holds nothing.
        groups: terminals that are named together.
        mistakes: in order; the first sample with a mark owns it.
        has_suggestions: whether `suggestions` knows its statements.
    """

    operators: Mapping[str, str]
    words: Mapping[str, str]
    reserved: Collection[str]
    keywords: tuple[str, ...]
    empty: tuple[str, str]
    groups: tuple[TerminalGroup, ...]
    mistakes: tuple[Mistake, ...]
    has_suggestions: bool


@cache
def table(name: str) -> dict[str, Any]:
    """A TOML file of this drawer."""
    return tomllib.loads(files("dyknow.kpl.diagnostics").joinpath(f"{name}.toml").read_text(encoding="utf-8"))


@cache
def language(name: str) -> Language:
    """The language `formulas`, `statements` (formulas in them included) or `chronicles`."""
    if name == "statements":
        formulas = language("formulas")
        in_monitors = (
            mistake._replace(samples=tuple(map(_IN_MONITOR.format, mistake.samples))) for mistake in formulas.mistakes
        )
        return formulas._replace(mistakes=(*in_monitors, *_mistakes(table(name))))
    data = table(name)
    is_formula = name == "formulas"
    message, repair = data["empty"]
    return Language(
        data["operators"],
        data["words"],
        data.get("reserved", RESERVED if is_formula else CHRONICLE_RESERVED),
        tuple(data["keywords"]),
        (message, repair),
        tuple(TerminalGroup(frozenset(g["needed"]), g["word"], frozenset(g["others"])) for g in data["groups"]),
        tuple(_mistakes(data)),
        is_formula,
    )


def _mistakes(data: Mapping[str, Any]) -> list[Mistake]:
    return [
        Mistake(
            each["message"],
            each["repair"],
            (
                *each.get("samples", ()),
                *(form.format(statement) for statement in each.get("statements", ()) for form in _IN_CHRONICLE),
            ),
            tuple(each["rewrites"]) if "rewrites" in each else None,
        )
        for each in data["mistakes"]
    ]
