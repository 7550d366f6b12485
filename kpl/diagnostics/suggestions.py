"""Suggestions where no sample teaches the message: from the words around the place where a text leaves the grammar.

Every error is to come with something that can be written; where nothing better is known it is a statement of the kind
that was begun. The forms and words are data: suggestions.toml.
"""

import re
from collections.abc import Collection
from difflib import get_close_matches
from functools import cache
from typing import Final, NamedTuple

from dyknow.kpl.diagnostics.languages import table

PAIRS: Final = {"(": ")", "[": "]", "{": "}"}
_MAKING = re.compile(r"=\s*(state|link|composite|select|merge|first of)\b")
_LOOK_BACK: Final = 4096
_SHOWN: Final = 40
_CUTOFF: Final = 0.8
_FEW: Final = 5
_LONGEST: Final = 12
"""Longest word, in characters, that is compared with those that begin statements."""


class Diagnosis(NamedTuple):
    """A message, a repair, and their place: offset and width in characters."""

    message: str
    repair: str
    offset: int
    width: int


class ErrorContext(NamedTuple):
    """A place where a text leaves the grammar.

    Attributes:
        before: the statement up to there, or the end of the statement before.
        stopped: the token there; empty at the end.
        wanted: the terminals that could have stood there.
    """

    before: str
    stopped: str
    wanted: Collection[str]
    offset: int

    @classmethod
    def of(cls, text: str, offset: int, stopped: str, wanted: Collection[str]) -> "ErrorContext":
        start = max(0, offset - _LOOK_BACK)
        begun = [each.start() for each in _begins().finditer(text, start, offset)]
        return cls(text[begun[-1] if begun else start : offset], stopped, wanted, offset)

    @property
    def statement(self) -> str:
        """The first word of the statement; empty where none is begun."""
        begun = _begins().match(self.before)
        return begun[1] if begun else ""

    @property
    def in_policy(self) -> bool:
        return re.search(r"\bwith\b[^\])]*\Z", self.before) is not None

    @property
    def begins_line(self) -> bool:
        return not self.before.rpartition("\n")[2].strip()

    @property
    def in_constraint(self) -> bool:
        """Whether a constraint could have stood there."""
        return {"SAMPLE", "MAX"} <= set(self.wanted)

    def diagnosis(self, message: str, repair: str) -> Diagnosis:
        return Diagnosis(message, repair, self.offset, len(self.stopped))

    def expected(self, what: str, repair: str) -> Diagnosis:
        stopped = f"found `{self.stopped[:_SHOWN]}`" if self.stopped else "the text ends"
        return self.diagnosis(f"{what}; {stopped}", repair)

    @property
    def form(self) -> str:
        """The form of the statement or policy, as the last suggestion."""
        forms = table("suggestions")
        if self.in_policy and self.statement not in {"monitor", ""}:
            return str(forms["policy"])
        made = _MAKING.search(self.before)
        if made and self.statement == "strmgen":
            return str(forms["makings"][made[1]])
        return str(forms["forms"].get(self.statement, forms["forms"]["strmgen"]))


def begins_statement(word: str) -> bool:
    """Whether a statement begins with the word, or with one that is nearly it."""
    forms = table("suggestions")["forms"]
    return word in forms or (len(word) <= _LONGEST and bool(get_close_matches(word.lower(), forms, 1, _CUTOFF)))


def last_unclosed(text: str) -> int | None:
    """The offset of the innermost bracket that is not closed."""
    opened = []
    for offset, character in enumerate(text):
        if character in PAIRS:
            opened.append(offset)
        elif character in ")]}" and opened:
            opened.pop()
    return opened[-1] if opened else None


def suggest(context: ErrorContext) -> Diagnosis | None:
    """The suggestions that are more particular than what samples teach."""
    return _statement(context) or _comma(context) or _bracket(context) or _unit(context)


def suggest_constraint(context: ErrorContext) -> Diagnosis | None:
    """A constraint in words of other languages, or one that is not complete; less particular than samples."""
    words, stopped = table("suggestions"), context.stopped
    begun = re.search(r"([a-z]+)\s*\Z", context.before)
    if not context.in_constraint:
        if context.in_policy and begun and begun[1] in words["continued"]:
            return _begun(context, begun[1])
        return None
    asked: dict[str, str] = words["asked"]
    repair = asked.get(stopped.lower().partition("_")[0]) or next(
        (repair for word, repair in asked.items() if get_close_matches(stopped.lower(), [word], cutoff=_CUTOFF)), ""
    )
    if not repair:
        begins = get_close_matches(stopped.lower(), [*words["constraints"], "sample_every", "max_delay"], n=1)
        repair = "max delay 1000" if begins and begins[0].startswith("max") else "sample every 200"
    return context.expected("expected a constraint", repair)


def _statement(context: ErrorContext) -> Diagnosis | None:
    """A statement whose first word is of another language, or misspelt."""
    words, stopped = table("suggestions"), context.stopped
    can_begin = context.begins_line and "SOURCE" in context.wanted and stopped[:1].isalpha()
    if not can_begin or stopped in words["forms"]:
        return None
    near = get_close_matches(stopped.lower()[:32].replace("_", ""), words["forms"], n=1)
    meant = words["meant"].get(stopped.lower()) or (near[0] if near else None)
    return context.expected(words["statement"], meant) if meant else None


