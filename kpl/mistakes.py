"""Mistakes people make, as data: sample errors teach the message.

Each sample is parsed once, at the first error anybody makes; where the parser stops, and on which token, becomes the
mark by which the same mistake is recognised elsewhere. Spellings of other languages are recognised by themselves.
"""

import re
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeAlias

from dyknow.errors import TextError
from dyknow.labels import RESERVED
from kpl.guesses import FORMS, Around, Guess, guess, guess_constraint

if TYPE_CHECKING:
    from lark.exceptions import UnexpectedInput


_LOOK_BACK: Final = 64


class Mistake(NamedTuple):
    """What to say, what to write instead, and samples, each of which stops the parser in its way."""

    message: str
    repair: str
    samples: tuple[str, ...]


FOREIGN: Final[dict[str, str]] = {
    "&&": "and",
    "||": "or",
    "==": "=",
    "=>": "->",
    "<>": "!=",
    "/\\": "and",
    "\\/": "or",
    "~=": "!=",
    "&": "and",
    "|": "or",
    "!": "not",
    "~": "not",
    "∧": "and",
    "∨": "or",
    "¬": "not",
    "→": "->",
    "⇒": "->",
    "∀": "forall x in domain:",
    "∃": "exists x in domain:",
    "□": "always",
    "◇": "eventually",
    "♢": "eventually",
    "≤": "<=",
    "≥": ">=",
    "≠": "!=",
    "∞": "oo",
    "·": "*",
    "×": "*",
    "−": "-",  # a typographic minus
    "⊤": "true",
    "⊥": "false",
    ":=": "=",
    "=<": "<=",
    "//": "# a comment",
    "/*": "# a comment",
    "'": '"',
    "%": "a part of one: 0.95",
    ";": "a new line; between constraints a comma",
}
"""Operators of other languages and ours; the longest that fits counts."""

WORDS: Final[dict[str, str]] = {
    "implies": "->",
    "infinity": "oo",
    "inf": "oo",
    "globally": "always",
    "finally": "eventually",
    "for_all": "forall",
    "foreach": "forall",
    "exist": "exists",
    "if": "a -> b",
    "then": "->",
    "xor": "!=",
}

MISTAKES: Final = (
    Mistake(
        "objects stand in brackets", "speed[u]", ("speed(u)", "p and speed(u) > 3", "true -> speed(u)", "abs(speed(u))")
    ),
    Mistake(
        "the domain and the body of a quantifier are parted by a colon",
        "forall u in uavs: ...",
        (
            "forall u in uavs p",
            "forall u in uavs. p",
            "forall u in {a, b} p",
            "forall u in {a}. p",
            "forall u in {a}, p",
            "forall u in {a} (p)",
            "forall u in d - {a} p",
            "forall u in d - e p",
            "forall u in uavs, p",
            "forall u in uavs (p)",
        ),
    ),
    Mistake(
        "a quantifier names its domain with `in`", "forall u in uavs: ...", ("forall u: p", "exists u. p", "forall u p")
    ),
    Mistake(
        "a quantifier binds one variable", "forall u in uavs: forall c in carryable: ...", ("forall u, c in d: p",)
    ),
    Mistake(
        "comparisons do not chain",
        "a < b and b < c",
        ("a < b < c", "a[u] < 3 < c", "1 < 2 < 3", "a = b = c", "a < b = c", "a < b + 1 < c"),
    ),
    Mistake("an interval is closed on both sides", "[0, 5s]", ("always[0, 5) p", "always[0, oo) p", "always[0, t) p")),
    Mistake(
        "the bounds of an interval are parted by a comma",
        "[0, 5s]",
        ("always[0 5] p", "always[5] p", "always[5s] p", "always[a b] p", "always[a] p"),
    ),
    Mistake(
        "an interval stands in brackets, directly after always, eventually or until",
        "always[0, 5s] p",
        ("always(0, 5) p", "always (0s, oo) p", "p until (0, 5) q", "always(a, b) p"),
    ),
    Mistake(
        "the bounds of an interval are times", "[0, 5s]", ("always[-1, 5] p", "always[0, -5] p", "always[(1), 5] p")
    ),
    Mistake("an interval cannot begin at oo", "[0, oo]", ("always[oo, 5] p",)),
    Mistake(
        "objects are names or whole numbers",
        "speed[uav1]",
        ('speed["a"]', "speed[-1]", "speed[a + b]", "speed[]", "speed[a b]"),
    ),
)


