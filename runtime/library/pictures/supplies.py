"""Supplies for persons on the saliency map: statements of a problem that give each box of a depot a person (thesis 7.1.2)."""

import re
from collections.abc import Sequence
from typing import Final, NamedTuple

from dyknow.model.errors import WrongCall, file_of
from dyknow.runtime.library.pictures.saliency import FoundPerson

STANDOFF_M: Final = 3.0
"""A box is put down so far to the south of a person."""
WEIGHT: Final = 1000
"""The weight of each goal: an unreachable one, whose UAV is gone, is left aside for the others."""
_OBJECTS = re.compile(r"#objects\s+box\s*=\s*([A-Za-z_-]+)(\d{1,9})\s*\.\.\s*\1(\d{1,9})(?!\d)")
_PLACES = re.compile(r"xpos\((\w+)\) := ([-\d.]+), ypos\(\1\) := ([-\d.]+)")
MOST_BOXES: Final = 200


class SupplyGoals(NamedTuple):
    """Statements to be given as `--constraints` of a mission.

    Attributes:
        given: by person, its box.
        unsupplied: persons for whom there is no box.
    """

    text: str
    given: dict[str, str]
    unsupplied: tuple[str, ...]


def supply_goals(persons: Sequence[FoundPerson], problem: str) -> SupplyGoals:
    """A box for each person, as long as there are boxes; persons that were observed longest come first. Other boxes stay.

    Args:
        persons: of the map.
        problem: names the boxes, `#objects box = b1 .. b11`.

    Raises:
        WrongCall: it does not.
    """
    match = _OBJECTS.search(problem)
    if match is None or not 0 <= int(match[3]) - int(match[2]) < MOST_BOXES:
        place = f"{file}: " if (file := file_of(problem)) else ""
        raise WrongCall(f"{place}the problem names no boxes; write #objects box = b1 .. b11")
    boxes = [f"{match[1]}{number}" for number in range(int(match[2]), int(match[3]) + 1)]
    ordered = sorted(persons, key=lambda each: (-len(each.by), -each.observed_s, each.name))
    pairs = list(zip(boxes, ordered, strict=False))
    lines = [
        f"#init goal-x({box}) := {each.x_m:.2f}, goal-y({box}) := {each.y_m - STANDOFF_M:.2f}  // {each.name}"
        for box, each in pairs
    ]
    stays = {box: match.groups() for match in _PLACES.finditer(problem) if (box := match[1]) in boxes[len(pairs) :]}
    lines += [f"#init goal-x({box}) := {x}, goal-y({box}) := {y}" for box, (_, x, y) in stays.items()]
    lines += [f"#goal brought-{box}: delivered({box}) :weight {WEIGHT}" for box, _ in pairs]
    given = {each.name: box for box, each in pairs}
    text = f"// Supplies for persons of the saliency map.\n{chr(10).join(lines)}\n"
    return SupplyGoals(text, given, tuple(each.name for each in ordered[len(pairs) :]))
