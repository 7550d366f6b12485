"""Declarations that can never have a value, drawn from a seed: a right one with one thing in it made wrong."""

import random
from collections.abc import Iterator
from typing import NamedTuple

from dyknow import UnitPrototype, of_values
from dyknow.kpl.syntax.statements import read_specification
from dyknow.model.errors import SourceText, TextError, TextErrors
from tests.kpl.instances import Running

BASE = """sort seen(symbol in text, x_m in m, y_m in m, sd_m in m, colour in text, length_m in m, end in bool)
sort metres in m
sort word in text
sort truth in bool
sort place(north_m in m, east_m in m, name in text)
source seen camera
source metres levels
source word words
source truth switches
source place places
compunit metres Half(metres)
compunit metres Gap(metres, metres)
compunit metres Length(cars)
strmgen seen = camera
strmgen level = levels
strmgen lower = Half(level)
strmgen said = words
strmgen is_on = switches
strmgen depth[boat1] = levels
strmgen depth[boat2] = levels
strmgen place[boat1] = places
strmgen gap = Gap(depth[boat1], depth[boat2])
strmgen world = link(seen, WorldObject, eventually[1s, oo] true, eventually[0, 1s] xy_dist[from, to] < thresh, true)
strmgen cars = link(world, SameState, eventually[1s, oo] length_m[from] > 3, false, true)
for car in cars strmgen length[car] = Length(cars[car])
chronicle file "painted.chr"
define DEEP = 5
define tall[b] = depth[b] > DEEP
monitor usual = always lower < 9
strmgen all_of_it = state(lower, said, is_on, gap, place[boat1], depth[boat2])
stream shown = all_of_it
strmgen lengths = merge length[car] for car in cars
stream long = lengths
"""
CHRONICLES = "attribute cars.colour[?c]\nchronicle painted[?c] {\n  event(cars.colour[?c]:(red, blue), t1)\n}\n"
UNITS = (
    UnitPrototype("Half", "metres", ("metres",), lambda: of_values(lambda value: value / 2)),
    UnitPrototype("Gap", "metres", ("metres", "metres"), lambda: of_values(lambda one, two: one - two)),
    UnitPrototype("Length", "metres", ("cars",), lambda: of_values(lambda value: value[-2])),
)
NEAR = "eventually[0, 1s] xy_dist[from, to] < 4"


class Template(NamedTuple):
    """A right declaration, with the places at which it is made wrong.

    In each place stand, between backquotes and after one another with `|`, its kind, what is right and what is wrong. Kinds: `n`
    a name of a stream, attribute, unit, chronicle or domain is mistyped; `l` the objects of a label are left out, or are one too
    many; `s`, `m`, `a` one of what is wrong stands there: of another sort, without arguments or with too many; `u` a unit that
    nothing offers is declared, and stands at `U`.
    """

    text: str

    def right(self) -> str:
        return "".join(each if i % 2 == 0 else each.split("|")[1] for i, each in enumerate(self.text.split("`")))