def _comma(context: ErrorContext) -> Diagnosis | None:
    """A comma too much or too few."""
    before, stopped, wants_comma = context.before.rstrip(), context.stopped, "COMMA" in context.wanted
    after_comma = before.endswith(",")
    constraints = table("suggestions")["constraints"]
    if after_comma and stopped in {"", ")", "]", "}", ","}:
        offset = context.offset - len(context.before) + len(before) - 1
        return Diagnosis("nothing follows this comma", "nothing: leave the comma out", offset, 1)
    if after_comma and stopped == "with":
        return context.diagnosis("a policy follows its stream without a comma", "pos[car1] with sample every 200")
    opened = last_unclosed(context.before)
    is_argument = stopped[:1].isalpha() and stopped not in constraints
    if is_argument and wants_comma and opened is not None and context.before[opened] == "(":
        if context.statement == "compunit":
            return context.diagnosis("the sorts of the inputs are separated by commas", f", {stopped}")
        if context.statement in {"strmgen", "for"} and before.endswith("]"):
            return context.diagnosis("streams are separated by commas", f", {stopped}")
    after_to = stopped == "from" and re.search(r"\bto\s+[0-9a-z.]+\Z", before)
    if stopped in constraints and not after_to and context.in_policy and wants_comma and not after_comma:
        return context.diagnosis("constraints are separated by commas", "with sample every 200, max delay 1000")
    return None


def _bracket(context: ErrorContext) -> Diagnosis | None:
    """A bracket of the wrong kind, or one that closes nothing."""
    stopped, before, wanted = context.stopped, context.before, context.wanted
    forms = table("suggestions")
    if stopped and stopped in ")]}":
        opened = last_unclosed(before)
        if opened is None:
            return context.diagnosis(f"`{stopped}` closes nothing", "nothing: leave it out")
        closing = PAIRS[before[opened]]
        is_interval = re.search(r"\b(always|eventually|until)\s*\Z", before[:opened])
        if stopped != closing and not is_interval and {"RPAR", "RSQB", "RBRACE"} & set(wanted):
            return context.diagnosis(f"`{before[opened]}` is not closed by `{stopped}`", closing)
    if stopped == "(" and context.in_policy and before.rstrip().endswith("with"):
        return context.diagnosis("a policy stands without brackets", forms["policy"])
    if stopped == "[" and "LBRACE" in wanted:
        return context.diagnosis("the members of a set stand in braces", "{car1, car2}")
    if stopped in {"{", "["} and before.rstrip().endswith(" in") and context.statement == "for":
        message = "the members come from a stream, whose values are objects or sets of them"
        return context.diagnosis(message, forms["forms"]["for"])
    is_argument = "LSQB" in wanted and "LPAR" not in wanted and context.statement == "stream"
    if stopped == "(" and is_argument:
        message = "objects stand in brackets; what is to be computed is a generator"
        return context.diagnosis(message, "pos[car1]; or first strmgen speed[car1] = SpeedEst(pos[car1])")
    if stopped == "{" and is_argument:
        return context.diagnosis("objects stand in brackets", "pos[car1]")
    return None


def _unit(context: ErrorContext) -> Diagnosis | None:
    """Units that numbers do not have, and times that belong elsewhere."""
    before, stopped = context.before.rstrip(), context.stopped
    if context.statement not in {"monitor", "define"} and not context.in_policy:
        return None
    if stopped in {"within", "during"} or (stopped[:1].isdecimal() and re.search(r"\b(for|within|during)\Z", before)):
        message = "a time stands in brackets after always, eventually or until"
        return context.diagnosis(message, "eventually[0, 3s] speed[car1] < 5")
    number = re.search(r"(?<![A-Za-z_0-9])([0-9][0-9.]*)\Z", before)
    is_word = stopped[:1].isalpha() and stopped not in table("suggestions")["constraints"]
    is_time = re.search(r"\b(every|delay|from|to|approximation)\s+[0-9.]+\Z", before)
    if number and is_word and not is_time and "\n" not in context.before[len(before) :]:
        units = "times have us, ms, s, min or h, other numbers are in the unit of their stream"
        return context.diagnosis(f"`{stopped}` is no unit here: {units}", number[1])
    return None


def _begun(context: ErrorContext, word: str) -> Diagnosis:
    """A constraint whose first word is followed by a wrong word, or by none."""
    words = table("suggestions")
    asked = words["asked"].get(context.stopped, "")
    repair = asked if asked.startswith(("min", "max") if word in {"min", "max"} else word) else words["continued"][word]
    few = sorted(context.wanted) if len(context.wanted) < _FEW else []
    wanted = words["wanted"].get(word, ", ".join(f"`{name.lower()}`" for name in few))
    return context.expected(f"`{word}` is followed by {wanted}", repair)


@cache
def _begins() -> re.Pattern[str]:
    """A statement at the beginning of a line."""
    return re.compile(rf"^[ \t]*({'|'.join(table('suggestions')['forms'])})\b", re.MULTILINE)
