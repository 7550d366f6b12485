"""`dyknow chronicle`: chronicles recognised in a recorded list of events, or live (`live_chronicle.py`)."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from console.command import Call
from console.errors import DONE, NO, WrongCall, did_you_mean
from console.instants import SHORTEST_US, duration_us
from console.output import verbatim
from dyknow.errors import ChronicleError, TextError

if TYPE_CHECKING:
    from reasoning.chronicles import ChronicleFile, Instance, Recogniser
    from reasoning.chronicles.events import RecordedEvent

_MOST_ROWS = 10_000
_LONGEST = 1024 * 1024


def chronicle(
    call: Call,
    file: Path,
    *,
    events: Path | None,
    max_age: str | None,
    unit: str | None,
    timeout: str,
    max_delay: str | None,
) -> int:
    """0 if something was recognised, 1 if nothing."""
    if (events is None) == (unit is None):
        raise WrongCall(
            "say where: --events FILE.jsonl for recorded events, or --unit U for the live streams of a platform."
        )
    if events is None:
        return _live(call, file, str(unit), timeout, max_delay, max_age)
    if max_delay is not None:
        raise WrongCall("--max-delay: recorded events are in order; it is for --unit U.")
    recogniser = _recogniser(file, max_age)
    run = _Run(call, recogniser, str(events))
    with _opened(events, "--events", "a list of events is a text of JSON lines") as lines:
        run.all(lines)
    run.notes()
    return DONE if run.count else NO


def _live(call: Call, file: Path, unit: str, timeout: str, max_delay: str | None, max_age: str | None) -> int:
    from console.live_chronicle import watch

    if max_age is not None:
        raise WrongCall("--max-age: a platform bounds what it remembers itself; it is for --events FILE.jsonl.")
    delay_s = None if max_delay is None else duration_us(max_delay, option="--max-delay", least_us=0) / 1e6
    return watch(
        call,
        file,
        unit=unit,
        seconds=duration_us(timeout, option="--timeout", least_us=SHORTEST_US) / 1e6,
        delay_s=delay_s,
    )


def chronicles_of(file: Path) -> "tuple[str, ChronicleFile]":
    """The text, and what it declares; raises WrongCall and TextErrors."""
    from kpl import parse_chronicles

    with _opened(file, "FILE", "chronicles are a text") as lines:
        text = lines.read(_LONGEST)
    found = parse_chronicles(text, str(file))
    if not found.chronicles:
        raise TextError("there is no chronicle", file=str(file), repair="chronicle name[?x] { event(...) }")
    return text, found


def _recogniser(file: Path, max_age: str | None) -> "Recogniser":
    from reasoning.chronicles import Recogniser

    _, found = chronicles_of(file)
    max_age_ms = None if max_age is None else duration_us(max_age, option="--max-age", least_us=1000) // 1000
    try:
        return Recogniser.of(found, max_age_ms=max_age_ms)
    except ChronicleError as error:
        raise WrongCall(f"{file}: {error}.") from None


@contextmanager
def _opened(path: Path, option: str, what: str) -> Iterator[TextIO]:
    try:
        file = path.open(encoding="utf-8")
    except OSError as error:
        raise WrongCall(f"{option}: {path} cannot be read ({error.strerror}); {what}.") from None
    with file:
        try:
            yield file
        except UnicodeDecodeError as error:
            raise WrongCall(f"{option}: {path} is no UTF-8 text ({error.reason}); {what}.") from None


class _Run:
    """One pass over the events."""

    def __init__(self, call: Call, recogniser: "Recogniser", file: str) -> None:
        self.count = 0
        self._out, self._recogniser, self._file = call.out, recogniser, file
        self._rows: list[tuple[str, str, str, str]] = []
        self._seen: set[str] = set()
        self._values: dict[object, str] = {}
        self._jumped: tuple[int, str] | None = None
        self._ignored, self._ignored_line = 0, 0

    def all(self, lines: TextIO) -> None:
        from reasoning.chronicles.events import read_events
        from reasoning.json_lines import LIMIT_LINE

        pieces = iter(partial(lines.readline, LIMIT_LINE + 2), "")
        for event in read_events(pieces, self._file):
            for instance in event.told_to(self._recogniser):
                self._tell(instance)
            self._watch(event)
        self._print()

    def _watch(self, event: "RecordedEvent") -> None:
        """Keep what a person should know of the events themselves."""
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

    def _tell(self, instance: "Instance") -> None:
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
        self._rows.append(
            (str(_shown(instance.recognised_ms)), instance.chronicle, verbatim(bindings), verbatim(times))
        )
        if len(self._rows) >= _MOST_ROWS:
            self._print()

    def _print(self) -> None:
        if self._rows:
            columns = ("t_ms", "chronicle", "variables", "instants")
            self._out.table("", columns, self._rows, right=("t_ms",), wraps=("variables", "instants"))
            self._rows.clear()

    def notes(self) -> None:
        """What is beside the result: what was ignored, what is missing, what was still open."""
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
                f'a last line {{"t_ms": ...}} tells until when nothing did.'
            )


def _shown(at_ms: int) -> int | str:
    from reasoning.chronicles import MINUS_INFINITY

    return "-oo" if at_ms == MINUS_INFINITY else at_ms
