"""Drawings as SVG: a conditional plan as a tree from left to right, and a matched description as a table."""

from collections.abc import Iterator
from html import escape
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from anchoring.matching.situations import AnchoringSituation
    from planning.contingent.conditional_plans import ConditionalPlan

_LINE: Final = 16
_CHARACTER: Final = 7
_ROW: Final = 30
_FILL: Final = {"agrees": "#cfe8cf", "contradicts": "#f3c9c4", "unobserved": "#e6e6e6", "graded": "#e3efc6"}
_STATUS: Final = {"complete": "#cfe8cf", "partial": "#fbe9b7", "none": "#f3c9c4"}


def plan_svg(plan: "ConditionalPlan") -> Iterator[str]:
    """A plan: a box for the actions up to an observation, an arrow for each value that it may have."""
    parts: list[tuple[ConditionalPlan, int, int, str]] = []
    stack: list[tuple[ConditionalPlan, int, int, str]] = [(plan, -1, 0, "")]
    while stack:
        part, parent, depth, seen = stack.pop()
        number = len(parts)
        parts.append((part, parent, depth, seen))
        stack.extend((rest, number, depth + 1, each.words) for each, rest in reversed(part.branches))
    boxes = [_box(part) for part, *_ in parts]
    middle = _middles(parts, [len(box) for box in boxes])
    widths = dict[int, int]()
    for (_, _, depth, _), box in zip(parts, boxes, strict=True):
        widths[depth] = max(widths.get(depth, 0), *(len(line) * _CHARACTER + 16 for line in box))
    label = max((len(seen) for *_, seen in parts), default=0) * _CHARACTER + 24
    left = dict[int, int]()
    for depth in sorted(widths):
        left[depth] = 10 if depth == 0 else left[depth - 1] + widths[depth - 1] + label
    high = round(max(at + len(box) * _LINE for at, box in zip(middle, boxes, strict=True))) + 10
    yield _head(max(left[depth] + widths[depth] for depth in widths) + 10, high)
    for number, (part, parent, depth, seen) in enumerate(parts):
        x, y, tall = left[depth], middle[number], len(boxes[number]) * _LINE + 8
        if parent >= 0:
            start = left[depth - 1] + widths[depth - 1]
            yield f'<path d="M{start} {middle[parent]:g} C{start + 30} {middle[parent]:g} {x - 40} {y:g} {x} {y:g}"/>'
            yield f'<text x="{x - 8}" y="{y + (14 if y > middle[parent] else -5):g}" text-anchor="end">{escape(seen)}</text>'
        fill = {"success": "#cfe8cf", "fail": "#f3c9c4"}.get(part.end or "", "#ffffff")
        yield f'<rect x="{x}" y="{y - tall / 2:g}" width="{widths[depth]}" height="{tall}" rx="4" fill="{fill}"/>'
        for line, text in enumerate(boxes[number]):
            yield f'<text x="{x + 8}" y="{y - tall / 2 + 16 + line * _LINE:g}">{escape(text)}</text>'
    yield "</svg>"


def situation_svg(situation: "AnchoringSituation") -> Iterator[str]:
    """A situation: a row for each percept, a box for each property of the description."""
    names = [each.name for each in situation.matches[0].findings] if situation.matches else []
    first = max((len(each.percept) for each in situation.matches), default=0) * _CHARACTER + 20
    wide = max((len(name) for name in [*names, "unobserved", "contradicts"]), default=0) * _CHARACTER + 16
    yield _head(first + (len(names) + 1) * wide + 10, (len(situation.matches) + 1) * _ROW + 40)
    yield f'<text x="10" y="20">case {situation.case}: {situation.result}, {situation.recovery or "no recovery"}</text>'
    for column, name in enumerate(names):
        yield f'<text x="{first + column * wide + 8}" y="{_ROW + 22}">{escape(name)}</text>'
    for row, match in enumerate(situation.matches, start=1):
        y = 34 + row * _ROW
        yield f'<text x="10" y="{y + 18}">{escape(match.percept)}</text>'
        for column, finding in enumerate(match.findings):
            kind = (
                "unobserved" if not finding.is_observed
                else "contradicts" if finding.degree <= 0.0
                else "agrees" if finding.degree == 1.0
                else "graded"
            )  # fmt: skip
            yield _cell(
                first + column * wide, y, wide, kind if kind != "graded" else f"{finding.degree:.2f}", _FILL[kind]
            )
        yield _cell(first + len(names) * wide, y, wide, match.status, _STATUS[match.status])
    yield "</svg>"


def _box(part: "ConditionalPlan") -> list[str]:
    words = [" ".join((each.name, *each.arguments)) for each in part.actions]
    return words or [part.end or ""]


def _middles(parts: "list[tuple[ConditionalPlan, int, int, str]]", lines: list[int]) -> list[float]:
    """The height at which each box is centred: leaves one below the other, the others between their branches."""
    first, last, below = [-1.0] * len(parts), [-1.0] * len(parts), 10.0
    found = [0.0] * len(parts)
    for number, (part, *_) in enumerate(parts):
        if not part.branches:
            found[number] = below + lines[number] * _LINE / 2 + 8
            below += lines[number] * _LINE + 28
    for number in range(len(parts) - 1, -1, -1):
        if parts[number][0].branches:
            found[number] = (first[number] + last[number]) / 2
        parent = parts[number][1]
        if parent >= 0:
            first[parent] = found[number]
            last[parent] = found[number] if last[parent] < 0 else last[parent]
    return found


def _head(wide: int, high: int) -> str:
    style = 'font-family="monospace" font-size="12" fill="none" stroke="#555555"'
    rule = "<style>text{fill:#222222;stroke:none}</style>"
    return f'<svg xmlns="http://www.w3.org/2000/svg" width="{wide}" height="{high}" {style}>{rule}'


def _cell(x: int, y: int, wide: int, text: str, fill: str) -> str:
    box = f'<rect x="{x}" y="{y}" width="{wide - 4}" height="{_ROW - 6}" rx="3" fill="{fill}"/>'
    return f'{box}<text x="{x + 6}" y="{y + 16}">{escape(text)}</text>'