def templates() -> list[Template]:
    """Right declarations of every kind."""
    streams = [
        "stream out = `n|level` with sample every 1s",
        "stream out = `l|depth[boat1]`",
        "stream out = place.`n|north_m`[boat1]",
        "stream out = `n|depth`[boat1] with any change",
        "strmgen out = `n|Half`(level)\nstream later = out",
        "strmgen out = Half(`n|level`)\nstream later = out",
        "strmgen out = Half(`s|level|said`)\nstream later = out",
        "strmgen out = `a|Gap(level, lower)|Gap(level)|Gap(level, lower, gap)|Half(level, lower)`\nstream later = out",
        "strmgen out = Gap(level, `l|depth[boat1]`)\nstream later = out",
        "strmgen out = state(level, `n|lower`)\nstream later = out",
        "strmgen out = first of `n|level`, lower\nstream later = out",
        "strmgen out = first of level, `s|lower|said`\nstream later = out",
        "stream out = `n|cars`.colour[co1]",
        "stream out = cars.`n|colour`[co1]",
        "strmgen out = merge `n|length`[car] for car in cars\nstream later = out",
        "strmgen out = select length[car] for car in `n|cars`\nstream later = out",
        "strmgen out = select length[car] for car in `s|cars|level`\nstream later = out",
        "for car in `n|world` strmgen out[car] = Half(level2[car])\nfor car in world strmgen level2[car] = Half(level)\nstream later = out[wo1]",
        "source metres more\nstrmgen out = `n|more`\nstream later = out",
        "`u||compunit metres NAME(metres)\n`strmgen out = `U|Half`(level)\nstream later = out",
        "`u||compunit metres NAME(cars)\n`for car in cars strmgen out[car] = `U|Length`(cars[car])\nstream later = out[co1]",
        "`u||compunit cars NAME(cars)\n`strmgen out = link(cars, `U|SameState`, true, false, true)\nstream later = out",
        "for each in cars strmgen out[each] = Half(`n|length`[each])\nstream later = out[co1]",
        "for each in `n|cars` strmgen out[each] = Half(length[each])\nstream later = out[co1]",
        "for each in cars monitor long_one = eventually `n|length`[each] > 3",
        "stream out = chronicle[`n|painted`]",
        "stream out = partial[`n|painted`]",
    ]
    monitors = [
        "monitor alarm = always `n|level` < 5",
        "monitor alarm = always `l|depth[boat1]` < 5",
        "monitor alarm = always depth[`n|boat2`] < 5",
        "monitor alarm = always place.`n|north_m`[boat1] < 5",
        "monitor alarm = always `s|level < 5|said < 5|level < said|is_on + 1 > 3`",
        "monitor alarm = always `s|is_on|level|said|depth[boat1]|place[boat1]|lower`",
        "monitor alarm = eventually[0, 5s] (level > 3 and `s|is_on|gap|said`)",
        "monitor alarm = always forall c in `n|cars`: speed[c] < 30",
        "monitor alarm = always forall c in cars: `n|length_m`[c] < 30",
        "monitor alarm = always forall c in cars: `n|length`[c] < 30",
        'monitor alarm = always forall c in cars: colour[c] `s|= "red"|< 5|> said`',
        "monitor alarm = always forall c in `s|cars|level|lower|gap`: speed[c] < 30",
        "monitor alarm = eventually occurred(chronicle[`n|painted`, co1])",
        "monitor alarm = eventually occurred(`m|chronicle[painted, co1]|chronicle[painted, co1, co2]`)",
        "monitor alarm = eventually `n|colour`[co1] = said",
        "monitor alarm = always forall c in cars: `m|xy_dist[c, co1]|xy_dist[c]|xy_dist|speed[c, co1]` < 30",
        "monitor alarm = always `n|tall`[boat1]",
        "monitor alarm = always `m|tall[boat1]|tall|tall[boat1, boat2]`",
        "define wide[b] = `n|depth`[b] > 2\nmonitor alarm = always wide[boat1]",
        "define wide[b] = depth[b] > `n|DEEP`\nmonitor alarm = always wide[boat1]",
        "stream out = margin[`n|usual`]",
        "monitor alarm = always exists c in cars: `n|colour`[c] = said",
    ]
    links = [
        f"strmgen out = link(`n|world`, SameState, true, {NEAR}, true)\nstream later = out",
        f"strmgen out = link(world, `n|SameState`, true, {NEAR}, true)\nstream later = out",
        f"strmgen out = link(world, SameState, eventually `n|length_m`[from] > 3, {NEAR}, true)\nstream later = out",
        f"strmgen out = link(world, SameState, eventually length_m[`n|from`] > 3, {NEAR}, true)\nstream later = out",
        "strmgen out = link(world, SameState, true, eventually[0, 1s] `n|colour`[from] = colour[to], true)\nstream later = out",
        "strmgen out = link(world, SameState, true, eventually[0, 1s] `n|xy_dist`[from, to] < thresh, true)\nstream later = out",
        "strmgen out = link(world, SameState, true, eventually[0, 1s] xy_dist[from, to] < `n|thresh`, true)\nstream later = out",
        f"strmgen out = link(world, SameState, eventually `n|level` > 3, {NEAR}, true)\nstream later = out",
        f"strmgen out = link(world, SameState, eventually `l|depth[boat1]` > 3, {NEAR}, true)\nstream later = out",
        f"strmgen out = link(world, SameState, eventually occurred(chronicle[`n|painted`, from]), {NEAR}, true)\nstream later = out",
        f"strmgen out = link(world, SameState, true, {NEAR}, forall c in `n|cars`: xy_dist[c, from] > 1)\nstream later = out",
        f"strmgen out = link(world, SameState, eventually `s|length_m[from] > 3|colour[from] > 3|length_m[from]|colour[from]`, {NEAR}, true)\nstream later = out",
        f"strmgen out = link(world, SameState, eventually `m|speed[from]|speed[to]|speed|length_m` > 3, {NEAR}, true)\nstream later = out",
        "strmgen out = composite(world, always[0, 1s] (xy_dist[from, to] < 9 and `n|colour`[from] = colour[to]), true)\nstream later = out",
        "want boss in `n|world` = eventually speed[boss] > 3",
        "want boss in world = eventually `n|length_m`[boss] > 3",
        "want boss in world = eventually `m|speed[boss]|speed[bos]|speed|speed[boss, boss]` > 3",
    ]
    return [Template(each) for each in (*streams, *monitors, *links)]


