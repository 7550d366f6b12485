"""What may have been meant where no sample teaches it: looked for around the place where a text leaves the grammar.

Every error is to come with something that can be written; where nothing better is known it is a statement of the kind
that was begun.
"""

import re
from collections.abc import Collection
from difflib import get_close_matches
from typing import Final, NamedTuple

FORMS: Final = {
    "source": "source pos pos_car1",
    "compunit": "compunit speed SpeedEst(pos)",
    "strmgen": "strmgen speed[car1] = SpeedEst(pos[car1])",
    "stream": "stream speed_car1 = speed[car1]",
    "for": "for car in car_ids strmgen dist[car] = Distance(pos[car])",
    "export": "export heli-position = pos[self]",
    "import": "import heli-position from 1 as pos[uav1]",
    "define": "define MIN_XY = 15.0",
    "monitor": "monitor calm = always speed[self] < 5 with no value false, close after 3",
    "chronicle": 'chronicle file "overtake.chr"',
}
"""A statement of each kind, by its first word."""
MAKINGS: Final = {
    "state": "strmgen s = state(pos[car1], speed[car1]) with sample every 100, max delay 200",
    "link": "strmgen cars = link(vision_objects, Car, true, false, always on_road[from])",
    "select": "strmgen tracked = select pos[car] for car in current_car",
    "merge": "strmgen all_pos = merge pos[car] for car in car_ids",
}
STATEMENT = (
    "a statement begins with source, compunit, strmgen, stream, for, export, import, define, monitor or chronicle"
)
POLICY: Final = "with sample every 200, max delay 1000"
CONSTRAINTS: Final = frozenset({"any", "delay", "from", "importance", "max", "min", "monotone", "no", "sample", "strict", "to", "use"})  # fmt: skip
"""How constraints begin."""

_MEANT: Final = {
    "foreach": "for", "forall": "for", "generator": "strmgen", "stream_generator": "strmgen", "output": "stream",
    "const": "define", "def": "define", "let": "define", "unit": "compunit", "alarm": "monitor", "sensor": "source",
}  # fmt: skip
"""Words of others that begin statements, and ours."""
ASKED: Final = {
    "certainty": "min certainty 0.95", "confidence": "min certainty 0.95", "deviation": "max deviation 2.0",
    "change": "any change", "changes": "any change", "on": "any change", "update": "any update", "strictly": "strict order",
    "ordered": "monotone order", "order": "monotone order", "interpolate": "use linear", "interpolated": "use linear",
    "linear": "use linear", "average": "use linear", "nearest": "use most recent", "latest": "use most recent",
    "period": "sample every 200", "rate": "sample every 200", "sampled": "sample every 200", "timeout": "max delay 1000",
    "closes": "close after 3", "until": "from 300 to 400", "between": "from 300 to 400", "after": "from 300 to 400", "priority": "importance 2",
}  # fmt: skip
"""Words of others for constraints, and ours."""
GOES_ON: Final = {
    "importance": "importance 2", "certainty": "min certainty 0.95", "deviation": "max deviation 2.0",
    "every": "sample every 200", "delay": "max delay 1000", "approximation": "delay before approximation 100",
    "after": "close after 3", "any": "any change", "strict": "strict order", "monotone": "monotone order", "use": "use linear",
    "value": "no value undecided", "max": "max delay 1000", "min": "min certainty 0.95", "to": "from 300 to 400",
    "from": "from 300 to 400", "close": "close after 3", "no": "no approximation",
}  # fmt: skip
"""What a constraint or an option that was begun with such a word may have been."""
_TIME, _NUMBER = "a time, such as 200 or 2s", "a number"
_WANTS: Final = {
    "every": _TIME, "delay": f"{_TIME}, or oo", "from": _TIME, "to": f"{_TIME}, or oo", "approximation": _TIME,
    "importance": _NUMBER, "certainty": f"{_NUMBER} from 0 to 1", "deviation": _NUMBER, "after": f"{_NUMBER} of states",
}  # fmt: skip
_OPENED: Final = {"min": ("min", "max"), "max": ("min", "max")}
_BEGINS = re.compile(rf"^[ \t]*({'|'.join(FORMS)})\b", re.MULTILINE)
_MAKING = re.compile(r"=\s*(state|link|select|merge)\b")
_PAIRS: Final = {"(": ")", "[": "]", "{": "}"}
_LOOK_BACK: Final = 4096


