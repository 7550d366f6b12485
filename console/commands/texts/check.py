"""`dyknow check`: a formula over a recorded trace, or over the live states of a platform."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from dyknow.console.arguments import Unit
from dyknow.console.command import Call, command
from dyknow.console.commands.texts.specification_files import read_lines
from dyknow.console.errors import DONE, NO
from dyknow.console.output.shown import line, stacked, styled
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.model.errors import WrongCall, did_you_mean
from dyknow.model.values import NO_VALUE
from dyknow.runtime.configuration.instants import clock_time

if TYPE_CHECKING:
    from dyknow.reasoning import Trace

MOST_REASONS = 5
"""The most reasons that are printed; JSON has them all."""
MOST_LEFT = 12
"""The rest of an undecided formula is printed if it is no more obligations than this."""


class VerdictReason(NamedTuple):
    """One part of a formula that the deciding state settled; formulas as they are printed."""

    part: str
    holds: bool
    samples: Mapping[str, Any]
    members: Mapping[str, Any]
    within: str | None
    since_us: int | None
    until_us: int | None


@command(example="dyknow check 'always speed[uav1] <= 30' --trace flight.jsonl")
def check(
    call: Call,
    formula: Annotated[str, typer.Argument(metavar="FORMULA", help="In the language of formulas.")],
    *,
    trace: Annotated[Path | None, typer.Option(metavar="FILE", help="Recorded states, JSON lines.")] = None,
    unit: Unit = None,
    timeout: Annotated[str, typer.Option(metavar="TIME", help="How long to watch live states.")] = "10s",
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the trace and the verdicts: .png, .svg or .pdf.")
    ] = None,
) -> int:
    """A formula over a recorded trace, or over a platform's live states; exit 1 if it is violated."""
    if plot is not None:
        from dyknow.console.plots.plot import check_file

        check_file(plot)
        if trace is None:
            raise WrongCall("--plot draws a recorded trace: give --trace FILE; dyknow plot draws what platforms have.")
    if (trace is None) == (unit is None):
        raise WrongCall("give --trace FILE for recorded states, or --unit U for the live states of a platform.")
    if trace is not None:
        return _over_trace(call, formula, trace, plot)
    return _live(call, formula, str(unit), duration_us(timeout, option="--timeout", least_us=SHORTEST_US) / 1e6)


def _over_trace(call: Call, text: str, path: Path, plot: Path | None = None) -> int:
    from dyknow.kpl import Vocabulary, lint, print_formula, read_formula
    from dyknow.kpl import check as resolve
    from dyknow.reasoning import follow_trace, read_trace, remaining, required_labels, trace_domains

    formula = read_formula(text)
    trace = read_lines(path, read_trace, "--trace", "a trace is a text of JSON lines")
    formula = resolve(formula, Vocabulary(named=trace.objects))
    domains, labels = trace_domains(formula, trace), trace.labels
    known = frozenset(labels)
    _note_of(call, trace, str(path))
    for name in sorted(name for name, members in domains.items() if not members):
        call.out.note(
            f"note: {name} has no members in {path}: no label has an object where the formula puts the variable. "
            f"Known: {', '.join(labels[:8]) or 'no label'}."
        )
    for label in sorted(str(label) for label in required_labels(formula, domains)):
        if label not in known:
            call.out.note(f"note: {label} has no value anywhere in {path}.{did_you_mean(label, labels)}")
    (verdict, t_ms, index), progression = follow_trace(formula, trace.states, domains)
    if plot is not None:
        from dyknow.console.plots.plot import draw
        from dyknow.console.plots.traces import trace_plot

        named = {str(label) for label in required_labels(formula, domains)} & known
        draw(trace_plot(text, formula, trace, domains, named, (verdict, t_ms, index)), plot)
    rest = remaining(progression) if verdict == "undecided" and progression.kept <= MOST_LEFT else None
    left = None if rest is None else print_formula(rest)
    reasons = [
        VerdictReason(
            print_formula(one.part),
            one.holds,
            one.samples,
            dict(one.binding),
            None if one.obligation is None else print_formula(one.obligation),
            one.since_us,
            one.until_us,
        )
        for one in progression.explain()
    ]
    code = _told(call, verdict, t_ms, index, reasons=reasons, left=left)
    if verdict == "false" and not call.out.json_lines:
        for warning in lint(formula):
            call.out.note(f"note: {warning.message}: {warning.repair}")
    return code