class Spelling(NamedTuple):
    """How one language is spelled.

    Attributes:
        operators, words: those of other languages, and ours.
        reserved: words that name nothing; `keywords` are those, as terminals, that can be expected where a name cannot.
        empty: what to say of a text in which nothing is, and the repair.
        guess_first, guess_last: what may have been meant, asked before and after the samples are.
        form: what could be written there, where nothing better is known.
        groups: terminals that are told by one word where all of them could stand, and which others are told beside it.
    """

    operators: Mapping[str, str]
    words: Mapping[str, str]
    reserved: Collection[str]
    keywords: tuple[str, ...]
    empty: tuple[str, str]
    groups: tuple[tuple[frozenset[str], str, frozenset[str]], ...]
    guess_first: Callable[[Around], Guess | None] | None = None
    guess_last: Callable[[Around], Guess | None] | None = None
    form: Callable[[Around], str] | None = None


_LOGIC: Final = ("AND", "OR", "UNTIL", "NOT", "ALWAYS", "EVENTUALLY", "FORALL", "EXISTS", "TRUE", "FALSE", "ABS")
FORMULA_SPELLING: Final = Spelling(
    FOREIGN,
    WORDS,
    RESERVED,
    _LOGIC,
    ("there is no formula", "always speed[uav1] <= 30"),
    (
        (frozenset({"LPAR", "NUMBER", "NOT"}), "a formula", frozenset()),
        (frozenset({"LPAR", "NUMBER"}), "a value", frozenset()),
        (frozenset({"AND", "OR"}), "an operator", frozenset({"RPAR", "RSQB", "COMMA", "$END"})),
    ),
    guess,
    guess_constraint,
    lambda around: around.form if around.statement else "always speed[uav1] <= 30",
)

_EXPECTED: Final[dict[str, str]] = {
    "NAME": "a name",
    "VARIABLE": "a variable",
    "NUMBER": "a number",
    "STRING": "a string",
    "CMP": "a comparison",
    "EQUALS": "`=`",
    "LPAR": "`(`",
    "RPAR": "`)`",
    "LSQB": "`[`",
    "RSQB": "`]`",
    "LBRACE": "`{`",
    "RBRACE": "`}`",
    "COMMA": "`,`",
    "COLON": "`:`",
    "DOT": "`.`",
    "MINUS": "`-`",
    "PLUS": "`+`",
    "STAR": "`*`",
    "SLASH": "`/`",
    "OO": "`oo`",
    "SEMICOLON": "`;`",
    "LESS": "`<`",
    "MORE": "`>`",
    "EQUAL": "`==`",
    "UNEQUAL": "`!=`",
    "UNION": "`|`",
    "WITHOUT": "`\\`",
    "IMPLIES": "`=>`",
    "SAME": "`<=>`",
    "$END": "the end",
    "__ANON_0": "`->`",
}
Mark: TypeAlias = tuple[int, str]
"""Where the parser stopped (its state) and on what (the type of the token)."""


def explain(
    error: "UnexpectedInput",
    text: str,
    file: str,
    marks: Callable[[], Mapping[Mark, Mistake]],
    spelling: Spelling = FORMULA_SPELLING,
) -> TextError:
    """The error for the person who typed it; `marks` are what `learn` made of the samples, asked for when needed."""
    offset = min(
        error.pos_in_stream if error.pos_in_stream is not None and error.pos_in_stream >= 0 else len(text), len(text)
    )
    found = _found(error)
    if found == "":
        offset = len(text.rstrip())
    message, repair, offset, width = _say(error, text, offset, found, marks, spelling)
    return TextError.at_offset(text, offset, message, width=width, repair=repair, file=file)


def _found(error: "UnexpectedInput") -> str:
    """The token or character the parser stopped at; empty at the end of the text."""
    token = getattr(error, "token", None)
    if token is None:
        return str(getattr(error, "char", ""))
    return "" if token.type == "$END" else str(token)


class _Said(NamedTuple):
    message: str
    repair: str
    offset: int
    width: int


def _say(
    error: "UnexpectedInput",
    text: str,
    offset: int,
    found: str,
    marks: Callable[[], Mapping[Mark, Mistake]],
    spelling: Spelling,
) -> _Said:
    if not text.strip():
        return _Said(*spelling.empty, 0, 1)
    said = _misspelt(text, offset, found, spelling) or _unfinished(text, offset, found)
    if said is not None:
        return said
    wanted = _wanted(error)
    around = Around.of(text, offset, found, wanted)
    form = spelling.form(around) if spelling.form else ""
    if getattr(error, "token", None) is None:
        return _Said(f"`{found}` has no meaning here", form, offset, len(found))
    meant = spelling.guess_first and spelling.guess_first(around)
    if meant:
        return _Said(*meant)
    mistake = marks().get(_mark(error))
    if mistake is not None:
        return _Said(mistake.message, mistake.repair, offset, len(found))
    meant = spelling.guess_last and spelling.guess_last(around)
    if meant:
        return _Said(*meant)
    begins_line = not text[text.rfind("\n", 0, offset) + 1 : offset].strip()
    can_be_word = found.upper() in spelling.keywords and (begins_line or not wanted.isdisjoint(spelling.keywords))
    if found in spelling.reserved and "NAME" in wanted and not can_be_word:
        return _Said(f"`{found}` is a reserved word and cannot be a name", f"{found}_", offset, len(found))
    what = f"found {_short(found)}" if found else "the text ends"
    expected = ", ".join(_expected(wanted, spelling)) or "something else"
    return _Said(f"expected {expected}; {what}", form, offset, len(found))


