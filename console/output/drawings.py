"""Drawings as SVG: a conditional plan as a tree from left to right, and a matched description as a table."""

from typing import TYPE_CHECKING, Final

from dyknow.kpl.introspection.picture import NodeBox, layered_svg
from dyknow.kpl.introspection.svg import box, document, words

if TYPE_CHECKING:
    from dyknow.anchoring.matching.candidates import PropertyFinding
    from dyknow.anchoring.matching.situations import AnchoringSituation
    from dyknow.planning.contingent.conditional_plans import ConditionalPlan

_CHARACTER: Final = 7
_ROW: Final = 30
_GREEN, _RED = "#cfe8cf", "#f3c9c4"
_FILL: Final = {
    "agrees": _GREEN, "contradicts": _RED, "unobserved": "#e6e6e6", "graded": "#e3efc6",
    "complete": _GREEN, "partial": "#fbe9b7", "none": _RED,
    "success": _GREEN, "fail": _RED,
}  # fmt: skip
"""Of findings, of matches, of the ends of plans."""


def plan_svg(plan: "ConditionalPlan") -> str:
    """A plan: a box for the actions up to an observation, an arrow for each value that it may have."""
    boxes, edges = dict[str, NodeBox](), dict[tuple[str, str], str]()
    stack = [(plan, "", "")]
    while stack:
        part, parent, seen = stack.pop()
        name = str(len(boxes))
        lines = [" ".join((each.name, *each.arguments)) for each in part.actions] or [part.end or ""]
        boxes[name] = NodeBox(lines, _FILL.get(part.end or "", "#ffffff"))
        if parent:
            edges[parent, name] = seen
        stack.extend((rest, name, each.words) for each, rest in reversed(part.branches))
    return layered_svg(boxes, edges)


def situation_svg(situation: "AnchoringSituation") -> str:
    """A situation: a row for each percept, a box for each property of the description."""
    names = [each.name for each in situation.matches[0].findings] if situation.matches else []
    first = max((len(each.percept) for each in situation.matches), default=0) * _CHARACTER + 20
    wide = max((len(name) for name in [*names, "unobserved", "contradicts"]), default=0) * _CHARACTER + 16
    result = f"case {situation.case}: {situation.result}, {situation.recovery or 'no recovery'}"
    parts = [words(10, 20, result)]
    parts += [words(first + at * wide + 8, _ROW + 22, name) for at, name in enumerate(names)]
    for row, match in enumerate(situation.matches, start=1):
        y = 34 + row * _ROW
        parts.append(words(10, y + 18, match.percept))
        for column, (text, kind) in enumerate([*map(_finding, match.findings), (match.status, match.status)]):
            x = first + column * wide
            parts += [box(x, y, wide - 4, _ROW - 6, fill=_FILL[kind], corner=3), words(x + 6, y + 16, text)]
    return document(first + (len(names) + 1) * wide + 10, (len(situation.matches) + 1) * _ROW + 40, parts)


def _finding(finding: "PropertyFinding") -> tuple[str, str]:
    """Its text, and its kind."""
    if not finding.is_observed:
        return "unobserved", "unobserved"
    if 0.0 < finding.degree < 1.0:
        return f"{finding.degree:.2f}", "graded"
    kind = "agrees" if finding.degree >= 1.0 else "contradicts"
    return kind, kind
