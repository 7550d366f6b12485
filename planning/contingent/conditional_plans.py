"""Conditional plans: sequences of actions, after which what was observed decides how it continues.

    ((move r1_2) (look-at po-4)
     (cond
      ((mark! po-4 = f) (anchor b1 f) :success)
      ((mark! po-4 = t) (anchor b1 po-4) :success)))

`lines` prints them as "Have another look" does, section 4.2. Nothing here recurses: plans may be thousands of looks deep.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, Literal, NamedTuple, TypeAlias

NONE: Final = "f"
"""The answer that it is none of the objects, or none of the places."""
PlanEnd: TypeAlias = Literal["success", "fail"]


class SensingAction(NamedTuple):
    """One action, `(move r1_2)`."""

    name: str
    arguments: tuple[str, ...]
    cost: int = 1

    def __str__(self) -> str:
        return f"({' '.join((self.name, *self.arguments))})"


class ObservedFeature(NamedTuple):
    """One observation, `(mark! po-4 = t)`."""

    feature: str
    target: str
    value: str

    def __str__(self) -> str:
        return f"({' '.join(filter(None, (f'{self.feature}!', self.target)))} = {self.value})"

    @property
    def words(self) -> str:
        """Without brackets, of what first; there may be nothing that it is of."""
        return " ".join(filter(None, (self.target, self.feature, self.value)))


@dataclass(frozen=True, slots=True)
class ConditionalPlan:
    """Actions, then either an end or a branch for each observation that the last action can make.

    Attributes:
        end: `success` where the goal is reached, `fail` where there is no further plan; None where it branches.
        answer: with `success`, which object or place it is.
        possibility: the greatest of the hypotheses that lead here; the greatest of all is 1.
    """

    actions: tuple[SensingAction, ...]
    branches: "tuple[tuple[ObservedFeature, ConditionalPlan], ...]" = ()
    end: PlanEnd | None = None
    answer: str = ""
    possibility: float = 1.0


class PlanFigures(NamedTuple):
    """Sizes of a plan: the most actions of a branch, the most they cost, how many leaves and actions there are."""

    depth: int
    worst_cost: int
    leaves: int
    actions: int


def figures_of(plan: ConditionalPlan) -> PlanFigures:
    """The sizes of a plan."""
    depth = worst_cost = leaves = actions = 0
    stack = [(plan, 0, 0)]
    while stack:
        part, length, cost = stack.pop()
        actions += len(part.actions)
        length += len(part.actions)
        cost += sum(each.cost for each in part.actions)
        if part.end is not None:
            leaves += 1
            depth, worst_cost = max(depth, length), max(worst_cost, cost)
        stack.extend((rest, length, cost) for _, rest in part.branches)
    return PlanFigures(depth, worst_cost, leaves, actions)


def lines(plan: ConditionalPlan) -> Iterator[str]:
    """The plan as text, a line for each branch, indented."""
    stack: list[tuple[ConditionalPlan, ObservedFeature | None, int, str]] = [(plan, None, 0, "")]
    while stack:
        part, observed, indent, closing = stack.pop()
        words = [*([str(observed)] if observed else []), *map(str, part.actions)]
        if part.end is not None:
            yield f"{' ' * indent}({' '.join((*words, f':{part.end}'))}){closing}"
            continue
        yield f"{' ' * indent}({' '.join(words)}"
        yield f"{' ' * indent} (cond"
        last = len(part.branches) - 1
        for number, (feature, rest) in reversed(list(enumerate(part.branches))):
            stack.append((rest, feature, indent + 2, f")){closing}" if number == last else ""))


def print_plan(plan: ConditionalPlan) -> str:
    """The plan in one line."""
    return " ".join(line.lstrip() for line in lines(plan))


def plan_record(plan: ConditionalPlan) -> dict[str, Any]:
    """The plan as JSON: `nodes` with their actions, and either branches, by number of the node, or an end with its answer."""
    nodes: list[dict[str, Any]] = []
    stack: list[tuple[ConditionalPlan, dict[str, Any]]] = [(plan, {})]
    while stack:
        part, branch = stack.pop()
        branch["node"] = len(nodes)
        actions = [[each.name, *each.arguments] for each in part.actions]
        record: dict[str, Any] = {"node": len(nodes), "actions": actions, "possibility": part.possibility}
        nodes.append(record)
        if part.end is not None:
            record |= {"end": part.end, "answer": part.answer or None}
            continue
        record["branches"] = [
            {"feature": f"{seen.feature}!", "of": seen.target, "value": seen.value} for seen, _ in part.branches
        ]
        parts = [(rest, each) for (_, rest), each in zip(part.branches, record["branches"], strict=True)]
        stack.extend(reversed(parts))
    return {"nodes": nodes}


def tree_lines(plan: ConditionalPlan) -> Iterator[str]:
    """The plan drawn as a tree of text."""
    stack: list[tuple[ConditionalPlan, str, str, str]] = [(plan, "", "", "")]
    while stack:
        part, observed, before, below = stack.pop()
        words = [*([observed] if observed else []), *(" ".join((each.name, *each.arguments)) for each in part.actions)]
        if part.end is not None:
            words.append(f"[{part.end}]")
        yield before + "  ".join(words)
        last = len(part.branches) - 1
        for number, (seen, rest) in reversed(list(enumerate(part.branches))):
            corner, bar = ("`- ", "   ") if number == last else ("|- ", "|  ")
            stack.append((rest, f"{seen.words}:", below + corner, below + bar))


def dot_lines(plan: ConditionalPlan) -> Iterator[str]:
    """The plan as a graph for Graphviz."""
    yield "digraph plan {"
    count = 0
    stack: list[tuple[ConditionalPlan, int, str]] = [(plan, -1, "")]
    while stack:
        part, parent, observed = stack.pop()
        words = [*(" ".join((each.name, *each.arguments)) for each in part.actions)]
        shape = ' style=filled fillcolor="#e8f0e8"' if part.end == "success" else ""
        label = "\\n".join([*words, *([part.end] if part.end is not None else [])])
        yield f'  n{count} [label="{label}"{shape}];'
        if parent >= 0:
            yield f'  n{parent} -> n{count} [label="{observed}"];'
        stack.extend((rest, count, seen.words) for seen, rest in reversed(part.branches))
        count += 1
    yield "}"
