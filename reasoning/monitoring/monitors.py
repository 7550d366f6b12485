"""Monitors: a formula, the state of its inputs, and its alarms (thesis 7.5; F4, F5, F8).

A value stepped by `on_state` and `on_time`, which return alarms that opened and closed, and by `end`, which returns
ended ones. Federation time.
"""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from math import isfinite
from typing import Literal, TypeAlias

from dyknow.model.errors import TextError, UnknownLabel
from dyknow.model.sample import Value
from dyknow.reasoning.formulas.evaluation import Moment, NoValuePolicy
from dyknow.reasoning.formulas.tree import Always, Domains, Exists, Forall, Formula, required_labels, walk
from dyknow.reasoning.monitoring.alarms import AlarmEvent, Change, Watch, opening
from dyknow.reasoning.monitoring.inputs import Freshness, MonitorInputs
from dyknow.reasoning.monitoring.margins import Margins
from dyknow.reasoning.progression.automaton import Verdict
from dyknow.reasoning.progression.changes import Changes, lacking
from dyknow.reasoning.progression.engine import Progressing, make_progression
from dyknow.reasoning.progression.explaining import Explanation
from dyknow.reasoning.progression.restarting import restartable

_new = tuple.__new__  # makes a NamedTuple in half the time; every state of a monitor is one

MARGIN_STATES = 300
"""States after the last question for which margins are computed."""
Shown: TypeAlias = Literal["ok", "alarm", "unknown"]