def _misspelt(text: str, offset: int, found: str, spelling: Spelling) -> _Said | None:
    """An operator or a word of another language, here or just before."""
    foreign = _foreign(text, offset, found, spelling.operators)
    if foreign is not None:
        start, theirs = foreign
        return _Said(f"`{theirs}` is not written here", spelling.operators[theirs], start, len(theirs))
    before = re.search(r"([A-Za-z_]+)\s*\Z", text[max(0, offset - _LOOK_BACK) : offset])
    for word, start in ((found, offset), (before[1], offset - len(before[0])) if before else ("", 0)):
        if (ours := _word(word, spelling)) is not None:
            return _Said(f"`{word}` is not written here", ours, start, len(word))
    return None


def _unfinished(text: str, offset: int, found: str) -> _Said | None:
    """A bracket or a string that is never closed."""
    if found == '"':
        return _Said("this string is never closed", '"text" on one line', offset, 1)
    opened = _unclosed(text) if found == "" else None
    if opened is None:
        return None
    closing = {"(": ")", "[": "]", "{": "}"}[text[opened]]
    return _Said(f"this `{text[opened]}` is never closed", f"{closing} where it ends", opened, 1)


def _short(found: str) -> str:
    return f"`{found}`" if len(found) <= 40 else f"`{found[:40]}...`"


def _foreign(text: str, offset: int, found: str, operators: Mapping[str, str]) -> tuple[int, str] | None:
    """A spelling of another language at, or begun just before, the offset; it is not the beginning of a token of ours."""
    for start in (offset, offset - 1):
        for length in (2, 1):
            theirs = text[max(0, start) : start + length]
            is_beginning = start == offset and length < len(found)
            if theirs in operators and start + len(theirs) > offset and not is_beginning:
                return start, theirs
    return None


def _word(found: str, spelling: Spelling) -> str | None:
    lower = found.lower()
    if lower in spelling.words:
        return spelling.words[lower]
    return lower if found != lower and lower.upper() in spelling.keywords else None


def _unclosed(text: str) -> int | None:
    opened = []
    for offset, character in enumerate(text):
        if character in "([{":
            opened.append(offset)
        elif character in ")]}" and opened:
            opened.pop()
    return opened[-1] if opened else None


def _wanted(error: "UnexpectedInput") -> set[str]:
    """The terminals that could have stood there."""
    return set(
        getattr(error, "accepts", None) or getattr(error, "expected", None) or getattr(error, "allowed", None) or ()
    )


def _expected(wanted: set[str], spelling: Spelling) -> list[str]:
    """What could have stood there, in words: names once, operators together."""
    for needed, word, kept in spelling.groups:
        if needed <= wanted:
            return [word, *(_EXPECTED[name] for name in _EXPECTED if name in wanted & kept)]
    words = [_EXPECTED[name] for name in _EXPECTED if name in wanted]
    keywords = spelling.keywords
    if spelling.form is not None and "NAME" not in wanted:
        if {"SOURCE", "$END"} <= wanted:
            wanted = wanted - {name.upper() for name in FORMS}
            words[words.index("the end")] = "the next statement"
        keywords = tuple(sorted(wanted - _EXPECTED.keys()))
    return words + [f"`{name.lower()}`" for name in keywords if name in wanted]


def _mark(error: "UnexpectedInput") -> Mark:
    state, token = getattr(error, "state", None), getattr(error, "token", None)
    return (getattr(state, "position", -1), "" if token is None else token.type)


def learn(parse: Callable[[str], Any], mistakes: Iterable[Mistake] = MISTAKES) -> Mapping[Mark, Mistake]:
    """The marks of all samples with this parser; the first sample with a mark owns it."""
    from lark.exceptions import UnexpectedCharacters, UnexpectedToken

    marks: dict[Mark, Mistake] = {}
    for mistake in mistakes:
        for sample in mistake.samples:
            try:
                parse(sample)
            except UnexpectedCharacters:
                continue
            except UnexpectedToken as error:
                marks.setdefault(_mark(error), mistake)
    return marks
