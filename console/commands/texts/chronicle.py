"""`dyknow chronicle`: chronicles recognised in a recorded list of events, or over the live streams of a platform."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dyknow.console.arguments import Unit
from dyknow.console.command import Call, command
from dyknow.console.commands.texts.specification_files import opened, read_text
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import unit_json
from dyknow.console.output.shown import line, styled
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.model.errors import ChronicleError, TextError, WrongCall, did_you_mean
from dyknow.runtime.configuration.instants import clock_time

if TYPE_CHECKING:
    from dyknow.federation.messages.contents import Content, Expected
    from dyknow.reasoning.chronicles import ChronicleFile, ChronicleInstance, Recogniser
    from dyknow.reasoning.chronicles.recognition.events import RecordedEvent

_MOST_ROWS = 10_000
_STEP_S = 0.2


@command(example="dyknow chronicle overtake.chr --events road.jsonl")
def chronicle(
    call: Call,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Chronicles, overtake.chr.")],
    *,
    events: Annotated[Path | None, typer.Option(metavar="FILE.jsonl", help="Recorded events, JSON lines.")] = None,
    unit: Unit = None,
    timeout: Annotated[str, typer.Option(metavar="TIME", help="How long to watch live streams.")] = "10s",
    max_delay: Annotated[str | None, typer.Option(metavar="TIME", help="How late live samples may come; 1s.")] = None,
    max_age: Annotated[
        str | None, typer.Option(metavar="TIME", help="Instances last no longer than this; bounds what is remembered.")
    ] = None,
    partial: Annotated[
        bool, typer.Option("--partial", help="Also partial instances, and until when they wait.")
    ] = False,
) -> int:
    """Chronicles in recorded events, or over a platform's live streams; exit 1 if nothing was recognised."""
    if events is not None and unit is None:
        if max_delay is not None:
            raise WrongCall("--max-delay: recorded events are in order; it is for --unit U.")
        recognition = _Recognition(call, _recogniser(file, max_age), str(events))
        with opened(events, "--events", "a list of events is a text of JSON lines") as lines:
            recognition.all(lines)
        if partial:
            recognition.partial()
        recognition.notes()
        return DONE if recognition.count else NO
    if events is None and unit is not None:
        if max_age is not None:
            raise WrongCall("--max-age: a platform bounds what it remembers itself; it is for --events FILE.jsonl.")
        delay_s = None if max_delay is None else duration_us(max_delay, option="--max-delay", least_us=0) / 1e6
        seconds = duration_us(timeout, option="--timeout", least_us=SHORTEST_US) / 1e6
        return _live(call, file, unit, seconds, delay_s, partial=partial)
    raise WrongCall("give --events FILE.jsonl for recorded events, or --unit U for the live streams of a platform.")


def chronicles_of(file: Path) -> "tuple[str, ChronicleFile]":
    """The text, and its declarations; raises WrongCall and TextErrors."""
    from dyknow.kpl import parse_chronicles

    text = read_text(file)
    found = parse_chronicles(text)
    if not found.chronicles:
        raise TextError("there is no chronicle", file=str(file), repair="chronicle name[?x] { event(...) }")
    return text, found


def _recogniser(file: Path, max_age: str | None) -> "Recogniser":
    from dyknow.reasoning.chronicles import Recogniser

    _, found = chronicles_of(file)
    max_age_ms = None if max_age is None else duration_us(max_age, option="--max-age", least_us=1000) // 1000
    try:
        return Recogniser.of(found, max_age_ms=max_age_ms)
    except ChronicleError as error:
        raise WrongCall(f"{file}: {error}.") from None