class Monitor:
    """One formula over one set of objects.

    `always phi` raises alarms again and again (F8); any other formula raises one, when it turns false.

    Args:
        name: of the monitor, e.g. `proximity`; part of the ids of its alarms.
        formula: checked, without free variables.
        key: the units it is about; the first is the platform that monitors, unless `by` says otherwise.
        period_us: sample period of its states.
        max_delay_us: how long a state may wait for its inputs.
        no_value: the truth of an atom over `no_value` (F5); `skip` leaves out states that lack an input.
        close_after: how many states in a row must satisfy phi to close an alarm.
        inputs: names of the inputs of the states, for `missing_inputs`; the formula's labels by default.
        domains: members of the domains it quantifies over, where states do not bring them.
        since_us: when the monitor was set up.

    Attributes:
        counted: states that harm nothing, by reason: `out of order` and `duplicate` ones are ignored, `missing` an
            input; of these with a `NaN`.
    """

    def __init__(
        self,
        name: str,
        formula: Formula,
        key: tuple[str, ...],
        period_us: int,
        max_delay_us: int,
        no_value: NoValuePolicy = "undecided",
        close_after: int = 2,
        *,
        by: str | None = None,
        inputs: Sequence[str] | None = None,
        domains: Domains | None = None,
        since_us: int = 0,
    ) -> None:
        self.name, self.formula, self.key = name, formula, key
        self.by = by if by is not None else (key[0] if key else "")
        self.period_us, self.max_delay_us = period_us, max_delay_us
        self.no_value: NoValuePolicy = no_value
        self.alarm_id: str | None = None
        self._close_after = close_after
        self._domains: Domains = domains or {}
        self._quantified = any(isinstance(node, Forall | Exists) for node in walk(formula))
        self._seen: dict[str, tuple[str, ...]] | None = None
        self._labels = () if self._quantified else required_labels(formula)
        self._inputs = MonitorInputs(self._labels if inputs is None else inputs, period_us, max_delay_us, since_us)
        self.counted: Counter[str] = Counter()
        self._changes = Changes(formula)
        self._watch: Watch | _Once | None = None
        self._valid_us: int | None = None
        self._doubtful = False
        self._margins: Margins | None = None
        self._margin: float | None = None
        self._margin_wanted = 0

    @property
    def deadline_us(self) -> int | None:
        return self._inputs.deadline_us

    @property
    def verdict(self) -> Verdict:
        """Of the formula; for `always phi` it is false while an alarm is open, since phi is monitored again (F8)."""
        return "undecided" if self._watch is None else _verdict(self._watch)

    @property
    def explanation(self) -> tuple[Explanation, ...]:
        """Why its alarm opened last: which part of the formula, for which members, since when, by which samples."""
        watch = self._watch
        return () if watch is None else watch.explain()

    @property
    def inputs(self) -> Freshness:
        return self._inputs.state

    @property
    def inputs_since_us(self) -> int:
        return self._inputs.since_us

    @property
    def missing_inputs(self) -> tuple[str, ...]:
        """Which inputs lack; empty while they are fresh."""
        return self._inputs.which

    @property
    def reasons(self) -> Mapping[str, str]:
        """Why inputs were marked missing: gone, skewed."""
        return self._inputs.marked

    def margin(self) -> float | None:
        """How far the formula is from being violated in the newest state for which that is known; below 0: it is.

        Computed of the next states once it was asked for; None where there is none: a window without an end, a value
        that is missing, inputs that are not fresh.
        """
        if self._margin_wanted == 0:
            self._margins, self._margin = self._make_margins(), None
        self._margin_wanted = MARGIN_STATES
        return self._margin if self._inputs.state == "fresh" else None

    def _make_margins(self) -> Margins | None:
        try:
            return None if self._quantified else Margins(self.formula, self._domains, self.period_us)
        except (TextError, UnknownLabel):
            return None

    def _measure(self, valid_us: int, values: Mapping[str, Value], events: Collection[str]) -> None:
        self._margin_wanted -= 1
        if self._margins is not None:
            for known in self._margins.progress(valid_us, values, events):
                self._margin = None if known.value is None or not isfinite(known.value) else known.value

    @property
    def shows(self) -> Shown:
        """The state for users: never safe while inputs are not fresh, or while the newest state decides nothing."""
        if self._inputs.state != "fresh":
            return "unknown"
        if self.verdict == "false":
            return "alarm"
        return "unknown" if self._doubtful else "ok"

    def on_state(
        self,
        valid_us: int,
        now_us: int,
        values: Mapping[str, Value],
        *,
        lacks: tuple[str, ...] | None = None,
        domains: Domains | None = None,
        events: Collection[str] = (),
        samples_us: Mapping[str, int] | None = None,
    ) -> list[AlarmEvent]:
        """Take one state.

        Args:
            valid_us: its time; a state not later than the last is ignored.
            now_us: federation time now.
            values: by label; `NO_VALUE` or absent where there is none.
            lacks: names of inputs without a value; by default the formula's labels without one.
            domains: as they are now, for quantifiers; by default those of the constructor.
            events: labels of the events.
            samples_us: valid times of the samples it was made of, by input; by default that of the state, of all inputs
                that do not lack.
        """
        if self._valid_us is not None and valid_us <= self._valid_us:
            self.counted["duplicate" if valid_us == self._valid_us else "out of order"] += 1
            return []
        self._valid_us = valid_us
        domains = self._domains if domains is None else domains
        if self._quantified:
            self._read_domains(domains)
        if lacks is None:
            lacks = lacking(self._labels, values)
        if lacks:
            self.counted["missing"] += 1
            if any(value != value for value in map(values.get, lacks)):  # noqa: PLR0124 - a NaN differs from itself
                self.counted["NaN"] += 1
        inputs = self._inputs
        inputs.on_state(valid_us, now_us, lacks)
        if inputs.marked:
            values = {}
        if self._margin_wanted:
            self._measure(valid_us, values, events)
        if self.no_value == "skip" and lacking(self._labels, values):
            found = None
        else:
            changed_us = self._changes.after(valid_us, values)
            watch = self._watch
            if watch is None:
                watch = self._watch = self._activate(domains)
            if samples_us is None and lacks:
                samples_us = {name: valid_us for name in inputs.names if name not in lacks}
            found = watch.on_moment(_new(Moment, (valid_us, values, domains, events, changed_us)), samples_us)
            self._doubtful = watch.doubtful and not lacks
            if inputs.state != "fresh" and isinstance(watch, Watch):
                watch.forget_clean()
        due_us = inputs.deadline_us
        if due_us is not None and now_us >= due_us:
            self.on_time(now_us)
        return [self._event(found, now_us)] if found else []

    def on_clear(self, valid_us: int, now_us: int) -> bool:
        """Take a complete state in which phi of `always phi`, about one state, is known to hold.

        Does what `on_state` would with it, if that is nothing but noting that it came; false: call `on_state`.
        """
        watch, inputs, last_us = self._watch, self._inputs, self._valid_us
        if last_us is None or valid_us <= last_us or inputs.marked or not isinstance(watch, Watch) or watch.is_busy:
            return False
        self._valid_us, self._doubtful, self._margin = valid_us, False, None
        inputs.on_state(valid_us, now_us, ())
        due_us = inputs.deadline_us
        if due_us is not None and now_us >= due_us:
            self.on_time(now_us)
        return True

    def _read_domains(self, domains: Domains) -> None:
        """Quantifiers that grow need other labels when a domain has changed."""
        seen = {name: tuple(members) for name, members in domains.items()}
        if seen != self._seen:
            self._seen, self._labels = seen, required_labels(self.formula, seen)

    def _activate(self, domains: Domains) -> "Watch | _Once":
        formula = self.formula
        if isinstance(formula, Always) and formula.lo_us == 0 and formula.hi_us is None:
            return Watch(restartable(formula.operand, domains, self.period_us, self.no_value), self._close_after)
        policy: NoValuePolicy = "undecided" if self.no_value == "skip" else self.no_value  # what to skip is known here
        return _Once(make_progression(formula, self.period_us, policy))

    def on_time(self, now_us: int) -> list[AlarmEvent]:
        """Let time pass. Changes only the state of the inputs: alarms wait for states."""
        due_us = self._inputs.deadline_us
        if due_us is not None and now_us >= due_us:
            self._inputs.on_time(now_us)
            if isinstance(self._watch, Watch):
                self._watch.forget_clean()
        return []

    def mark_missing(self, which: str, now_us: int, reason: str = "gone") -> list[AlarmEvent]:
        """The source of an input is gone, or its clock skewed: its values no longer count, whatever still comes."""
        self._inputs.mark(which, now_us, reason)
        if isinstance(self._watch, Watch):
            self._watch.forget_clean()
        return []

    def mark_present(self, which: str, now_us: int) -> list[AlarmEvent]:
        """The source is back; inputs are fresh again with the first complete state."""
        self._inputs.unmark(which)
        return self.on_time(now_us)

    def end(self, now_us: int) -> list[AlarmEvent]:
        """The monitor is removed: an alarm that is open ends, whether its formula holds or not."""
        alarm_id, self.alarm_id = self.alarm_id, None
        return [] if alarm_id is None else [AlarmEvent(alarm_id, "ended", self.name, self.key, now_us, now_us, {})]

    def _event(self, change: Change, now_us: int) -> AlarmEvent:
        if change.opens or self.alarm_id is None:
            self.alarm_id = f"{self.name}/{self.by}/{'-'.join(self.key)}/{change.valid_us}"
        alarm_id = self.alarm_id
        if not change.opens:
            self.alarm_id = None
        lacks = lacking(self._labels, change.values)
        values = {label: change.values[label] for label in self._labels if label not in lacks}
        event: Literal["opened", "closed"] = "opened" if change.opens else "closed"
        samples_us = change.samples_us
        if samples_us is None:
            samples_us = dict.fromkeys(self._inputs.names, change.valid_us)
        because = self.explanation if change.opens else ()
        return AlarmEvent(alarm_id, event, self.name, self.key, change.valid_us, now_us, values, samples_us, because)


class _Once:
    """A formula of any other form: progressed to its verdict, one alarm if that is false."""

    doubtful = False

    def __init__(self, progression: Progressing) -> None:
        self.progression = progression

    def explain(self) -> tuple[Explanation, ...]:
        return self.progression.explain()

    def on_moment(self, moment: Moment, samples_us: Mapping[str, int] | None = None) -> Change | None:
        one = self.progression
        before: str = one.verdict
        if before == "false":
            return None
        one.progress(moment.valid_us, moment.values, moment.domains, moment.events)
        self.doubtful = one.is_doubtful
        return opening(moment, samples_us) if one.verdict == "false" else None


def _verdict(watch: Watch | _Once) -> Verdict:
    if isinstance(watch, Watch):
        return "false" if watch.open else "undecided"
    return watch.progression.verdict