def mistyped(name: str, draw: random.Random) -> str:
    """The name with one letter left out, doubled, exchanged or another."""
    while True:
        at, letters = draw.randrange(len(name)), list(name)
        match draw.randrange(4):
            case 0 if len(name) > 2:
                del letters[at]
            case 1:
                letters.insert(at, letters[at])
            case 2 if at + 1 < len(name):
                letters[at], letters[at + 1] = letters[at + 1], letters[at]
            case _:
                letters[at] = draw.choice("abcdefghijklmnopqrstuvwxyz")
        found = "".join(letters)
        if found != name and found[0].isalpha() and found not in KNOWN:
            return found


KNOWN = frozenset(BASE.replace("(", " ").replace(")", " ").replace("[", " ").replace("]", " ").replace(",", " ").split()) | {
    "to", "x", "xydist", "y", "in", "or", "as", "oo", "self", "now", "speed", "deviation",
}  # fmt: skip


class Wrong(NamedTuple):
    """A wrong declaration: its text, the right one, and on which of its lines the mistake stands, counted from 0."""

    text: str
    right: str
    line: int


def wrong_ones(count: int, seed: int) -> Iterator[Wrong]:
    """So many, no two the same."""
    draw, every, told = random.Random(seed), templates(), set[str]()
    while len(told) < count:
        each = draw.choice(every)
        parts = each.text.split("`")
        at = draw.choice([i for i in range(1, len(parts), 2) if not parts[i].startswith("U|")])
        unit = mistyped("Other", draw)
        filled, line = [], 0
        for i, part in enumerate(parts):
            if i == at:
                line = "".join(filled).count("\n")
            filled.append(
                part if i % 2 == 0 else _filled(part, is_wrong=i == at, draw=draw, unit=unit, parts=parts, at=at)
            )
        text = "".join(filled)
        if text not in told and text != each.right():
            told.add(text)
            yield Wrong(text, each.right(), line)


def _filled(part: str, *, is_wrong: bool, draw: random.Random, unit: str, parts: list[str], at: int) -> str:
    kind, right, *others = part.split("|")
    if kind == "U" and parts[at].startswith("u|"):
        return unit
    if not is_wrong:
        return right
    match kind:
        case "u":
            return others[0].replace("NAME", unit)
        case "n":
            return mistyped(right, draw)
        case "l":
            name = right.partition("[")[0]
            return draw.choice([name, f"{right[:-1]}, boat2]", f"{mistyped(name, draw)}{right[len(name) :]}"])
    return draw.choice(others)


def findings_of(more: str) -> tuple[list[TextError], list[TextError]]:
    """Errors and warnings of `kpl check` for the base with more at its end."""
    text = SourceText(f"{BASE}{more}\n", "a.kpl")
    running = Running(prototypes=UNITS, sorts={})
    try:
        specification, errors, unread = read_specification(text, lambda _path: CHRONICLES)
    except TextError as wrong:
        return list(wrong.errors if isinstance(wrong, TextErrors) else [wrong]), []
    findings = running.instance.findings(specification, (), text, unread)
    return [*errors, *findings.errors], list(findings.warnings)