class Guess(NamedTuple):
    """What to say, what to write, and where."""

    message: str
    repair: str
    offset: int
    width: int


class Around(NamedTuple):
    """A place where a text leaves the grammar.

    Attributes:
        before: the statement up to there, or the end of what is before.
        found: the token there; empty at the end.
        wanted: the terminals that could have stood there.
    """

    before: str
    found: str
    wanted: Collection[str]
    offset: int

    @classmethod
    def of(cls, text: str, offset: int, found: str, wanted: Collection[str]) -> "Around":
        start = max(0, offset - _LOOK_BACK)
        begun = [each.start() for each in _BEGINS.finditer(text, start, offset)]
        return cls(text[begun[-1] if begun else start : offset], found, wanted, offset)

    @property
    def statement(self) -> str:
        """The first word of the statement; empty where none is begun."""
        begun = _BEGINS.match(self.before)
        return begun[1] if begun else ""

    @property
    def in_policy(self) -> bool:
        return re.search(r"\bwith\b[^\])]*\Z", self.before) is not None

    @property
    def begins_line(self) -> bool:
        return not self.before or self.before.rpartition("\n")[2].strip() == "" or not self.before.strip()

    @property
    def open_bracket(self) -> tuple[str, int] | None:
        """The innermost that is not closed, and where it stands in `before`."""
        opened: list[tuple[str, int]] = []
        for at, character in enumerate(self.before):
            if character in _PAIRS:
                opened.append((character, at))
            elif character in ")]}" and opened:
                opened.pop()
        return opened[-1] if opened else None

    def said(self, message: str, repair: str) -> Guess:
        return Guess(message, repair, self.offset, len(self.found))

    @property
    def form(self) -> str:
        """What could be written instead, if all else fails."""
        if self.in_policy and self.statement not in {"monitor", ""}:
            return POLICY
        made = _MAKING.search(self.before)
        return MAKINGS[made[1]] if made and self.statement == "strmgen" else FORMS.get(self.statement, FORMS["strmgen"])


def guess(around: Around) -> Guess | None:
    """What may have been meant, where something in particular may have been; asked before the samples are."""
    return _statement(around) or _comma(around) or _bracket(around) or _unit(around)


def _statement(around: Around) -> Guess | None:
    """A statement whose first word is another one's, or misspelt."""
    found = around.found
    if not around.begins_line or "SOURCE" not in around.wanted or not found[:1].isalpha() or found in FORMS:
        return None
    near = get_close_matches(found.lower()[:32].replace("_", ""), FORMS, n=1)
    meant = _MEANT.get(found.lower()) or (near[0] if near else None)
    return around.said(f"{STATEMENT}; found `{found[:40]}`", meant) if meant else None


def _comma(around: Around) -> Guess | None:
    """A comma too much or too few."""
    before, found = around.before.rstrip(), around.found
    if before.endswith(",") and (found in {"", ")", "]", "}", ","}):
        return Guess("nothing follows this comma", "nothing: leave the comma out", around.offset - len(around.before) + len(before) - 1, 1)  # fmt: skip
    if before.endswith(",") and found == "with":
        return around.said("a policy follows its stream without a comma", "pos[car1] with sample every 200")
    is_name = found[:1].isalpha() and found not in CONSTRAINTS
    opened = around.open_bracket
    if is_name and opened and opened[0] == "(" and "COMMA" in around.wanted:
        if around.statement == "compunit":
            return around.said("the sorts of the inputs are parted by commas", f", {found}")
        if around.statement in {"strmgen", "for"} and before.endswith("]"):
            return around.said("streams are parted by commas", f", {found}")
    after_to = found == "from" and re.search(r"\bto\s+[0-9a-z.]+\Z", before)
    if (
        found in CONSTRAINTS
        and not after_to
        and around.in_policy
        and "COMMA" in around.wanted
        and not before.endswith(",")
    ):
        return around.said("constraints are parted by commas", "with sample every 200, max delay 1000")
    return None


