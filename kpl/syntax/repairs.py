"""Repairs of statements that leave the grammar, tried before they are shown: each one can be read."""

from typing import Final

from dyknow.kpl.diagnostics.rewrites import rewritten
from dyknow.kpl.syntax.grammar import parse_tree
from dyknow.model.errors import TextError

MOST_REPAIRED: Final = 8
"""Errors of a text for which a repair is looked for; it takes some parsing."""


def repaired(wrong: TextError, statement: str) -> TextError:
    """The error of a statement with a repair that mends it, where its own does not and one is found: the whole line."""
    lines = statement.split("\n")
    at, left = wrong.line - 1, wrong.column - 1
    if not 0 <= at < len(lines) or wrong.repair.startswith("nothing: "):
        return wrong
    line = lines[at]
    rest = line[left + wrong.width :]
    is_joined = wrong.repair[-1:].isalnum() and rest[:1].isalnum()
    with_own = line[:left] + wrong.repair + rest
    if not is_joined and _can_be_read("\n".join([*lines[:at], with_own, *lines[at + 1 :]])):
        return wrong
    offset = sum(len(each) + 1 for each in lines[:at]) + left
    found = rewritten(statement, offset, _can_be_read)
    changed = found.split("\n")
    if not found or len(changed) != len(lines) or [i for i, each in enumerate(lines) if each != changed[i]] != [at]:
        return wrong
    return wrong.but(repair=changed[at].strip())


def _can_be_read(statement: str) -> bool:
    try:
        parse_tree(statement, "start")
    except TextError:
        return False
    return True
