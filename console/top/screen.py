"""The screen of `dyknow top`: one table at a time, in the terminal. All text in it is only text."""

from collections.abc import Callable
from typing import ClassVar

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import DataTable, Footer, Input, Static

from dyknow.console.output.shown import printable
from dyknow.console.top.gathered import TABLES, Row, TopSnapshot

LOOK_S = 0.5
_STYLES = {"bad": "red", "warn": "yellow"}


class DetailsScreen(ModalScreen[None]):
    """All of one row."""

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape,enter,q", "dismiss", "back")]
    DEFAULT_CSS = (
        "DetailsScreen { align: center middle; } #details { width: 90%; height: 80%; border: round $primary; }"
    )

    def __init__(self, details: str) -> None:
        super().__init__()
        self._details = details

    def compose(self) -> ComposeResult:
        with VerticalScroll(id="details"):
            yield Static(Text(printable(self._details)), markup=False)
        yield Footer()


class TopApp(App[None]):
    """The tables of a federation.

    Args:
        snapshot: the newest look at it; asked for twice a second.

    Attributes:
        table: which table is shown.
        sorted_by: the column it is sorted by, None as it comes; `is_reversed`: from the greatest.
        wanted: only rows that have this text in a cell are shown.
    """

    ENABLE_COMMAND_PALETTE = False
    DEFAULT_CSS = """
    #title { height: 1; background: $primary; color: $text; }
    #filter { display: none; height: 3; }
    #filter.open { display: block; }
    DataTable { height: 1fr; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        *(Binding(str(at), f"show('{name}')", name) for at, name in enumerate(TABLES, 1)),
        Binding("s", "sort", "sort"),
        Binding("r", "reverse", "reverse"),
        Binding("slash", "filter", "filter"),
        Binding("escape", "clear", "all"),
        Binding("space", "pause", "pause"),
        Binding("q", "quit", "quit"),
    ]

    def __init__(self, snapshot: Callable[[], TopSnapshot]) -> None:
        super().__init__()
        self._snapshot = snapshot
        self._shown = TopSnapshot("looking for platforms")
        self.table = next(iter(TABLES))
        self.sorted_by: int | None = None
        self.is_reversed = self._is_paused = False
        self.wanted = ""
        self._rows: list[Row] = []

    def compose(self) -> ComposeResult:
        yield Static("", id="title", markup=False)
        yield Input(placeholder="only rows with", id="filter")
        yield DataTable(cursor_type="row", zebra_stripes=True)
        yield Footer()

    def on_mount(self) -> None:
        """Begin to look."""
        self.query_one(DataTable).focus()
        self.action_show(self.table)
        self.set_interval(LOOK_S, self.look)

    def look(self) -> None:
        """Take the newest snapshot and draw it, unless the screen is held still, or is being closed: a tick may come."""
        if not self._is_paused and self.query(DataTable):
            self._shown = self._snapshot()
            self._draw()

    # -- keys --------------------------------------------------------------------------------------------------

    def action_show(self, name: str) -> None:
        """Another table."""
        self.table, self.sorted_by, self.is_reversed = name, None, False
        self._draw_columns()
        self.look()

    def action_sort(self) -> None:
        """By the next column; after the last one as it comes."""
        by = -1 if self.sorted_by is None else self.sorted_by
        self.sorted_by = by + 1 if by + 1 < len(TABLES[self.table]) else None
        self._draw_columns()
        self._draw()

    def action_reverse(self) -> None:
        """The other way round."""
        self.is_reversed = not self.is_reversed
        self._draw_columns()
        self._draw()

    def action_filter(self) -> None:
        """Write what rows are to have."""
        field = self.query_one("#filter", Input)
        field.add_class("open")
        field.focus()

    def action_clear(self) -> None:
        """All rows again."""
        field = self.query_one("#filter", Input)
        field.value, self.wanted = "", ""
        field.remove_class("open")
        self.query_one(DataTable).focus()
        self._draw()

    def action_pause(self) -> None:
        """Hold the screen still, or continue."""
        self._is_paused = not self._is_paused
        self._draw()

    def on_input_changed(self, event: Input.Changed) -> None:
        """The filter is being written."""
        self.wanted = event.value.casefold()
        self._draw()

    def on_input_submitted(self, _event: Input.Submitted) -> None:
        """The filter is written: back to the rows."""
        self.query_one(DataTable).focus()

    def on_data_table_row_selected(self, event: "DataTable.RowSelected") -> None:
        """Open a row."""
        found = next((row for row in self._rows if row.key == event.row_key.value), None)
        if found is not None:
            self.push_screen(DetailsScreen(found.details))

    # -- drawing -----------------------------------------------------------------------------------------------

    def _draw_columns(self) -> None:
        table = self.query_one(DataTable)
        table.clear(columns=True)
        for at, name in enumerate(TABLES[self.table]):
            arrow = (" ▼" if self.is_reversed else " ▲") if at == self.sorted_by else ""
            table.add_column(Text(f"{name}{arrow}", style="bold"), key=name)

    def _draw(self) -> None:
        table = self.query_one(DataTable)
        at = table.cursor_row
        key = self._rows[at].key if 0 <= at < len(self._rows) else None
        self._rows = self._chosen()
        table.clear()
        for row in self._rows:
            style = _STYLES.get(row.level, "")
            table.add_row(*(Text(printable(cell), style=style, no_wrap=True) for cell in row.cells), key=row.key)
        again = next((place for place, row in enumerate(self._rows) if row.key == key), None)
        if self._rows:
            table.move_cursor(row=min(at, len(self._rows) - 1) if again is None else again)
        still = "  (paused)" if self._is_paused else ""
        hidden = len(self._shown.tables.get(self.table, ())) - len(self._rows)
        left_out = f"  {hidden} rows filtered" if hidden else ""
        self.query_one("#title", Static).update(Text(printable(f"{self.table}  {self._shown.title}{left_out}{still}")))

    def _chosen(self) -> list[Row]:
        """The rows that are wanted, each once, in their order."""
        found = {row.key: row for row in self._shown.tables.get(self.table, ())}
        rows = [row for row in found.values() if any(self.wanted in cell.casefold() for cell in row.cells)]
        by = self.sorted_by
        if by is not None:
            rows.sort(key=lambda row: _sortable(row.order[by]))
        return rows[::-1] if self.is_reversed else rows


def _sortable(value: str | float | None) -> tuple[int, float, str]:
    """Numbers first, then texts, what has no value last."""
    if value is None:
        return 2, 0.0, ""
    return (1, 0.0, value) if isinstance(value, str) else (0, float(value), "")