class _Recognition:
    """One pass over the events."""

    def __init__(self, call: Call, recogniser: "Recogniser", file: str) -> None:
        self.count = 0
        self._out, self._recogniser, self._file = call.out, recogniser, file
        self._rows: list[tuple[str, str, str, str]] = []
        self._seen: set[str] = set()
        self._values: dict[object, str] = {}
        self._jumped: tuple[int, str] | None = None
        self._ignored, self._ignored_line = 0, 0

    def all(self, lines: Iterator[str]) -> None:
        from dyknow.reasoning.chronicles.recognition.events import read_events

        for event in read_events(lines, self._file):
            for instance in event.told_to(self._recogniser):
                self._tell(instance)
            self._watch(event)
        self._print()

    def _watch(self, event: "RecordedEvent") -> None:
        """Remember what is worth a note about the events themselves."""
        if event.label is None:
            return
        self._seen.add(event.label.feature)
        if (ignored := self._recogniser.ignored.total()) > self._ignored:
            self._ignored, self._ignored_line = ignored, self._ignored_line or event.line
            return
        if event.change is None:
            return
        known, (old, new) = self._values.get(event.label), event.change
        if known is not None and known != old and self._jumped is None:
            self._jumped = event.line, f"{event.label} changes from {old or 'unknown'}, and was {known}"
        self._values[event.label] = new

    def _tell(self, instance: "ChronicleInstance") -> None:
        self.count += 1
        instants = {name: _shown(at_ms) for name, at_ms in instance.instants.items()}
        if self._out.json_lines:
            self._out.line(
                {
                    "chronicle": instance.chronicle,
                    "bindings": dict(instance.bindings),
                    "instants": instants,
                    "recognised_ms": _shown(instance.recognised_ms),
                }
            )
            return
        bindings = " ".join(f"{name}={symbol}" for name, symbol in instance.bindings.items())
        times = " ".join(f"{name}={at}" for name, at in instants.items())
        self._rows.append((str(_shown(instance.recognised_ms)), instance.chronicle, bindings, times))
        if len(self._rows) >= _MOST_ROWS:
            self._print()

    def _print(self) -> None:
        if self._rows:
            columns = ("t_ms", "chronicle", "variables", "instants")
            self._out.table("", columns, self._rows, right=("t_ms",), wraps=("variables", "instants"))
            self._rows.clear()

    def partial(self) -> None:
        """Print the partial instances (8.4): matched events, missing ones, and when each is given up at the latest."""
        rows = []
        for each in self._recogniser.partial_instances():
            instants = {name: _shown(at_ms) for name, at_ms in each.instants.items()}
            if self._out.json_lines:
                record = {"bindings": dict(each.bindings), "instants": instants, "missing": each.missing}
                self._out.line({"partial": each.chronicle, **record, "dies_ms": each.dies_ms})
                continue
            until = "" if each.dies_ms is None else str(each.dies_ms)
            bindings = " ".join(f"{name}={symbol}" for name, symbol in each.bindings.items())
            times = " ".join(f"{name}={at}" for name, at in instants.items())
            rows.append((each.chronicle, bindings, times, "; ".join(each.missing), until))
        if rows:
            columns = ("partial", "variables", "instants", "missing", "until")
            self._out.table("", columns, rows, right=("until",), wraps=("variables", "instants", "missing"))

    def notes(self) -> None:
        """Note the ignored events, the missing ones, and the open instances."""
        note, recogniser = self._out.note, self._recogniser
        if not self.count and not self._out.json_lines:
            self._out.say("nothing was recognised")
        if recogniser.ignored:
            reasons = ", ".join(f"{count} {reason}" for reason, count in recogniser.ignored.items())
            note(f"note: events were ignored: {reasons}; the first in {self._file}:{self._ignored_line}.")
        if self._jumped is not None:
            line, said = self._jumped
            note(f"note: {self._file}:{line}: {said}; an event is missing before, and what needs it is not found.")
        for name in recogniser.needed:
            if name not in self._seen:
                note(f"note: {name} occurs nowhere in {self._file}.{did_you_mean(name, tuple(self._seen))}")
        for name, limits in recogniser.incomplete.items():
            cut = ", ".join(f"{reason} {count} times" for reason, count in limits.items())
            note(f"note: {name} is incomplete: {cut}; --max-age bounds what is remembered.")
        self._open_ends()

    def _open_ends(self) -> None:
        last_ms, due_ms = self._recogniser.clock_ms, self._recogniser.deadline_ms
        more = 0
        while due_ms is not None and more < _MOST_ROWS:
            more += len(self._recogniser.on_time(due_ms))
            due_ms, before = self._recogniser.deadline_ms, due_ms
            if due_ms == before:
                break
        if more:
            self._out.note(
                f"note: {more} more would be recognised if nothing happened after {last_ms} ms; "
                f'a last line {{"t_ms": ...}} says until when nothing did.'
            )


