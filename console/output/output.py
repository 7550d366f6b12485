"""Output of a command: JSON lines or tables on standard output; progress, notes and errors on standard error."""

import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from textwrap import fill
from typing import TYPE_CHECKING, Any, TextIO, cast

from dyknow.console.output.shown import Shown, as_text, line, print_trimmed, printable, styled
from dyknow.model.values import as_json

_JSON = json.JSONEncoder(separators=(",", ":"), allow_nan=False, default=as_json)
"""One for all lines."""

if TYPE_CHECKING:
    from rich.console import Console


def unit_json(unit: str) -> int | str:
    """A unit as JSON shows it: a number where it is one."""
    return int(unit) if unit.isdigit() else unit


def counted(number: int, what: str) -> str:
    """`1 error`, `2 errors`."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


class Output:
    """Where a command's words go. With `json_lines` standard output carries one JSON object a line, nothing else."""

    def __init__(self, *, json_lines: bool) -> None:
        self.json_lines = json_lines
        self._out: Console | None = None
        self._err: Console | None = None
        self._held: TextIO | None = None

    def hold(self) -> None:
        """Keep standard output for this command from now on: prints of other code go to standard error."""
        self._held, sys.stdout = sys.stdout, sys.stderr

    def outlast(self) -> None:
        """Continue when the terminal is closed, or the reader has gone: output that cannot be written is dropped."""
        sys.stdout, sys.stderr = _outlasting(sys.stdout), _outlasting(sys.stderr)
        self._held = None if self._held is None else _outlasting(self._held)
        self._out = self._err = None

    @property
    def _console(self) -> "Console":
        """Standard output as text."""
        if self._out is None:
            from rich.console import Console

            self._out = Console(highlight=False, markup=False, emoji=False, file=self._held)
        return self._out

    @property
    def width(self) -> int:
        """The width of standard output, in characters."""
        return self._console.width

    def clear(self) -> None:
        """Clear the terminal; output to a file is not cleared."""
        if self._console.is_terminal and not self.json_lines:
            self._console.clear()

    def show(self, *parts: Shown, whole: bool = False) -> None:
        """One line of text; with `whole` the terminal breaks it where it ends."""
        print_trimmed(self._console, line(*parts), soft_wrap=whole)

    @property
    def _terminal(self) -> "Console":
        """Standard error: progress and notes."""
        if self._err is None:
            from rich.console import Console

            self._err = Console(stderr=True, highlight=False, markup=False, emoji=False)
        return self._err

    def line(self, record: Mapping[str, Any]) -> None:
        """One JSON object, at once; a missing value is null."""
        stream = self._held or sys.stdout
        stream.write(_JSON.encode(record) + "\n")
        stream.flush()

    def say(self, text: Shown, /, **record: Any) -> None:
        """One event: `record` as a JSON line, or `text`."""
        if self.json_lines:
            self.line(record)
        else:
            self.show(text)

    def item(self, cells: tuple[Shown, Shown, Shown], **record: Any) -> None:
        """One event with a mark and a name; the text stays in its column when it needs several lines."""
        if self.json_lines:
            self.line(record)
            return
        from rich.table import Table

        grid = Table.grid(padding=(0, 2))
        for width in (6, 10, None):
            grid.add_column(min_width=width, overflow="fold")
        grid.add_row(*map(as_text, cells))
        print_trimmed(self._console, grid)

    def aside(self, when: str, text: Shown) -> None:
        """As text: an event after its time, indented also where it needs several lines."""
        from rich.table import Table

        grid = Table.grid(padding=(0, 2))
        grid.add_column(no_wrap=True)
        grid.add_column(overflow="fold")
        grid.add_row(styled(when, "dim"), as_text(text))
        print_trimmed(self._console, grid)

    def table(
        self,
        title: str,
        columns: Sequence[str],
        rows: Sequence[Sequence[Shown]],
        *,
        right: Sequence[str] = (),
        wraps: Sequence[str] = (),
        whole: Sequence[str] = (),
    ) -> None:
        """A table, readable also where the terminal is narrow.

        Those named in `right` are flushed right, those in `wraps` may be broken between words; those in `whole`,
        which are to be copied, are never broken.
        """
        from dyknow.console.output.tables import Column, print_table

        described = [Column(name, name in right, name in wraps, name in whole) for name in columns]
        print_table(self._console, title, described, rows)

    def plain(self, text: str, *, folds: bool = False) -> None:
        """Lines as they are; with `folds` those that are too long for the terminal continue below, indented."""
        text = printable(text)
        if folds:
            text = "".join(f"{folded(line, self._console.width)}\n" for line in text.splitlines())
        self._console.print(text, end="", soft_wrap=True)

    def note(self, text: str, *, style: str | None = None) -> None:
        """A note on standard error."""
        self._terminal.print(styled(text, style or ""), soft_wrap=True)

    @contextmanager
    def waiting(self, text: str) -> Iterator[Callable[[str], None]]:
        """A spinner while something is awaited, on a terminal only; yields a function that changes its text."""
        if self.json_lines or not self._terminal.is_terminal:
            yield lambda _text: None
            return
        with self._terminal.status(as_text(text)) as status:
            yield lambda text: status.update(as_text(text))


class _Outlasting:
    """A stream whose writing never fails."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        with suppress(OSError, ValueError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError, ValueError):
            self._stream.flush()


def _outlasting(stream: TextIO) -> TextIO:
    return cast("TextIO", _Outlasting(stream))


def folded(line: str, width: int) -> str:
    """A line that is too long for the terminal continues below, indented more than it begins."""
    indent = line[: len(line) - len(line.lstrip())]
    return fill(
        line.lstrip(),
        max(width, 20),
        initial_indent=indent,
        subsequent_indent=f"{indent}      ",
        break_long_words=False,
        break_on_hyphens=False,
    )
