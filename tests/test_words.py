"""Prose in messages, docstrings and pages uses the field's words; `docs/glossary.md` says which."""

from collections import Counter

from tests import words

LIMIT = 60
"""How often words that the glossary replaces may still occur. It only falls."""


def test_riddles_only_become_fewer() -> None:
    found = list(words.places(words.ROOT, words.ROOMS))
    by_room = Counter(each.room for each in found).most_common()
    assert len(found) <= LIMIT, f"{len(found)} places, at most {LIMIT}: see `python -m tests.words ROOM`; {by_room}"
