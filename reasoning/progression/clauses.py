"""The remainder of a formula as a conjunction of disjunctions of obligations, in a form as small as the laws allow.

An obligation is one temporal operator over the states of one window. Obligations of one operator are ordered by their
windows: the longer `always` says more, the longer `eventually` less. A clause keeps its weakest obligations, a
conjunction its strongest clauses, and windows of one operator that overlap become one (7.5.2, 7.10: simplification and
subsumption). All of these hold in Kleene's logic, so that no verdict comes earlier or later by them.

Where distributing a disjunction over conjunctions would cost more than it saves, its parts stay `Block`s.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from math import prod
from typing import Any, Final, TypeAlias

Obligation: TypeAlias = tuple[int, int, int]
"""(operator, from, to): microseconds in whatever frame its owner keeps. Odd operators are universal: the longer says
more. Even ones are existential."""


@dataclass(frozen=True, slots=True)
class Block:
    """A conjunction that stands inside a clause as it is."""

    clauses: "Clauses"


@dataclass(frozen=True, slots=True)
class Grown:
    """A growing quantifier under way: its number, and the remainder for each member that it has met."""

    number: int
    members: tuple[tuple[str, Any], ...]


Literal: TypeAlias = Obligation | Block
"""Or `Grown`, which nothing but progression looks into."""
Clause: TypeAlias = frozenset[Literal]
Clauses: TypeAlias = frozenset[Clause]

OPEN: Final = -(1 << 80)
"""`from` of a window in which every later state lies until its end."""
FOREVER: Final = 1 << 80
"""`to` of a window without end."""
NEVER: Final[Clause] = frozenset()
_UNKNOWN_OBLIGATION: Final[Obligation] = (-2, OPEN, FOREVER)
TRUE: Final[Clauses] = frozenset()
FALSE: Final[Clauses] = frozenset({NEVER})
UNKNOWN: Final[Clauses] = frozenset({frozenset({_UNKNOWN_OBLIGATION})})
"""Undecided for ever: an atom over `no_value`."""
DECIDED: Final = frozenset((TRUE, FALSE, UNKNOWN))
LIMIT_PRODUCT: Final = 64
"""A disjunction that would be distributed into more clauses than this keeps blocks; so does one of several disjunctions
that together would come to more."""
UNKNOWN_NUMBER: Final = _UNKNOWN_OBLIGATION[0]
_FEW: Final = 16
"""Up to this number clauses are compared pairwise."""


def alone(operator: int, from_us: int, to_us: int) -> Clauses:
    """One obligation."""
    return frozenset((frozenset(((operator, from_us, to_us),)),))


def conjoin(parts: Iterable[Clauses]) -> Clauses:
    """All of them: the strongest clauses."""
    first, *others = [part for part in dict.fromkeys(parts) if part] or [TRUE]
    if not others:
        return first
    every = first.union(*others)
    return FALSE if NEVER in every else _strongest(every)


def disjoin(parts: Iterable[Clauses], limit: int = LIMIT_PRODUCT) -> Clauses:
    """One of them at least; distributed if that makes no more than `limit` clauses."""
    found = [part for part in dict.fromkeys(parts) if part != FALSE]
    if len(found) == 1:
        return found[0]
    if any(not part for part in found):
        return TRUE
    single: set[Literal] = set()
    several: list[Clauses] = []
    for part in found:
        if len(part) == 1:
            single.update(next(iter(part)))
        else:
            several.append(part)
    clause = _weakest(single)
    if prod(map(len, several)) > limit:
        return frozenset((clause.union(map(Block, several)),))
    result: Clauses = frozenset((clause,))
    for part in sorted(several, key=len):
        result = _strongest(frozenset([_weakest({*one, *other}) for one in part for other in result]))
    return result


def _weakest(literals: set[Literal]) -> Clause:
    """A clause without what implies something else in it; overlapping windows of an existential operator are one."""
    if len(literals) > 1:
        windows = sorted([one for one in literals if isinstance(one, tuple)])
        kept: list[Literal] = [one for one in literals if one.__class__ is not tuple]
        at, last = 0, len(windows)
        while at < last:
            operator, begin = windows[at][0], at
            while at < last and windows[at][0] == operator:
                at += 1
            kept += _least(windows[begin:at]) if operator & 1 else merged(windows[begin:at])
        return frozenset(kept)
    return frozenset(literals)


def merged(windows: list[Obligation]) -> list[Obligation]:
    """Windows of one operator, in order: windows that overlap or touch become one."""
    operator, from_us, to_us = windows[0]
    kept: list[Obligation] = []
    for _, begin, end in windows[1:]:
        if begin <= to_us + 1:
            to_us = max(to_us, end)
        else:
            kept.append((operator, from_us, to_us))
            from_us, to_us = begin, end
    kept.append((operator, from_us, to_us))
    return kept


def _least(windows: list[Obligation]) -> list[Obligation]:
    """Of windows in order those that contain no other one."""
    kept: list[Obligation] = []
    end = FOREVER + 1
    for one in reversed(windows):  # later beginnings first; of equal ones the longer first
        if kept and kept[-1][1] == one[1] and one[2] < kept[-1][2]:
            kept.pop()
            end = kept[-1][2] if kept else FOREVER + 1
        if one[2] < end:
            kept.append(one)
            end = one[2]
    return kept


def _strongest(clauses: Clauses) -> Clauses:
    """The clauses that no other one implies; clauses that differ in one universal window are joined."""
    if len(clauses) < 2:
        return clauses
    kept: list[Clause] = []
    if len(clauses) > _FEW:
        kept = _strongest_of_many(clauses)
    else:
        for clause in sorted(clauses, key=len):
            if any(implies(one, clause) for one in kept):
                continue
            kept = [one for one in kept if len(one) != len(clause) or not implies(clause, one)]
            kept.append(clause)
    return frozenset(kept) if len(kept) < 2 else _joined(kept)


def _strongest_of_many(clauses: Clauses) -> list[Clause]:
    """The same for many clauses, without comparing all pairs: only clauses about operators of a clause can imply it.

    Each is kept under one of its operators, the greatest, so that an uncertainty that many share gathers none of them.
    """
    about: dict[object, dict[Clause, object]] = {}
    for clause in sorted(clauses, key=len):
        numbers = {one[0] for one in clause if isinstance(one, tuple)}
        subjects: list[object] = [*numbers, *(one for one in clause if not isinstance(one, tuple))]
        near = [one for subject in subjects for one in about.get(subject, ())]
        if any(implies(one, clause) for one in near):
            continue
        for one in near:
            if len(one) == len(clause) and implies(clause, one):
                for subject in subjects:
                    about.get(subject, {}).pop(one, None)
        about.setdefault(max(numbers) if numbers else subjects[0], {})[clause] = None
    return [one for those in about.values() for one in those]


def implies(one: Clause, other: Clause) -> bool:
    """Whether every way to satisfy `one` satisfies `other`."""
    if one <= other:
        return True
    return all(literal in other or _is_stronger(literal, other) for literal in one)


def _is_stronger(literal: Literal, clause: Clause) -> bool:
    """Whether an obligation implies one of the clause, by their windows."""
    if literal.__class__ is not tuple:
        return False
    operator, from_us, to_us = literal
    for other in clause:
        if other.__class__ is not tuple or other[0] != operator:
            continue
        _, begin, end = other
        if (from_us <= begin and to_us >= end) if operator & 1 else (begin <= from_us and end >= to_us):
            return True
    return False


def _joined(clauses: list[Clause]) -> Clauses:
    """Join clauses that differ in one universal window only, if these windows overlap."""
    groups: dict[tuple[int, Clause], list[Obligation]] = {}
    kept: list[Clause] = []
    for clause in clauses:
        universal = [one for one in clause if one.__class__ is tuple and one[0] & 1]
        if len(universal) != 1:
            kept.append(clause)
            continue
        groups.setdefault((universal[0][0], clause.difference(universal)), []).append(universal[0])
    for (_, rest), windows in groups.items():
        kept += [rest | {one} for one in (merged(sorted(windows)) if len(windows) > 1 else windows)]
    return frozenset(kept)


def size(clauses: Clauses) -> int:
    """The number of obligations, with those inside blocks and members."""
    return sum(_size(one) for clause in clauses for one in clause)


def _size(one: Any) -> int:
    if isinstance(one, Block):
        return size(one.clauses)
    if isinstance(one, Grown):
        remainders = (getattr(left, "clauses", left) for _, left in one.members)
        return sum(size(left) if isinstance(left, frozenset) else 1 for left in remainders)
    return 1
