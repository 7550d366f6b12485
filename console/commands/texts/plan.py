"""`dyknow plan`: a plan for a problem of a domain, with times, or the reason why there is none; both to and from PDDL."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from dyknow.console.command import Call, command
from dyknow.console.commands.texts.specification_files import read_text
from dyknow.console.errors import DONE, NO
from dyknow.documents.durations import duration_us
from dyknow.model.errors import WrongCall
from dyknow.model.instants import print_span

if TYPE_CHECKING:
    from dyknow.planning import Declarations, NoPlan, PlanFound
    from dyknow.planning.execution.generation import PlanMonitor

SHORTEST_TIMEOUT_US = 10_000


@command(example="dyknow plan examples/logistics/logistics.dom examples/logistics/four.prob")
def plan(
    call: Call,
    domain: Annotated[Path, typer.Argument(metavar="DOMAIN.dom", help="Types, features, operators, control formulas.")],
    problem: Annotated[Path, typer.Argument(metavar="PROBLEM.prob", help="Objects, the initial state, goals.")],
    *,
    timeout: Annotated[str, typer.Option(metavar="TIME", help="How long to search.")] = "10s",
    search: Annotated[
        Literal["automatic", "depth-first", "heuristic", "branch-and-bound", "best-first"],
        typer.Option(help="The first plan that is found, by one way or several, or the cheapest."),
    ] = "automatic",
    monitors: Annotated[bool, typer.Option("--monitors", help="The monitors of its execution.")] = False,
    pddl: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write domain.pddl and problem.pddl there, and do not search."),
    ] = None,
) -> int:
    """A plan for a problem: its actions with times and its cost; exit 1 with the reason if there is none."""
    from dyknow.planning import PlanFound, Strategy, find_plan

    limit_us = duration_us(timeout, option="--timeout", least_us=SHORTEST_TIMEOUT_US)
    declared, asked = _read(domain, problem)
    if pddl is not None:
        return _written(call, declared, asked, pddl)
    begun_s = time.monotonic()
    end_s = begun_s + limit_us / 1e6

    def stop() -> str:
        return f"gave up after {print_span(limit_us)}" if time.monotonic() > end_s else ""

    with call.out.waiting("searching") as progress:
        found = find_plan(declared, asked, Strategy(search), stop, lambda nodes: progress(f"searching: {nodes} nodes"))
    search_ms = round((time.monotonic() - begun_s) * 1000, 1)
    if not isinstance(found, PlanFound):
        return _refused(call, found, search_ms)
    return _shown(
        call, found, search_ms, _monitors(call, declared, asked, found, domain, problem) if monitors else None
    )


def _monitors(
    call: Call, domain: "Declarations", problem: "Declarations", found: "PlanFound", *files: Path
) -> "tuple[PlanMonitor, ...]":
    """The monitors of a plan; hints on them are notes."""
    from dyknow.planning.execution.generation import plan_monitors, unmonitored
    from dyknow.planning.execution.hints import monitor_hints

    for hint in monitor_hints(domain.joined(problem)):
        where = f"{files[hint.is_goal]}:{hint.place.line}:{hint.place.column}"
        call.out.note(f"hint: {where}: {hint.message}\n    write: {hint.repair}")
    joined = domain.joined(problem)
    for lost in unmonitored(joined, found.plan):
        given = ", ".join(lost.features) or "all that it speaks of"
        call.out.note(
            f"not monitored: {files[0]}:{lost.place.line}:{lost.place.column}: this condition of {lost.about} is always "
            f"so: {given} is given with #init, nothing changes it and nothing senses it\n"
            f"    write: #sensed, a default instead of #init, or no `monitored`"
        )
    return plan_monitors(joined, found.plan)


def _read(domain: Path, problem: Path) -> "tuple[Declarations, Declarations]":
    """Both texts, of PDDL if they are named so."""
    from dyknow.planning import parse_domain, parse_problem

    if domain.suffix == problem.suffix == ".pddl":
        from dyknow.planning.symbolic.importing import read_pddl

        return read_pddl(read_text(domain), read_text(problem))
    declared = parse_domain(read_text(domain))
    return declared, parse_problem(read_text(problem), declared)


def _written(call: Call, domain: "Declarations", problem: "Declarations", folder: Path) -> int:
    from dyknow.planning.symbolic.exporting import to_unified

    found = to_unified(domain, problem)
    try:
        paths = found.write_pddl(folder)
    except OSError as error:
        raise WrongCall(f"--pddl {folder}: PDDL cannot be written there ({error}).") from None
    if call.out.json_lines:
        call.out.line({"files": [str(path) for path in paths], "left_out": list(found.left_out)})
        return DONE
    if found.left_out:
        call.out.note(f"note: PDDL has no place for {', '.join(found.left_out)}.")
    call.out.show(f"written: {paths[0]}, {paths[1]}")
    return DONE


def _shown(call: Call, found: "PlanFound", search_ms: float, monitors: "tuple[PlanMonitor, ...] | None") -> int:
    plan_found = found.plan
    if call.out.json_lines:
        shown = {} if monitors is None else {"monitors": [one.as_json() for one in monitors]}
        call.out.line({**plan_found.as_json(), **shown, "nodes": found.nodes, "search_ms": search_ms})
        return DONE
    lines = [_monitor_line(one) for one in monitors or () if one.step == 0]
    for number, line in enumerate(plan_found.lines(), 1):
        lines += [line, *(_monitor_line(one) for one in monitors or () if one.step == number)]
    call.out.plain("".join(f"{line}\n" for line in lines), folds=True)
    for name in plan_found.unreached:
        call.out.note(f"note: {name} is unreached: there is no plan that reaches it as well.")
    best = ", the cheapest there is" if found.is_cheapest else ""
    call.out.show(
        f"{len(plan_found.actions)} actions, {plan_found.end_ms / 1000:g} s, cost {plan_found.cost:g}{best}; "
        f"{found.nodes} nodes in {search_ms:g} ms"
    )
    return DONE


def _monitor_line(one: "PlanMonitor") -> str:
    recovery = f"; then {one.recovery}" if one.recovery else ""
    return f"    {one.kind}: {one.text}{recovery}"


def _refused(call: Call, found: "NoPlan", search_ms: float) -> int:
    if call.out.json_lines:
        record = {"plan": None, "reason": found.reason, "causes": list(found.causes)}
        call.out.line({**record, "nodes": found.nodes, "search_ms": search_ms})
        return NO
    call.out.note(f"no plan: {found.reason}.")
    for cause in found.causes:
        call.out.note(f"  {cause}")
    return NO
