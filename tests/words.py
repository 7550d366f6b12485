"""Counts words and clauses that make prose a riddle for users and for readers of the code.

    python -m tests.words                 # how often, by room
    python -m tests.words agents kpl/running   # each place in these folders, with what to say instead
    python -m tests.words --headless kpl  # the same for relative clauses without a noun

Counted are docstrings, messages (literals of more than one word) and pages; `docs/glossary.md` has the reasons.
A headless clause is a relative clause where a noun is expected ("What is there ...", "those that ...", "of what is ..."):
counted in comments, too, but not in questions, code and changelog fragments.
"""

import ast
import io
import re
import sys
import tokenize
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
ROOMS = tuple(
    path.parent.name for path in sorted(ROOT.glob("*/__init__.py")) if path.parent.name not in {"tests", "bench"}
)
PAGES = ("README.md", "ARCHITECTURE.md", "CHANGELOG.md", "docs", "changelog.d")
GLOSSARY = "docs/glossary.md"
"""Names the words it replaces; not counted."""

INSTEAD = {
    r"\b(?:nobody|somebody|anybody)\b": "name the role: user, requester, producer, subscriber",
    r"\bpeople\b": "users, readers",
    r"\bwho\b|\bwhoever\b|\bof whom\b": "name the role: platform, requester, owner",
    r"\btold\b": "notified, reported",
    r"\btells? why not\b": "sends a refusal",
    r"\bsaid\b(?![:`])": "message, content, reported",
    r"\bsays? nothing\b": "sends nothing, is irrelevant to",
    r"(?<!what is )\b(?:goes|go|going|went|gone) on\b": "continues",
    r"\banew\b|\bafresh\b": "again, restarts",
    r"\bso many\b": "the number, `count`, a limit of",
    r"(?-i:\bbeside\b|\bBeside(?= \w))": "next to, compared with",
    r"\bof which\b": "name the thing, whose",
    r"\bany ?more\b": "no longer",
    r"\bwhat (?:is|was) left\b": "the remainder, the rest",
    r"\bheirs?\b|\bleads? on\b": "successor, takes over",
    r"\borphan\w*": "abandoned tasks",
    r"\brous(?:e|ed|es|ing)\b|\b(?:it|that|which|streams?) rests?\b|\bresting\b": "activated, dormant",
    r"\bcomplaints?\b|\bsuspicio\w+|\bremarks?\b|\bguess(?:es)?\b": "errors, warnings, lint, suggestions",
    r"\bletters?\b(?![:`]|,? (?:and )?digits)": "truth assignment",
    r"\bcolumns\b": "vectorised atoms, arrays",
    r"\bshapes?\b": "skeleton (of a formula), form",
    r"\b(?:fell|falls?|fallen|falling) silent\b|\bmissed\b": "timed out, missing, lost",
    r"\bbur(?:y|ied|ies)\b|\brevive[sd]?\b": "tombstone, clear the tombstone",
    r"\bnamesakes?\b|\btwins?\b": "duplicate unit",
    r"\bmishaps?\b": "fault schedule",
    r"\btimetable\b": "deadlines",
    r"\bbulletin\b": "queries and subscriptions",
    r"\bsurroundings\b": "ports",
    r"\baccounts?\b": "audit log",
    r"\bas they pass\b": "message log",
    r"\baskers?\b|\basked\b(?! for\b)": "requester, recipient, requested",
    r"\bdoubt\w*": "suspect",
    r"\bled\b": "coordinated",
    r"\bown streams?\b": "vehicle streams",
    r"\bstartable\b": "restartable",
    r"\bsupply\b|\bwakes?\b": "subscription keeper, retry",
    r"\btokens? (?:went|goes|is gone)\b": "token withdrawn",
    r"\binquir\w+|\bbrought forth\b": "checks, produced",
}
_WORDS = re.compile(rf"\b(?:{'|'.join(f'(?P<w{n}>{words})' for n, words in enumerate(INSTEAD))})", re.IGNORECASE)
_SAY = list(INSTEAD.values())
_BEGINS = r"(?:\A\s*|[.:;!?|]\s+|\n\s*\n\s*|\n\s*[-*]\s+)(?:(?:of|in|for|to|by|with|from|and|but)\s+)?"
_HEADS = (
    r"(?:what(?:ever)?(?!\s+(?:to|if|kinds?|sorts?|else|times?|values?|units?)\b)|that\s+which"
    r"|(?:those|all|ones?|everything|nothing|none)\s+(?:that|which|whose|who))(?=\s+[\w`])"
)
_BEFORE = (
    "of|from|for|to|with|by|than|in|on|at|as|about|after|before|without|besides|against|behind|beyond|near|and|or|like"
)
_VERBS = (
    "is|was|were|are|has|had|have|can|cannot|could|may|might|must|will|would|should|does|did|do|comes?|came|makes?|made"
    "|needs?|depends|happens|happened|remains|follows|begins?|ends?|holds|takes|gives|stands|lies|says"
)
_SUBJECTS = (
    "it|they|there|this|that|these|those|each|one|another|others?|both|an?|the|its|their|all|no|none|nothing|any|some"
)
_HEADLESS = re.compile(
    rf"{_BEGINS}(?P<head>{_HEADS})|\b(?:{_BEFORE})\s+(?P<object>what\s+(?:{_VERBS}|{_SUBJECTS})\b)", re.IGNORECASE
)
_CODE = re.compile(r"```.*?```|`[^`\n]*`", re.DOTALL)
_STOP = re.compile(r"[.!?](?=\s|$)|\n\s*\n|\Z")


