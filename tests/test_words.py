"""Prose in messages, docstrings and pages uses the field's words; `docs/glossary.md` says which."""

from collections import Counter

from tests import words

LIMIT = 51
"""How often words that the glossary replaces may still occur. It only falls."""
HEADLESS = {
    "ARCHITECTURE.md": 7,
    "anchoring": 8,
    "compunits": 1,
    "console": 13,
    "docs": 6,
    "dyknow": 5,
    "federation": 2,
    "kpl": 10,
    "planning": 15,
    "proxies": 3,
    "runtime": 11,
}
"""How many relative clauses without a noun each room may still have. The numbers only fall."""


def test_riddles_only_become_fewer() -> None:
    found = list(words.places(words.ROOT, words.ROOMS))
    by_room = Counter(each.room for each in found).most_common()
    assert len(found) <= LIMIT, f"{len(found)} places, at most {LIMIT}: see `python -m tests.words ROOM`; {by_room}"


def test_headless_clauses_only_become_fewer() -> None:
    counts = Counter(each.room for each in words.headless(words.ROOT, words.ROOMS))
    more = {room: (count, HEADLESS.get(room, 0)) for room, count in counts.items() if count > HEADLESS.get(room, 0)}
    assert not more, f"(now, at most) by room, see `python -m tests.words --headless ROOM`: {more}"


def test_headless_clauses_are_counted_where_a_noun_is_expected() -> None:
    text = "What it made is kept, and of what is left those that fit. Who says what is wrong? Ask what to do; those that do."
    assert [text[start:end] for start, end in words.headless_spans(text)] == ["What", "what is", "those that"]
    assert not list(words.headless_spans("The value `what is`; the platform that sent it. What follows?"))
