"""Error messages for texts that do not parse: samples of mistakes teach the message.

Each sample is parsed once, at the first error; the state in which the parser stops, and the type of the token, become
the mark by which the same mistake is recognised. (lark's `match_examples` compares the depth of the parser's stack as
well, so that a sample would teach nothing about the same mistake within parentheses, and parses all samples again at
every error.) Words and operators of other languages are recognised by themselves.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from dyknow.kpl.diagnostics.languages import Language, Mistake, table
from dyknow.kpl.diagnostics.suggestions import (
    PAIRS,
    Diagnosis,
    ErrorContext,
    last_unclosed,
    suggest,
    suggest_constraint,
)
from dyknow.model.errors import TextError

if TYPE_CHECKING:
    from lark.exceptions import UnexpectedInput

_LOOK_BACK: Final = 64
_SHOWN: Final = 40

Mark: TypeAlias = tuple[int, str]
"""Where the parser stopped (its state) and on what (the type of the token)."""


def learn(parse: Callable[[str], Any], mistakes: Iterable[Mistake]) -> Mapping[Mark, Mistake]:
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


def explain(
    error: "UnexpectedInput", text: str, marks: Callable[[], Mapping[Mark, Mistake]], language: Language
) -> TextError:
    """The error with place, cause and repair; `marks` gives what `learn` made of the samples, if they are needed."""
    token = getattr(error, "token", None)
    stopped = str(getattr(error, "char", "") if token is None else token)
    if token is not None and token.type == "$END":
        stopped = ""
    offset = len(text) if error.pos_in_stream is None or error.pos_in_stream < 0 else error.pos_in_stream
    offset = min(offset, len(text)) if stopped else len(text.rstrip())
    message, repair, offset, width = _diagnose(error, text, offset, stopped, marks, language)
    return TextError.at_offset(text, offset, message, width=width, repair=repair)


def _field_after_objects(text: str, offset: int, stopped: str) -> Diagnosis | None:
    """`pos[car1].north_m`, as other languages write the field of a record."""
    label = re.search(r"([\w-]+)(\[[^\[\]\n]*\])$", text[:offset])
    field = re.match(r"\.[A-Za-z_]\w*", text[offset:])
    if stopped != "." or label is None or field is None:
        return None
    repair = f"{label[1]}{field[0]}{label[2]}"
    return Diagnosis("the field of a record stands before its objects", repair, label.start(), len(repair))


def _diagnose(
    error: "UnexpectedInput",
    text: str,
    offset: int,
    stopped: str,
    marks: Callable[[], Mapping[Mark, Mistake]],
    language: Language,
) -> Diagnosis:
    """The most particular diagnosis of the token at which the parser stopped; "" is the end of the text."""
    if not text.strip():
        return Diagnosis(*language.empty, 0, 1)
    diagnosis = (
        _misspelt(text, offset, stopped, language)
        or _unfinished(text, offset, stopped)
        or _field_after_objects(text, offset, stopped)
    )
    if diagnosis is not None:
        return diagnosis
    wanted = set(
        getattr(error, "accepts", None) or getattr(error, "expected", None) or getattr(error, "allowed", None) or ()
    )
    context = ErrorContext.of(text, offset, stopped, wanted)
    form, has_suggestions = "", language.has_suggestions
    if has_suggestions:
        form = context.form if context.statement else language.empty[1]
    if getattr(error, "token", None) is None:
        return context.diagnosis(f"`{stopped}` has no meaning here", form)
    if has_suggestions and (diagnosis := suggest(context)):
        return diagnosis
    if mistake := marks().get(_mark(error)):
        line = text[text.rfind("\n", 0, offset) + 1 :].partition("\n")[0]
        return context.diagnosis(mistake.message, mistake.repaired(line))
    if has_suggestions and (diagnosis := suggest_constraint(context)):
        return diagnosis
    begins_line = not text[text.rfind("\n", 0, offset) + 1 : offset].strip()
    can_be_word = stopped.upper() in language.keywords and (begins_line or not wanted.isdisjoint(language.keywords))
    if stopped in language.reserved and "NAME" in wanted and not can_be_word:
        return context.diagnosis(f"`{stopped}` is a reserved word and cannot be a name", f"{stopped}_")
    shown = stopped if len(stopped) <= _SHOWN else f"{stopped[:_SHOWN]}..."
    what = f"found `{shown}`" if stopped else "the text ends"
    expected = ", ".join(_expected(wanted, language)) or "something else"
    return context.diagnosis(f"expected {expected}; {what}", form)


def _misspelt(text: str, offset: int, stopped: str, language: Language) -> Diagnosis | None:
    """An operator or a word of another language, here or just before."""
    foreign = _foreign(text, offset, stopped, language.operators)
    if foreign is not None:
        start, theirs = foreign
        return Diagnosis(f"`{theirs}` is not written here", language.operators[theirs], start, len(theirs))
    before = re.search(r"([A-Za-z_]+)\s*\Z", text[max(0, offset - _LOOK_BACK) : offset])
    for word, start in ((stopped, offset), (before[1], offset - len(before[0])) if before else ("", 0)):
        ours = language.words.get(word.lower())
        if ours is None and word != word.lower() and word.upper() in language.keywords:
            ours = word.lower()
        if ours is not None:
            return Diagnosis(f"`{word}` is not written here", ours, start, len(word))
    return None


def _unfinished(text: str, offset: int, stopped: str) -> Diagnosis | None:
    """A bracket or a string that is never closed."""
    if stopped == '"':
        return Diagnosis("this string is never closed", '"text" on one line', offset, 1)
    opened = last_unclosed(text) if stopped == "" else None
    if opened is None:
        return None
    closing = PAIRS[text[opened]]
    return Diagnosis(f"this `{text[opened]}` is never closed", f"{closing} where it ends", opened, 1)


def _foreign(text: str, offset: int, stopped: str, operators: Mapping[str, str]) -> tuple[int, str] | None:
    """An operator of another language at, or begun just before, the offset; it does not begin a token of ours."""
    for start in (offset, offset - 1):
        for length in (2, 1):
            theirs = text[max(0, start) : start + length]
            is_beginning = start == offset and length < len(stopped)
            if theirs in operators and start + len(theirs) > offset and not is_beginning:
                return start, theirs
    return None


def _expected(wanted: set[str], language: Language) -> list[str]:
    """The terminals that could have stood there, in words: names once, operators together."""
    terminals = table("terminals")
    for group in language.groups:
        if group.needed <= wanted:
            return [group.word, *(words for name, words in terminals.items() if name in wanted & group.others)]
    words = [word for name, word in terminals.items() if name in wanted]
    keywords = language.keywords
    if language.has_suggestions and "NAME" not in wanted:
        if {"SOURCE", "$END"} <= wanted:
            wanted = wanted - {name.upper() for name in table("suggestions")["forms"]}
            words[words.index("the end")] = "the next statement"
        keywords = tuple(sorted(wanted - terminals.keys()))
    return words + [f"`{name.lower()}`" for name in keywords if name in wanted]


def _mark(error: "UnexpectedInput") -> Mark:
    state, token = getattr(error, "state", None), getattr(error, "token", None)
    return (getattr(state, "position", -1), "" if token is None else token.type)
