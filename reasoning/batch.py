"""Many instances of one formula, stepped together as arrays on one automaton (`automaton.py`).

A formula with free variables, such as `always xy_dist[a, b] >= 15.0`, has an instance for each binding of them; what an
instance reads stands in its row of the columns, which are named as the formula writes its features: `xy_dist[a, b]`.
Instances come and go: `rearrange`.

    batch = Batch(formula, 1225, period_us=100_000)
    batch.progress(valid_us, {"xy_dist[a, b]": distances_m})
    numpy.flatnonzero(batch.false)
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dyknow.values import NO_VALUE
from reasoning.automaton import State, automaton, moved
from reasoning.clauses import DECIDED, FALSE, TRUE, Clauses, size
from reasoning.columns import Column, Reader, Scene, is_missing
from reasoning.evaluation import Compiler, Moment, NoValuePolicy
from reasoning.explaining import Explainer, Reason
from reasoning.formulas import LIMIT_NODES, Domains, Formula, required_labels, too_large
from reasoning.shapes import take_apart

_NO_DOMAINS: Domains = MappingProxyType({})
_UNMET: Final = -1
_BEGINNING: Final = 3
_WIDEST: Final = 10
"""With more atoms than that letters are looked up one by one."""
LIMIT_CELLS: Final = 50 * LIMIT_NODES
"""So many values may a state of all instances have, a node of the formula counted once for each."""
Rows = NDArray[np.intp]


class Batch:
    """`count` instances of a formula.

    Args:
        formula: checked; variables that no quantifier binds tell instances apart.
        count: how many instances there are.
        period_us: the sample period of the states if it is known: then no state lies closer to another.
        no_value: what an atom over a missing value counts as; `skip` leaves an instance out of states in which a
            feature has none.
        domains: what the formula's quantifiers range over.

    Raises:
        Grows: if a growing quantifier stands over a temporal body, or over a `since`.
        TextError, UnknownLabel: as `Progression.progress`.
    """

    def __init__(
        self,
        formula: Formula,
        count: int,
        period_us: int | None = None,
        no_value: NoValuePolicy = "undecided",
        domains: Domains | None = None,
    ) -> None:
        compiler = self._compiler = Compiler(domains, no_value)
        self.formula = formula
        self.taken_apart = take_apart(formula, compiler.domains, compiler)
        self.labels = required_labels(formula, compiler.domains)
        self._skips = no_value == "skip"
        self._automaton = automaton(self.taken_apart.shape, period_us)
        reading = Compiler(domains, no_value)
        self._reader = Reader(self.taken_apart.atoms, reading, count)
        if count * (LIMIT_NODES - reading.nodes_left) > LIMIT_CELLS:
            raise too_large()
        self._since = {label: _Since(count) for label in self._reader.since}
        atoms = self.taken_apart.shape.atoms
        self._width = 3 if atoms <= 1 else 4
        self._letters: list[int] = [0, 1, 2] if atoms <= 1 else []
        self._column_of = np.full(3**atoms, _UNMET, np.intp) if 1 < atoms <= _WIDEST else None
        self._columns: dict[int, int] = {}
        self._tables: dict[int, Rows] = {}
        self._rows: Rows = np.full(count, _BEGINNING * self._width, np.intp)
        self._index: Rows = np.empty(count, np.intp)
        self._valid_us: int | None = None
        self._each_us: NDArray[np.int64] | None = None
        self._loose: list[Clauses | None] | None = None
        self._scene: Scene | None = None
        self._before_us = 0

    def __len__(self) -> int:
        return len(self._rows) if self._loose is None else len(self._loose)

    @property
    def false(self) -> NDArray[np.bool_]:
        """Which instances are false."""
        if self._loose is not None:
            return np.asarray([left == FALSE for left in self._loose], np.bool_)
        found: NDArray[np.bool_] = self._rows == 0
        return found

    @property
    def true(self) -> NDArray[np.bool_]:
        """Which instances are true."""
        if self._loose is not None:
            return np.asarray([left is not None and left == TRUE for left in self._loose], np.bool_)
        found: NDArray[np.bool_] = self._rows == self._width
        return found

    @property
    def decided(self) -> NDArray[np.bool_]:
        """Which instances no further state can change: true, false, or undecided for ever."""
        if self._loose is not None:
            return np.asarray([left is not None and left in DECIDED for left in self._loose], np.bool_)
        found: NDArray[np.bool_] = self._rows < _BEGINNING * self._width
        return found

    @property
    def way(self) -> str:
        return "batch" if self._loose is None else "deadlines"

    @property
    def kept(self) -> int:
        """How many obligations are left in all instances."""
        if self._loose is not None:
            return sum(size(left) for left in self._loose if left is not None)
        states, counts = np.unique(self._rows // self._width, return_counts=True)
        found = self._automaton.states
        return sum(size(found[state].clauses) * int(count) for state, count in zip(states, counts, strict=True))

    def explain(self, row: int) -> tuple[Reason, ...]:
        """Why the last state made this instance true or false; nothing if it did not."""
        if self._loose is not None or self._scene is None or not (self.true[row] or self.false[row]):
            return ()
        scene = self._scene
        state, place = divmod(int(self._index[row]), self._width)
        letter = self._letters[place]
        before = self._automaton.states[state]
        if before.is_decided:
            return ()
        values = {label: _one_of(scene.columns.get(label, NO_VALUE), row) for label in self.labels}
        moment = Moment(scene.valid_us, values, scene.domains)
        left = None if state == _BEGINNING else moved(before.clauses, self._before_us)
        progressor = self._automaton.progressor
        explainer = Explainer(self.taken_apart, progressor, self._compiler, left, progressor.letter(letter), moment)
        return explainer.reasons(truth=bool(self.true[row]))

    def rearrange(self, rows: NDArray[np.intp]) -> None:
        """Instance i becomes what instance `rows[i]` was; -1 makes a new one."""
        fresh = rows < 0
        if self._loose is not None:
            self._loose = [None if row < 0 else self._loose[row] for row in rows]
        else:
            kept = self._rows[rows] if len(self._rows) else np.empty(len(rows), np.intp)
            kept[fresh] = _BEGINNING * self._width
            self._rows, self._index = kept, np.empty(len(rows), np.intp)
        if self._each_us is not None:
            self._each_us = np.where(fresh, 0, self._each_us[rows])
        for since in self._since.values():
            since.rearrange(rows)
        self._reader.resize(len(rows))

    def progress(
        self,
        valid_us: int,
        columns: Mapping[str, Column],
        domains: Domains | None = None,
        present: NDArray[np.bool_] | None = None,
        events: Mapping[str, Column] = MappingProxyType({}),
    ) -> None:
        """Take one state of all instances, or of those that are `present`.

        Args:
            valid_us: its time.
            columns: by label, an array with one value per instance, or one value for all; NaN where there is none.
            domains: as they are now, for quantifiers that grow over one state.
            present: which instances have a state; the others are left as they are.
            events: by label, for which instances it happened; for none if it is not given.

        Raises:
            ValueError: if the state is not later than the one before.
        """
        last_us = self._valid_us
        if last_us is not None and valid_us <= last_us:
            raise ValueError(f"states go forward in time: {valid_us} us after {last_us} us")
        if self._skips:
            present = self._complete(columns, present)
        since_us = {
            name: since.after(valid_us, columns.get(name, NO_VALUE), present) for name, since in self._since.items()
        }
        scene = self._scene = Scene(valid_us, columns, domains or _NO_DOMAINS, events, since_us)
        self._before_us = last_us or 0
        letters = self._reader.read(scene)
        if self._loose is not None:
            self._by_deadlines(valid_us, letters, present)
        elif present is None and self._each_us is None:
            offset = 0 if last_us is None else self._automaton.gap(valid_us - last_us)
            if offset is None:
                self._loosen()
                self._by_deadlines(valid_us, letters, present)
            else:
                self._step(offset, letters, valid_us)
        else:
            self._apart(valid_us, letters, present)
        self._valid_us = valid_us

    # -- on the automaton --------------------------------------------------------------------------------------

    def _step(self, offset: int, letters: NDArray[Any], valid_us: int) -> None:
        """All instances, after one gap."""
        places = letters if self._width == 3 else self._found(letters)
        table = self._tables.get(offset)
        if table is None:
            table = self._tables[offset] = np.full(64 * self._width, _UNMET, np.intp)
        index, rows = self._index, self._rows
        np.add(rows, places, index)
        table.take(index, None, rows, "clip")
        if len(rows) and rows[rows.argmin()] < 0:
            self._meet(offset, valid_us, letters, np.arange(len(rows)))

    def _found(self, letters: NDArray[Any]) -> NDArray[Any]:
        """Where in the width of the table each letter stands; letters get their places as they are met."""
        if self._column_of is not None:
            found: NDArray[np.intp] = self._column_of.take(letters)
            if len(found) and found.min() >= 0:
                return found
        for letter in np.unique(letters).tolist():
            if letter not in self._columns:
                self._columns[letter] = len(self._letters)
                self._letters.append(letter)
                if self._column_of is not None:
                    self._column_of[letter] = self._columns[letter]
        if len(self._letters) > self._width:
            self._widen()
        if self._column_of is not None:
            return self._column_of.take(letters)
        return np.fromiter((self._columns[letter] for letter in letters.tolist()), np.intp, len(letters))

    def _widen(self) -> None:
        old, self._width = self._width, 2 * self._width
        while self._width < len(self._letters):
            self._width *= 2
        for offset, table in self._tables.items():
            wide = np.full((len(table) // old, self._width), _UNMET, np.intp)
            known = table.reshape(-1, old)
            wide[:, :old] = np.where(known < 0, _UNMET, known // old * self._width)
            self._tables[offset] = wide.ravel()
        self._rows = self._rows // old * self._width

    def _meet(self, offset: int, valid_us: int, letters: NDArray[Any], rows: Rows) -> None:
        """Work out the transitions that these rows have just missed."""
        index = self._index[: len(rows)] if len(rows) == len(self._rows) else self._index[rows]
        missed = self._rows[rows] < 0
        width, known = self._width, self._automaton
        for one in np.unique(index[missed]).tolist():
            if known.is_full:
                self._rows[rows[missed]] = index[missed] // width * width
                self._loosen(rows[~missed], valid_us)
                self._by_deadlines(valid_us, letters, np.isin(np.arange(len(self)), rows[missed]))
                return
            state, place = divmod(one, width)
            after = known.step(known.states[state], offset + self._letters[place])
            self._tables[offset] = table = _grown(self._tables[offset], width * len(known.states))
            table[one] = after.number * width
        self._rows[rows[missed]] = self._tables[offset][index[missed]]

    def _apart(self, valid_us: int, letters: NDArray[Any], present: NDArray[np.bool_] | None) -> None:
        """Instances whose states before this one lie at different times, or of which not all have a state now."""
        if self._each_us is None:
            self._each_us = np.full(len(self._rows), self._valid_us or valid_us, np.int64)
        here = np.ones(len(self._rows), np.bool_) if present is None else present
        places = letters if self._width == 3 else self._found(letters)
        fresh = self._rows == _BEGINNING * self._width
        gaps_us = np.where(fresh, 0, valid_us - self._each_us)
        for gap_us in np.unique(gaps_us[here]).tolist():
            offset = 0 if gap_us == 0 else self._automaton.gap(gap_us)
            rows = np.flatnonzero(here & (gaps_us == gap_us))
            if offset is None:
                self._loosen(np.flatnonzero(here & (gaps_us < gap_us)), valid_us)
                self._by_deadlines(valid_us, letters, here & (gaps_us >= gap_us))
                break
            table = self._tables.setdefault(offset, np.full(64 * self._width, _UNMET, np.intp))
            index = self._rows[rows] + np.asarray(places)[rows]
            self._index[rows] = index
            self._rows[rows] = table.take(index, mode="clip")
            if self._rows[rows].min() < 0:
                self._meet(offset, valid_us, letters, rows)
            if self._loose is not None:
                rest = here & (gaps_us > gap_us)
                self._by_deadlines(valid_us, letters, rest)
                break
        self._each_us[here] = valid_us

    def _complete(self, columns: Mapping[str, Column], present: NDArray[np.bool_] | None) -> NDArray[np.bool_]:
        """Which instances have a value of every feature."""
        here = np.ones(len(self), np.bool_) if present is None else present.copy()
        for label in self.labels:
            here &= ~np.broadcast_to(is_missing(columns.get(label, NO_VALUE)), here.shape)
        return here

    # -- with deadlines ----------------------------------------------------------------------------------------

    def _loosen(self, done: Rows | None = None, valid_us: int = 0) -> None:
        """The automaton is full, or states come at too many different gaps: keep what is left by itself.

        `done` are rows that have taken the state at `valid_us` already.
        """
        last_us = np.full(len(self._rows), self._valid_us or 0, np.int64) if self._each_us is None else self._each_us
        if done is not None:
            last_us = last_us.copy()
            last_us[done] = valid_us
        states = [self._automaton.states[at] for at in (self._rows // self._width).tolist()]
        self._loose = [_loose(state, int(us)) for state, us in zip(states, last_us, strict=True)]

    def _by_deadlines(self, valid_us: int, letters: NDArray[Any], present: NDArray[np.bool_] | None) -> None:
        assert self._loose is not None  # noqa: S101 - tells the type checker what loosening made sure of
        progressor, read = self._automaton.progressor, np.asarray(letters, np.intp).tolist()
        for row, left in enumerate(self._loose):
            if present is not None and not present[row]:
                continue
            letter = progressor.letter(read[row])
            if left is None:
                self._loose[row] = moved(progressor.start(letter), valid_us)
            else:
                self._loose[row] = progressor.step(left, letter, valid_us, 0)


def _loose(state: State, valid_us: int) -> Clauses | None:
    return None if state.number == _BEGINNING else moved(state.clauses, valid_us)


def _one_of(column: Column, row: int) -> Any:
    found = np.asarray(column)
    return found[row].item() if found.shape and found.dtype != object else found[row] if found.shape else column


def _grown(table: Rows, least: int) -> Rows:
    """The table, twice as long if it has to be."""
    if len(table) >= least:
        return table
    longer = np.full(max(least, 2 * len(table)), _UNMET, np.intp)
    longer[: len(table)] = table
    return longer


class _Since:
    """When a feature of each instance last changed; its first value is a change."""

    def __init__(self, count: int) -> None:
        self._last: NDArray[Any] = np.full(count, None, object)
        self._changed_us = np.full(count, np.nan)

    def after(self, valid_us: int, column: Column, present: NDArray[np.bool_] | None) -> NDArray[np.float64]:
        """The time since then in microseconds, NaN where there is no value."""
        values = np.broadcast_to(np.asarray(column, object), self._last.shape)
        missing = np.broadcast_to(is_missing(column), self._last.shape)
        changed = ~missing & (self._last != values)
        if present is not None:
            changed &= present
        self._last[changed] = values[changed]
        self._changed_us[changed] = valid_us
        return np.where(missing, np.nan, valid_us - self._changed_us)

    def rearrange(self, rows: Rows) -> None:
        fresh = rows < 0
        last, changed_us = self._last, self._changed_us
        self._last, self._changed_us = np.full(len(rows), None, object), np.full(len(rows), np.nan)
        self._last[~fresh], self._changed_us[~fresh] = last[rows[~fresh]], changed_us[rows[~fresh]]
