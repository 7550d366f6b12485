"""Recovery problems as JSON, and plans for them.

    {"kind": "identify", "places": {"r1_1": ["r1_2"], "r1_2": ["r1_1"]}, "start": "r1_1", "objects": ["po1"],
     "hypotheses": [{"possibility": 1.0, "visible_from": {"po1": ["r1_2"]}, "answer": "po1"},
                    {"possibility": 0.5, "visible_from": {}, "answer": "f"}],
     "value": "worst", "least_possibility": 0.0, "symbol": "b1"}

`places` says to which places one can move from each; a way leads in one direction unless both places list it. Under a hypothesis a
look at an object shows what is wanted from the places of `visible_from`. `answer` is an object, in a `search` the place of the
object, or `f` for none. Every move, look and anchor costs 1.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

from dyknow.documents.documents import json_document
from dyknow.documents.tables import DocumentTable, shown
from dyknow.model.errors import did_you_mean
from dyknow.planning.contingent.conditional_plans import NONE, ConditionalPlan, figures_of, print_plan
from dyknow.planning.contingent.optimal_search import PlanValue
from dyknow.planning.contingent.recovery_planning import NoRecoveryPlan, RecoveryPlan
from dyknow.planning.contingent.sensing_problems import (
    MOST_HYPOTHESES,
    LookErrors,
    RecoveryHypothesis,
    RecoveryTask,
    SensingProblem,
    sensing_problem,
)

MOST_PLACES: Final = 2000
MOST_WAYS: Final = 50_000
MOST_OBJECTS: Final = 1000
MOST_LOOKS: Final = 4096
MOST_NOISY_LOOKS: Final = 20
EXAMPLE: Final = (
    '{"kind": "identify", "places": {"r1_1": ["r1_2"]}, "start": "r1_1", "objects": ["po1"], '
    '"hypotheses": [{"possibility": 1, "visible_from": {"po1": ["r1_2"]}, "answer": "po1"}]}'
)
_HYPOTHESIS: Final = '{"possibility": 1, "visible_from": {"po1": ["r1_2"]}, "answer": "po1"}'
_NAME = re.compile(r"[^\s()\"';:\\]{1,64}")


class RecoveryCase(NamedTuple):
    """A problem as it is written.

    Attributes:
        notes: omitted or changed parts, and unknown keys.
        errors: of looks; None where they never err.
    """

    problem: SensingProblem
    value: PlanValue
    least_possibility: float
    notes: tuple[str, ...]
    errors: LookErrors | None = None


def read_recovery(source: str | bytes, file: str = "") -> RecoveryCase:
    """The problem; of more than `MOST_HYPOTHESES` hypotheses those that are most possible.

    Raises:
        TextError: something is wrong with it.
    """
    root = DocumentTable(json_document(source, file, EXAMPLE))
    task: RecoveryTask = "search" if root.text("kind", None, ("identify", "search")) == "search" else "identify"
    ways = _ways(root)
    start = _name(root, ("start",), root.get("start"))
    objects = _names(root, ("objects",), root.get("objects") if "objects" in root else None)
    symbol = _name(root, ("symbol",), root.get("symbol")) if "symbol" in root else _symbol(task, objects)
    value: PlanValue = "expected" if root.text("value", "worst", ("worst", "expected")) == "expected" else "worst"
    least = root.number("least_possibility", 0.0, 0.0, 1.0)
    errors = _errors(root) if "errors" in root else None
    tables = root.list("hypotheses", f'"hypotheses": [{_HYPOTHESIS}]')
    known = {start, *ways, *(to for others in ways.values() for to in others)}
    reader = _HypothesisReader(task, objects, known)
    found = [reader.read(each) for each in tables]
    notes = [*root.ignored(), *tables[0].ignored()]
    if not any(each.possibility for each in found):
        raise root.error("hypotheses", "no hypothesis is possible: all have possibility 0", _HYPOTHESIS)
    hypotheses = _normalised(found, notes)
    if max(each.possibility for each in hypotheses) <= least:
        raise root.error("least_possibility", "no hypothesis is more possible than that", '"least_possibility": 0')
    problem = sensing_problem(task, ways, start, hypotheses, symbol)
    if len(problem.looks) > MOST_LOOKS:
        message = f"{len(problem.looks)} pairs of place and object show something, at most {MOST_LOOKS} are read"
        raise root.error("hypotheses", message, "fewer places, or one problem for each part of the area")
    return RecoveryCase(problem, value, least, tuple(notes), errors)


def plan_figures_record(plan: ConditionalPlan | None, expected: float | None = None) -> dict[str, Any]:
    """A plan with its figures; nulls where there is none."""
    if plan is None:
        return {"solvable": False, **dict.fromkeys(("depth", "leaves", "actions", "expected", "plan"))}
    figures = figures_of(plan)
    sizes = {"depth": figures.depth, "leaves": figures.leaves, "actions": figures.actions}
    return {"solvable": True, **sizes, "expected": expected, "plan": print_plan(plan)}


def recovery_record(found: RecoveryPlan | NoRecoveryPlan, notes: Sequence[str] = ()) -> dict[str, Any]:
    """The answer as a record, with notes on the problem."""
    if isinstance(found, NoRecoveryPlan):
        sets = [list(each) for each in found.indistinguishable]
        return {**plan_figures_record(None), "why_not": found.reason, "indistinguishable": sets, "notes": list(notes)}
    is_whole = found.covered == 1.0
    return {
        **plan_figures_record(found.plan, expected=found.expected),
        "solvable": is_whole,
        "why_not": None if is_whole else found.notes[-1],
        "optimal": found.is_optimal,
        "covered": found.covered,
        "notes": [*notes, *found.notes],
    }


class _HypothesisReader:
    """Reads hypotheses over known objects and places."""

    def __init__(self, task: RecoveryTask, objects: Sequence[str], places: set[str]) -> None:
        self._task, self._objects, self._places = task, set(objects), places

    def read(self, table: DocumentTable) -> RecoveryHypothesis:
        possibility = table.number("possibility", 1.0, 0.0, 1.0)
        seen = table.table("visible_from")
        visible: dict[str, frozenset[str]] = {}
        for target in seen.entries:
            if self._objects and target not in self._objects:
                message = f"unknown object.{did_you_mean(target, sorted(self._objects))}"
                raise seen.error(target, message, "an object of objects")
            _name(seen, (target,), target)
            visible[target] = frozenset(_names(seen, (target,), seen.get(target)))
        answer = table.get("answer")
        known = {NONE, *self._places} if self._task == "search" else {NONE, *(self._objects or visible)}
        if self._task == "search":
            known.update(*visible.values())
        if not isinstance(answer, str) or answer not in known:
            what = "a place" if self._task == "search" else "an object"
            hint = did_you_mean(answer, sorted(known)) if isinstance(answer, str) else ""
            path = "answer" if "answer" in table else ()
            raise table.error(path, f"answer is {what}, or {NONE} for none, got {shown(answer)}.{hint}", _HYPOTHESIS)
        return RecoveryHypothesis(possibility, answer, visible)


def _normalised(found: Sequence[RecoveryHypothesis], notes: list[str]) -> list[RecoveryHypothesis]:
    """The hypotheses that count, the greatest possibility being 1; numbers of hypotheses stay those of the file."""
    top = max(each.possibility for each in found)
    if top < 1.0:
        notes.append(f"no hypothesis is wholly possible: possibilities are divided by the greatest, {top:g}")
    if impossible := sum(each.possibility == 0.0 for each in found):
        notes.append(f"{impossible} hypotheses have possibility 0 and count for nothing")
    hypotheses = [each._replace(possibility=each.possibility / top) if top < 1.0 else each for each in found]
    if len(hypotheses) <= MOST_HYPOTHESES:
        return hypotheses
    kept = sorted(range(len(hypotheses)), key=lambda number: (-hypotheses[number].possibility, number))[
        :MOST_HYPOTHESES
    ]
    notes.append(
        f"{len(hypotheses)} hypotheses, at most {MOST_HYPOTHESES} are planned for: "
        f"{len(hypotheses) - MOST_HYPOTHESES} of the least possible are left out, up to "
        f"{max(each.possibility for number, each in enumerate(hypotheses) if number not in set(kept)):g}"
    )
    return [hypotheses[number] for number in sorted(kept)]


def _errors(root: DocumentTable) -> LookErrors:
    """How looks err: `{"unseen": 0.1, "false": 0.05, "sure": 0.95, "looks": 6}`."""
    table = root.table("errors", '"errors": {"unseen": 0.1, "false": 0.05}')
    unseen, false = (table.number(each, 0.0, 0.0, 1.0) for each in ("unseen", "false"))
    if unseen + false >= 1.0:
        raise table.error(
            (), "unseen and false together are below 1: else a look decides nothing", '{"unseen": 0.1, "false": 0.05}'
        )
    looks = table.whole("looks", 6, 1, MOST_NOISY_LOOKS)
    usual = LookErrors(unseen, false)
    return usual._replace(sure=table.number("sure", usual.sure, 0.5, 1.0), looks=looks)


def _symbol(task: RecoveryTask, objects: Sequence[str]) -> str:
    return objects[0] if task == "search" and objects else "b1"


def _ways(root: DocumentTable) -> Mapping[str, tuple[str, ...]]:
    table = root.table("places", '"places": {"r1_1": ["r1_2"], "r1_2": ["r1_1"]}')
    if len(table.entries) > MOST_PLACES:
        raise root.error("places", f"{len(table.entries)} places, at most {MOST_PLACES} are read", "a part of them")
    ways = {_name(table, (place,), place): _names(table, (place,), table.get(place)) for place in table.entries}
    if (count := sum(map(len, ways.values()))) > MOST_WAYS:
        raise root.error("places", f"{count} ways, at most {MOST_WAYS} are read", "ways between neighbours only")
    return ways


def _names(table: DocumentTable, path: tuple[str | int, ...], value: object) -> tuple[str, ...]:
    """A list of names; a name alone stands for a list of it, null for none."""
    if value is None:
        return ()
    if isinstance(value, str):
        return (_name(table, path, value),)
    if not isinstance(value, list):
        raise table.error(path, f"a list of names is expected, got {shown(value)}", '["r1_1", "r1_2"]')
    if len(value) > MOST_PLACES:
        raise table.error(path, f"{len(value)} names, at most {MOST_PLACES} are read", "fewer names")
    return tuple(dict.fromkeys(_name(table, (*path, number), each) for number, each in enumerate(value)))


def _name(table: DocumentTable, path: tuple[str | int, ...], value: object) -> str:
    if not isinstance(value, str) or not _NAME.fullmatch(value) or not value.isprintable() or value == NONE:
        message = f"a name of 1 to 64 characters without blanks, quotes or brackets, other than {NONE}, is expected"
        raise table.error(path, f"{message}, got {shown(value)}", '"r1_2"')
    return value
