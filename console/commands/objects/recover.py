"""`dyknow recover`: a conditional plan that finds out which object it is, or where, or the reason why there is none."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from dyknow.console.command import Call, command
from dyknow.console.commands.objects.documents import as_text, read_document
from dyknow.console.errors import DONE, NO
from dyknow.documents.durations import duration_us
from dyknow.model.instants import print_span

if TYPE_CHECKING:
    from dyknow.planning.contingent.conditional_plans import ConditionalPlan
    from dyknow.planning.contingent.files import RecoveryCase
    from dyknow.planning.contingent.sensing_problems import LookErrors

SHORTEST_TIMEOUT_US = 10_000


@command(example="dyknow recover examples/matching/mark.json --draw plan")
def recover(
    call: Call,
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="Hypotheses with places, JSON, or with actions; - for standard input."),
    ],
    *,
    draw: Annotated[
        Literal["plan", "tree", "dot", "svg", "json"] | None,
        typer.Option(help="Only the plan: as text, a tree, for Graphviz, SVG, or its nodes."),
    ] = None,
    timeout: Annotated[str, typer.Option(metavar="TIME", help="How long to search.")] = "10s",
) -> int:
    """A plan that looks again from elsewhere until it is certain which object it is; exit 1 with the reason if none is."""
    from dyknow.planning.contingent.files import read_recovery, recovery_record
    from dyknow.planning.contingent.recovery_planning import NoRecoveryPlan, plan_recovery

    limit_us = duration_us(timeout, option="--timeout", least_us=SHORTEST_TIMEOUT_US)
    end_s = time.monotonic() + limit_us / 1e6

    def stop() -> str:
        return f"gave up after {print_span(limit_us)}" if time.monotonic() > end_s else ""

    source, name = read_document(file)
    if source.lstrip()[:1] in {b"(", b";"}:
        return _of_actions(call, source, name, stop, draw)
    case = read_recovery(source, name)
    if case.errors is not None:
        return _of_errors(call, case, case.errors, stop, draw)
    found = plan_recovery(case.problem, case.value, case.least_possibility, stop)
    record = recovery_record(found, case.notes)
    for sentence in record["notes"]:
        call.out.note(sentence, style="yellow")
    if draw is None or isinstance(found, NoRecoveryPlan):
        call.out.line(record)
    else:
        _draw(call, found.plan, draw)
    return DONE if record["solvable"] else NO


def _of_errors(
    call: Call, case: "RecoveryCase", errors: "LookErrors", stop: Callable[[], str], draw: str | None
) -> int:
    """A plan for looks that may err; it is one if it ends with an answer as probably as answers have to be."""
    from dyknow.planning.contingent.files import plan_figures_record
    from dyknow.planning.epistemic.noisy_looks import plan_noisy

    found = plan_noisy(case.problem, errors, stop)
    is_enough = found.success >= errors.sure
    lacking = f"with {found.looks} looks the plan ends with an answer in {found.success:.1%} of the cases"
    notes = (*case.notes, *found.notes)
    for sentence in notes:
        call.out.note(sentence, style="yellow")
    if draw is not None:
        _draw(call, found.plan, draw)
        return DONE if is_enough else NO
    figures = plan_figures_record(found.plan, found.expected)
    rest = {
        "why_not": None if is_enough else lacking,
        "covered": found.success,
        "right": found.right,
        "notes": list(notes),
    }
    call.out.line({**figures, "solvable": is_enough, **rest})
    return DONE if is_enough else NO


def _of_actions(call: Call, source: bytes, name: str, stop: Callable[[], str], draw: str | None) -> int:
    """A plan for a problem in the action language."""
    from dyknow.planning.contingent.files import plan_figures_record
    from dyknow.planning.epistemic.epistemic_search import plan_epistemic
    from dyknow.planning.epistemic.reading import read_epistemic

    found = plan_epistemic(read_epistemic(as_text(source, name), name), stop)
    if draw is None or found.plan is None:
        call.out.line({**plan_figures_record(found.plan), "why_not": found.reason or None})
    else:
        _draw(call, found.plan, draw)
    return DONE if found.plan is not None else NO


def _draw(call: Call, plan: "ConditionalPlan", kind: str) -> None:
    from dyknow.planning.contingent.conditional_plans import dot_lines, lines, plan_record, tree_lines

    if kind == "json" or call.out.json_lines:
        call.out.line(plan_record(plan))
        return
    if kind == "svg":
        from dyknow.console.output.drawings import plan_svg

        call.out.plain(plan_svg(plan))
        return
    drawn = {"plan": lines, "tree": tree_lines, "dot": dot_lines}[kind](plan)
    call.out.plain("".join(f"{line}\n" for line in drawn), folds=True)
