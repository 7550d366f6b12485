"""The options of a link, which stand behind `with`: read, and printed.

strmgen world = link(camera, WorldObject, e, r, m) with forget 60s, score distance, exclusive kind
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from dyknow.kpl.diagnostics.collector import nearest
from dyknow.kpl.syntax.numbers import is_time, parse_number
from dyknow.kpl.syntax.parsing import FormulaReader, place_of
from dyknow.model.errors import TextError
from dyknow.model.instants import US_PER_S, parse_duration, print_duration

LEAST_PARTS: Final = 2
_WORDS: Final[Mapping[str, tuple[str, ...]]] = {
    "score": ("likelihood", "distance"),
    "predict": ("velocity", "individual", "roads"),
    "errors": ("independent", "correlated"),
}
_COUNTS: Final[Mapping[str, tuple[int, int]]] = {
    "max_hyps": (1, 64),
    "candidates": (1, 16),
    "branches": (0, 16),
    "least": (LEAST_PARTS, 1000),
}
_FORGET: Final = "forget"
_FORGETS_US: Final = (US_PER_S // 10, 24 * 3600 * US_PER_S)
LINK_OPTIONS: Final = (_FORGET, *_WORDS, "max_hyps", "candidates", "branches", "exclusive", "weigh")
COMPOSITE_OPTIONS: Final = ("least",)


@dataclass(frozen=True, slots=True)
class LinkOptions:
    """Each field is the option of its name.

    Attributes:
        forget: objects that were not anchored for so long are removed, microseconds.
        score: the criterion between several known objects: `likelihood`, or nearness.
        predict: how objects are predicted that are not seen; empty: as is usual for the unit.
        max_hyps: most places at which one object is expected.
        candidates: most known objects that one percept may be at a time, each with a weight.
        branches: most states of one time of an object that is not seen, one for each link of the map, with weights.
        exclusive: links of that name exclude each other for one object; empty: they exclude none.
        weigh: the stream of beliefs whose world model decides between several known objects instead; empty: none.
        errors: whether those of this link are known to be independent of those of others into the same type.
    """

    forget: int = 30 * US_PER_S
    score: str = "likelihood"
    predict: str = ""
    max_hyps: int = 32
    candidates: int = 1
    branches: int = 0
    exclusive: str = ""
    errors: str = "independent"
    weigh: str = ""


USUAL: Final = LinkOptions()


def read_options(reader: FormulaReader, nodes: Sequence[Any], known: Sequence[str]) -> dict[str, Any]:
    """The values of options by name, those that can be; errors about the others are noted with their places."""
    found: dict[str, Any] = {}
    for node in nodes:
        (name, *_), value = node.children[0].children, node.children[1]
        text, place = str(getattr(value, "children", [value])[0]), place_of(node, reader.text)
        if name in found:
            reader.error(f"the option {name} is given twice", place, "each option once")
            continue
        try:
            found[str(name)] = _option_value(name, text, known)
        except TextError as wrong:
            reader.error(wrong.message, place, wrong.repair)
    return found


def _option_value(name: str, text: str, known: Sequence[str]) -> int | str:
    """The value of one of the known options as it is typed.

    Raises:
        TextError: there is no such option, or it cannot have this value.
    """
    if name not in known:
        raise TextError(f"there is no option {name} here", repair=nearest(name, known, ", ".join(known)))
    if name == _FORGET:
        return _time_us(text)
    if (range_ := _COUNTS.get(name)) is not None:
        return _count(name, text, *range_)
    if text[0].isdigit():
        raise TextError(f"{name} is a word, not {text}", repair=f"{name} {_WORDS.get(name, ('kind',))[0]}")
    if (words := _WORDS.get(name)) is not None and text not in words:
        raise TextError(
            f"{name} is {' or '.join(words)}, not {text}", repair=f"{name} {nearest(text, words, words[0])}"
        )
    return text


def _time_us(text: str) -> int:
    least_us, most_us = _FORGETS_US
    time_us = parse_duration(text) if text[0].isdigit() else -1
    if not least_us <= time_us <= most_us:
        said = f"objects are forgotten after {print_duration(least_us)} to {print_duration(most_us)}, not {text}"
        raise TextError(said, repair=f"forget {print_duration(USUAL.forget)}")
    return time_us


def _count(name: str, text: str, least: int, most: int) -> int:
    count = parse_number(text) if text[0].isdigit() and not is_time(text) else -1
    if not isinstance(count, int) or not least <= count <= most:
        raise TextError(f"{name} is a number from {least} to {most}, not {text}", repair=f"{name} {least}")
    return count


def print_options(options: LinkOptions) -> str:
    """The options that differ from the usual ones, as they are typed behind a link."""
    said = []
    for name in LINK_OPTIONS:
        value = getattr(options, name)
        if value != getattr(USUAL, name):
            said.append(f"{name} {print_duration(value) if name == _FORGET else value}")
    return f" with {', '.join(said)}" if said else ""