def _bracket(around: Around) -> Guess | None:
    """A bracket of the wrong kind, or one that closes nothing."""
    found, opened = around.found, around.open_bracket
    if found and found in ")]}":
        if opened is None:
            return around.said(f"`{found}` closes nothing", "nothing: leave it out")
        closing = _PAIRS[opened[0]]
        is_interval = re.search(r"\b(always|eventually|until)\s*\Z", around.before[: opened[1]])
        if found != closing and not is_interval and {"RPAR": ")", "RSQB": "]", "RBRACE": "}"}.keys() & around.wanted:
            at = around.offset - len(around.before) + opened[1]
            return around.said(f"`{opened[0]}` is not closed by `{found}`", closing) if at >= 0 else None
    if found == "(" and around.in_policy and around.before.rstrip().endswith("with"):
        return around.said("a policy stands without brackets", POLICY)
    if found == "[" and "LBRACE" in around.wanted:
        return around.said("the members of a set stand in braces", "{car1, car2}")
    if found in {"{", "["} and around.before.rstrip().endswith(" in") and around.statement == "for":
        return around.said("the members come from a stream, whose values are objects or sets of them", FORMS["for"])
    if found in {"{", "("} and "LSQB" in around.wanted and "LPAR" not in around.wanted and around.statement == "stream":
        repair = "pos[car1]; or first strmgen speed[car1] = SpeedEst(pos[car1])" if found == "(" else "pos[car1]"
        return around.said("objects stand in brackets; what is to be computed is a generator" if found == "(" else "objects stand in brackets", repair)  # fmt: skip
    return None


def _unit(around: Around) -> Guess | None:
    """Units that numbers do not have, and times that belong elsewhere."""
    before, found = around.before.rstrip(), around.found
    if around.statement not in {"monitor", "define"} and not around.in_policy:
        return None
    moment = "eventually[0, 3s] speed[car1] < 5"
    if found in {"within", "during"} or (found[:1].isdecimal() and re.search(r"\b(for|within|during)\Z", before)):
        return around.said("a time stands in brackets after always, eventually or until", moment)
    number = re.search(r"(?<![A-Za-z_0-9])([0-9][0-9.]*)\Z", before)
    is_word = found[:1].isalpha() and found not in CONSTRAINTS
    is_time = re.search(r"\b(every|delay|from|to|approximation)\s+[0-9.]+\Z", before)
    if number and is_word and not is_time and "\n" not in around.before[len(before) :]:
        return around.said(
            f"`{found}` is no unit here: times have us, ms, s, min or h, other numbers are in the unit of their stream",
            number[1],
        )
    return None


def guess_constraint(around: Around) -> Guess | None:
    """A constraint in the words of others, or not said to its end; asked after the samples are."""
    begun = re.search(r"([a-z]+)\s*\Z", around.before)
    if around.in_policy and begun and begun[1] in GOES_ON and not {"SAMPLE", "MAX"} <= set(around.wanted):
        return _begun(around, begun[1])
    if not {"SAMPLE", "MAX"} <= set(around.wanted):
        return None
    known = ASKED.get(around.found.lower().partition("_")[0]) or next(
        (repair for word, repair in ASKED.items() if get_close_matches(around.found.lower(), [word], cutoff=0.8)), ""
    )
    begins = get_close_matches(around.found.lower(), [*sorted(CONSTRAINTS), "sample_every", "max_delay"], n=1)
    repair = known or {"sample_every": "sample every 200", "max_delay": "max delay 1000", "sample": "sample every 200", "max": "max delay 1000"}.get(begins[0] if begins else "", "")  # fmt: skip
    what = f"found `{around.found[:40]}`" if around.found else "the text ends"
    return around.said(f"expected a constraint; {what}", repair or "sample every 200")


def _begun(around: Around, word: str) -> Guess:
    """A constraint that goes on with a wrong word, or with none."""
    asked = ASKED.get(around.found, "")
    repair = asked if asked.startswith((*_OPENED.get(word, (word,)),)) else GOES_ON[word]
    wanted = ", ".join(f"`{name.lower()}`" for name in sorted(around.wanted)) if len(around.wanted) < 5 else ""
    what = f"found `{around.found[:40]}`" if around.found else "the text ends"
    return around.said(f"`{word}` goes on with {_WANTS.get(word, wanted)}; {what}", repair)