def _shown(at_ms: int) -> int | str:
    from dyknow.reasoning.chronicles import MINUS_INFINITY

    return "-oo" if at_ms == MINUS_INFINITY else at_ms


def _live(call: Call, file: Path, unit: str, seconds: float, delay_s: float | None, *, partial: bool) -> int:
    """Each instance on a platform as it becomes certain; 0 if something was recognised, 1 if nothing."""
    from dyknow.console.centre.client import connected
    from dyknow.federation.messages.acts import Performative
    from dyknow.federation.messages.contents import Recognise
    from dyknow.federation.messages.contents.chronicles import LONGEST
    from dyknow.runtime.library.jobs import failure_of

    text, _ = chronicles_of(file)
    if len(text) > LONGEST:
        raise WrongCall(f"{file} is too long to be sent: {len(text)} characters, {LONGEST} are the most.")
    count = heard = 0
    with connected(call) as client:
        client.chosen(unit)
        content = Recognise(text=text, timeout_s=seconds + 5.0, delay_s=delay_s, partial=partial or None)
        dialogue = client.say(unit, Performative.SUBSCRIBE, content, standing=True)

        def has_news() -> bool:
            return len(dialogue.results) > heard or dialogue.trouble is not None

        until_s = time.monotonic() + seconds
        while (left_s := until_s - time.monotonic()) > 0 and dialogue.trouble is None:
            client.wait_for(has_news, min(left_s, _STEP_S))
            new = dialogue.results[heard:]
            heard += len(new)
            count += sum(_tell_live(call, unit, said) for said in new)
        if dialogue.trouble is not None:
            raise failure_of(dialogue, "the watch ended")
    if not count:
        call.out.note(f"nothing was recognised on platform {unit} within {seconds:g} s.")
    return DONE if count else NO


def _tell_live(call: Call, unit: str, said: "Content") -> bool:
    """Print a note or an instance of a platform; whether it is an instance."""
    from dyknow.console.output.predictions import prediction_text
    from dyknow.federation.messages.contents import Expected, Reason, Recognised
    from dyknow.reasoning.chronicles.recognition.changes import symbol

    if isinstance(said, Reason):
        call.out.note(f"note: {said.text}")
    if not isinstance(said, Recognised | Expected):
        return False
    instants = {name: int(str(at_us)) for name, at_us in said.instants.items()}
    bindings = {name: symbol(found) for name, found in said.bindings.items()}
    words = [f"{name}={found}" for name, found in bindings.items()]
    words += [f"{name}={clock_time(at_us)}" for name, at_us in instants.items()]
    if isinstance(said, Expected):
        _tell_expected(call, unit, said, bindings, {name: _ms(at_us) for name, at_us in instants.items()}, words)
        return False
    made = {} if said.made_us is None else {"made_us": said.made_us}
    how = prediction_text({"valid_us": said.recognised_us, **made})
    call.out.say(
        line(f"{clock_time(said.recognised_us)}  ", styled(said.chronicle, "bold"), f"  {' '.join(words)}{how}"),
        unit=unit_json(unit),
        chronicle=said.chronicle,
        bindings=bindings,
        instants={name: _ms(at_us) for name, at_us in instants.items()},
        recognised_ms=_ms(said.recognised_us),
        **made,
    )
    return True


def _tell_expected(
    call: Call,
    unit: str,
    said: "Expected",
    bindings: dict[str, str | None],
    instants: dict[str, int],
    words: list[str],
) -> None:
    """Print what may become an instance, or that it will not."""
    until = "" if said.until_us is None else f" until {clock_time(said.until_us)}"
    state = "over" if said.over else f"waits for {'; '.join(said.missing)}{until}"
    call.out.say(
        line("  partial  ", styled(said.chronicle, "bold"), f"  {' '.join(words)}  ", styled(state, "dim")),
        unit=unit_json(unit),
        partial=said.chronicle,
        bindings=bindings,
        instants=instants,
        missing=list(said.missing),
        dies_ms=None if said.until_us is None else _ms(said.until_us),
        over=said.over,
    )


def _ms(at_us: int) -> int:
    return at_us // 1000