class Place(NamedTuple):
    room: str
    path: str
    line: int
    word: str
    instead: str
    excerpt: str


def places(root: Path, rooms: Iterable[str]) -> Iterator[Place]:
    """Every place in the rooms and pages below `root` where one of the words occurs."""
    for path, line, text in _texts(root, rooms):
        name = path.relative_to(root).as_posix()
        room = name.split("/", maxsplit=1)[0]
        for match in _WORDS.finditer(text):
            at = line + text.count("\n", 0, match.start())
            excerpt = " ".join(text[max(0, match.start() - 40) : match.end() + 40].split())
            yield Place(room, name, at, match[0], _SAY[int((match.lastgroup or "w0")[1:])], excerpt)


def headless(root: Path, rooms: Iterable[str]) -> Iterator[Place]:
    """Every relative clause without a noun in the rooms and pages below `root`, changelog fragments left out."""
    for path, line, text in (*_texts(root, rooms), *_comments(root, rooms)):
        name = path.relative_to(root).as_posix()
        room = name.split("/", maxsplit=1)[0]
        if room in {"changelog.d", "CHANGELOG.md"}:
            continue
        for start, end in headless_spans(text):
            excerpt = " ".join(text[max(0, start - 40) : end + 40].split())
            yield Place(room, name, line + text.count("\n", 0, start), text[start:end], "a noun and a verb", excerpt)


def headless_spans(text: str) -> Iterator[tuple[int, int]]:
    """Where headless clauses begin in a text; code in it and questions are passed over."""
    plain = _CODE.sub(lambda code: re.sub(r"[^`\n]", "x", code[0]), text)
    for match in _HEADLESS.finditer(plain):
        stop = _STOP.search(plain, match.end())
        if not stop or stop[0] != "?":
            yield match.span(match.lastgroup or 0)


def _comments(root: Path, rooms: Iterable[str]) -> Iterator[tuple[Path, int, str]]:
    for room in rooms:
        for path in sorted((root / room).rglob("*.py")):
            for token in tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline):
                if token.type == tokenize.COMMENT:
                    yield path, token.start[0], token.string.lstrip("# ")


def _texts(root: Path, rooms: Iterable[str]) -> Iterator[tuple[Path, int, str]]:
    for room in rooms:
        for path in sorted((root / room).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Constant) and isinstance(node.value, str) and len(node.value.split()) > 1:
                    yield path, node.lineno, node.value
    for page in PAGES:
        for path in sorted((root / page).rglob("*.md")) if (root / page).is_dir() else [root / page]:
            if path.exists() and path.relative_to(root).as_posix() != GLOSSARY:
                yield path, 1, path.read_text(encoding="utf-8")


def main() -> None:
    wants_headless = "--headless" in sys.argv
    every = list((headless if wants_headless else places)(ROOT, ROOMS))
    for each in every:
        if any(each.path.startswith(wanted.rstrip("/")) for wanted in sys.argv[1:]):
            print(f"{each.path}:{each.line}: {each.word!r}: {each.instead}\n    {each.excerpt}")
    for room, count in Counter(each.room for each in every).most_common():
        print(f"{count:5} {room}")
    print(f"{len(every):5} in all")


if __name__ == "__main__":
    main()
