"""Tables: columns where the terminal is wide enough, and otherwise a few lines for each row.

No word is broken unless it is longer than `LONG`: such a word is a key or a path.
"""

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

from rich import box
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from dyknow.console.output.shown import Shown, as_text, print_trimmed

LONG = 24
_BETWEEN, _EDGES = 3, 2
_GAP = "  "


class Column(NamedTuple):
    """The layout of a column's cells.

    Attributes:
        wraps: their lines may be broken between words.
        is_whole: they are to be copied, and are never broken, not even where the terminal is too narrow for them.
    """

    name: str
    is_right: bool = False
    wraps: bool = False
    is_whole: bool = False


def print_table(console: Console, title: str, columns: Sequence[Column], rows: Sequence[Sequence[Shown]]) -> None:
    """Print rows as a table, or, where that does not fit, as records."""
    texts = [[as_text(cell) for cell in row] for row in rows]
    widths = _widths(columns, texts, console.width)
    if widths is None:
        _print_records(console, title, columns, texts)
        return
    table = Table(title=title or None, box=box.SIMPLE_HEAD, title_justify="left", pad_edge=False, title_style="bold")
    for column, width in zip(columns, widths, strict=True):
        justify: Literal["left", "right"] = "right" if column.is_right else "left"
        table.add_column(column.name, justify=justify, overflow="fold", no_wrap=not column.wraps, width=width)
    for row in texts:
        table.add_row(*row)
    print_trimmed(console, table)


def _widths(columns: Sequence[Column], rows: list[list[Text]], available: int) -> list[int] | None:
    """The width of each column: of its text, or, if it wraps, a share of the rest that fits its words; None: no room."""
    least, most = [], []
    for at, column in enumerate(columns):
        lines = [Text(column.name), *(line for row in rows for line in row[at].split())]
        words = [Text(word) for line in lines for word in line.plain.split()]
        most.append(max((line.cell_len for line in lines), default=0))
        longest = max((word.cell_len for word in words), default=0)
        least.append(min(longest, LONG) if column.wraps else most[-1])
    left = available - _EDGES - _BETWEEN * (len(columns) - 1) - sum(least)
    if left < 0:
        return None
    widths = []
    for narrow, wide in zip(least, most, strict=True):
        more = min(left, wide - narrow)
        widths.append(narrow + more)
        left -= more
    return widths


def _print_records(console: Console, title: str, columns: Sequence[Column], rows: list[list[Text]]) -> None:
    if title:
        console.print(title, style="bold")
    for row in rows:
        for line, is_whole in _record(columns, row, console.width):
            print_trimmed(console, line, soft_wrap=is_whole)
        console.print()


def _record(columns: Sequence[Column], row: list[Text], width: int) -> Iterator[tuple[Text | Padding, bool]]:
    """(line, whether it must not be broken): short cells share lines, long ones have theirs under their name."""
    line = Text()
    for column, cell in zip(columns, row, strict=True):
        if not cell.plain:
            continue
        named = Text.assemble((column.name, "dim"), " " if column.name else "", cell)
        is_long = "\n" in cell.plain or named.cell_len > width
        if line and (is_long or line.cell_len + len(_GAP) + named.cell_len > width):
            yield line, False
            line = Text()
        if is_long:
            if column.name:
                yield Text(column.name, "dim"), False
            for part in cell.split():
                yield (Text.assemble(_GAP, part), True) if column.is_whole else (Padding.indent(part, len(_GAP)), False)
        else:
            line = Text.assemble(line, _GAP if line else "", named)
    if line:
        yield line, False
