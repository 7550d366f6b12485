"""Repairs of statements that leave the grammar: the statement as it was meant, if one change makes it one that can be read.

A change is tried only where the text is short, and the first after which the statement can be read is taken.
"""

import re
from collections.abc import Callable, Iterator
from difflib import get_close_matches
from typing import Final

from dyknow.kpl.diagnostics.languages import table

LONGEST: Final = 400
"""Characters of a statement that is tried to be repaired."""
_FAR: Final = 3
"""Words before the place of an error that may be the misspelt one."""
_CUTOFF: Final = 0.7
_SHORTEST: Final = 4
"""Shorter words are near too many."""
_WORD: Final = re.compile(r'"[^"\n]*"|[A-Za-z_][\w-]*')
_KEYWORDS: Final = (
    "always", "eventually", "until", "forall", "exists", "not", "and", "or", "since", "occurred", "growing",
    "with", "sample", "every", "max", "delay", "age", "use", "most", "recent", "linear", "any", "update", "change", "order",
    "strict", "monotone", "from", "to", "min", "certainty", "importance", "deviation", "in", "as", "state", "select", "merge",
    "link", "composite", "file", "first", "of", "close", "after", "value", "skip",
)  # fmt: skip
_TIME: Final = r"us|ms|s|min|h"
_HEAD: Final = r"^(\s*(?:monitor|stream|strmgen|define)\s+[\w-]+(?:\[[^\]\n]*\])?)"
_CHANGES: Final = tuple(
    (re.compile(pattern), change)
    for pattern, change in (
        (r"&&", "and"),
        (r"\|\|", "or"),
        (r"=<", "<="),
        (r"(?<=[\w\]]) *=>", " >="),
        (r"!\s*(?==)|(?<![=<>!])==", "="),
        (r"!\s*(?=\w)", "not "),
        (_HEAD + r"\s*(?::=|:|==)", r"\1 ="),
        (_HEAD + r"\s+(?![=\s:])", r"\1 = "),
        (rf"(\d)\s+({_TIME})\b", r"\1\2"),
        (r"\[\s*([\w.]+)\s+([\w.]+)\s*\]", r"[\1, \2]"),
        (r"\((\s*(?:0|\d[\w.]*)\s*,\s*\w+\s*)[)\]]", r"[\1]"),
        (r"\[(\s*(?:0|\d[\w.]*)\s*,\s*\w+\s*)\)", r"[\1]"),
        (r"\bfor\s+all\b", "forall"),
        (r"\b(for|forall|exists)(\s+\w+\s+)of\b", r"\1\2in"),
        (r"\b((?:forall|exists)\s+\w+\s+in\s+[\w.]+)\s+(?=\w)", r"\1: "),
        (r"\b([a-z][\w.-]*)\(\s*([\w-]+(?:\s*,\s*[\w-]+)*)\s*\)", r"\1[\2]"),
        (r"(?m)=\s*([A-Z]\w*)[\[{](.+)[\]}][ \t]*$", r"= \1(\2)"),
        (r"\{(\s*[\w-]+(?:\s*,\s*[\w-]+)*\s*)\}", r"[\1]"),
        (r"\bin\s+\[(\s*[\w-]+(?:\s*,\s*[\w-]+)*\s*)\]", r"in {\1}"),
        (r"\(([^\s(),]+)\s+([^\s(),]+)\)", r"(\1, \2)"),
        (r"\b(chronicle\s+file\s+)([\w./-]+)", r'\1"\2"'),
        (r"\b(chronicle\s+)(?!file)\"?([\w./-]+)\"?", r'\1file "\2"'),
        (r"'", '"'),
        (r"(\bwith\b.*?[\w.])\s+and\s+(?=sample|max|min|use|from|any|strict|no\b)", r"\1, "),
        (r"(\bwith\b.*?[\w.])\s+(?=(?:sample every|max delay|max age|use|min certainty|any|strict) )", r"\1, "),
        (r"(\bwith\s+[^\n]*?)\bdelay(?=\s+\d)", r"\1max delay"),
        (r"\s+with\s+\(([^()\n]*)\)", r" with \1"),
        (r"(?m)[;,][ \t]*$", ""),
        (r",\s*(?=with\b|[)\]}])", " "),
    )
)


def rewritten(statement: str, offset: int, can_be_read: Callable[[str], bool]) -> str:
    """The statement with one change after which it can be read; empty if there is none, or it is long.

    `offset` is where reading stopped.
    """
    if len(statement) > LONGEST:
        return ""
    tried = {statement}
    for each in _changed(statement, offset):
        if each not in tried:
            tried.add(each)
            if can_be_read(each):
                return each
    return ""


def _changed(statement: str, offset: int) -> Iterator[str]:
    words = [each for each in _WORD.finditer(statement) if not each[0].startswith('"')]
    before = [each for each in words if each.start() < offset][-_FAR:]
    at = [each for each in words if each.start() >= offset][:1]
    for each in (*at, *reversed(before)):
        yield from _respelt(statement, each)
    for pattern, change in _CHANGES:
        found = pattern.search(statement)
        if found is not None:
            yield pattern.sub(change, statement, count=1)
            yield pattern.sub(change, statement)


def _respelt(statement: str, word: re.Match[str]) -> Iterator[str]:
    """With a word of the language in place of one that is nearly it."""
    text = word[0]
    if text in _KEYWORDS or len(text) < _SHORTEST:
        return
    begins = not statement[: word.start()].strip()
    known = tuple(table("suggestions")["forms"]) if begins else _KEYWORDS
    near = (text.lower(),) if text.lower() in known else get_close_matches(text.lower(), known, 3, _CUTOFF)
    for each in near:
        yield statement[: word.start()] + each + statement[word.end() :]