def _note_of(call: Call, trace: "Trace", file: str) -> None:
    """Note the states and values of a trace that were left out."""
    for counts, said in (
        (trace.left_out, "states were left out"),
        (trace.no_numbers, "values are no numbers and count as none"),
    ):
        if counts:
            reasons = ", ".join(f"{count} {reason}" for reason, count in counts.items())
            first = min(trace.first_lines[reason] for reason in counts)
            call.out.note(f"note: {said}: {reasons}; the first in {file}:{first}.")


def _live(call: Call, text: str, unit: str, timeout_s: float) -> int:
    from dyknow.console.centre.client import connected
    from dyknow.federation.messages.acts import Performative
    from dyknow.federation.messages.contents import CheckFormula, Verdict
    from dyknow.kpl import parse_formula
    from dyknow.runtime.library.jobs import failure_of

    parse_formula(text)
    content = CheckFormula(text=text, timeout_s=timeout_s)
    with connected(call) as client:
        client.chosen(unit)
        dialogue = client.say(unit, Performative.QUERY_IF, content, standing=True)
        with call.out.waiting(f"platform {unit} is watching its states"):
            client.wait_for(lambda: bool(dialogue.trouble or dialogue.results), timeout_s + 3.0)
        found = next((said for said in dialogue.results if isinstance(said, Verdict)), None)
        if found is None:
            raise failure_of(dialogue, "no verdict came in time")
    for label in found.no_value:
        call.out.note(f"note: {label} has no value on platform {unit}.")
    for label in found.missing:
        if label not in found.no_value:
            call.out.note(f"note: {label} has not come to platform {unit}.")
    t_ms = None if found.valid_us is None else found.valid_us / 1000
    reasons = [
        VerdictReason(one.part, one.holds, one.samples, one.members, one.within, one.since_us, one.until_us)
        for one in found.because
    ]
    return _told(call, found.verdict, t_ms, found.index, is_live=True, reasons=reasons, states=found.states)


def _told(
    call: Call,
    verdict: str,
    t_ms: float | None,
    index: int | None,
    *,
    is_live: bool = False,
    reasons: Sequence[VerdictReason] = (),
    left: str | None = None,
    states: str = "",
) -> int:
    if t_ms is not None and t_ms == round(t_ms):
        t_ms = round(t_ms)
    record: dict[str, Any] = {"verdict": verdict, "t_ms": t_ms, "index": index}
    if reasons:
        record["because"] = [_record(one) for one in reasons]
    if left is not None:
        record["left"] = left
    if states:
        record["states"] = states
    time = clock_time if is_live else _trace_time
    colour = {"true": "green", "false": "red"}.get(verdict, "yellow")
    when = ""
    if t_ms is not None:
        shown = time(round(t_ms * 1000))
        when = f", decided by state {index} ({shown})" if index is not None else f", decided at {shown}"
    lines = [line for one in reasons[:MOST_REASONS] for line in _lines(one, time)]
    if len(reasons) > MOST_REASONS:
        lines.append(f"  and {len(reasons) - MOST_REASONS} more; --json has them all")
    if left is not None:
        lines.append(f"  left after the last state: {left}")
    wrapped = [fill(line, call.out.width, subsequent_indent="      ", break_on_hyphens=False) for line in lines]
    call.out.say(stacked([line(styled(verdict, colour), when), *wrapped]), **record)
    return NO if verdict == "false" else DONE


def _lines(why: VerdictReason, time: Callable[[int], str]) -> Iterator[str]:
    """One reason, as lines of text."""
    yield f"  {why.part} is {str(why.holds).lower()}"
    if why.samples:
        yield f"    with {', '.join(f'{label} = {_shown(value)}' for label, value in why.samples.items())}"
    if why.members:
        yield f"    for {', '.join(f'{variable} = {member}' for variable, member in why.members.items())}"
    if why.within is not None:
        yield f"    in {why.within}"
    if why.since_us is not None:
        yield f"    since {time(why.since_us)}{'' if why.until_us is None else f', until {time(why.until_us)}'}"


def _trace_time(at_us: int) -> str:
    return f"t = {at_us / 1000:g} ms"


def _shown(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _record(why: VerdictReason) -> dict[str, Any]:
    """One reason, as a JSON line has it."""
    return {
        "part": why.part,
        "holds": why.holds,
        "samples": {label: None if value is NO_VALUE else value for label, value in why.samples.items()},
        "members": dict(why.members),
        "in": why.within,
        "since_ms": None if why.since_us is None else why.since_us / 1000,
        "until_ms": None if why.until_us is None else why.until_us / 1000,
    }
