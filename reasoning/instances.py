"""One formula progressed as a batch: what begins with a quantifier over a fixed domain has a row per member.

`always forall u in uavs: phi` is the conjunction of `always phi` over the members, so each member is an instance.
"""

from collections.abc import Callable, Collection, Mapping
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from dyknow.sample import Value
from dyknow.values import NO_VALUE
from reasoning.batch import Batch
from reasoning.columns import Column
from reasoning.evaluation import NoValuePolicy
from reasoning.explaining import Reason
from reasoning.formulas import (
    Always,
    Domain,
    Domains,
    Exists,
    Feature,
    Forall,
    Formula,
    Variable,
    children,
    domain_members,
    instantiate,
    required_labels,
    walk,
)
from reasoning.progression import Progression, Verdict, lacking
from reasoning.shapes import Grows

_NO_DOMAINS: Domains = MappingProxyType({})
_ROW: Final = "?"
"""Stands for the member of a row; no object has such a name."""
_EXACT: Final = 2**53
"""Integers up to this are floats as well."""


class ByInstances:
    """A formula as a batch of its instances; the interface of `engine.Progressing`.

    Attributes:
        members: of the rows; one empty name if the formula does not begin with a quantifier.
    """

    def __init__(self, formula: Formula, period_us: int | None = None, no_value: NoValuePolicy = "undecided") -> None:
        self.formula = formula
        self.members: tuple[str, ...] = ()
        self._period_us, self._no_value = period_us, no_value
        self._batch: Batch | None = None
        self._plain: Progression | None = None
        self._universal, self._variable = True, ""
        self._valid_us: int | None = None
        self._verdict: Verdict = "undecided"

    @property
    def verdict(self) -> Verdict:
        return self._verdict if self._plain is None else self._plain.verdict

    @property
    def way(self) -> Any:
        if self._plain is not None:
            return "plain"
        return "batch" if self._batch is None else self._batch.way

    @property
    def is_doubtful(self) -> bool:
        """Whether it is undecided for ever, by atoms without a value."""
        if self._plain is not None:
            return self._plain.is_doubtful
        return self._batch is not None and self._verdict == "undecided" and bool(self._batch.decided.all())

    @property
    def kept(self) -> int:
        if self._plain is not None:
            return self._plain.kept
        return 0 if self._batch is None else self._batch.kept

    def explain(self) -> tuple[Reason, ...]:
        """What made it true or false: of one member that is enough, else of all."""
        batch = self._batch
        if batch is None or self._verdict == "undecided":
            return ()
        truth = self._verdict == "true"
        rows = np.flatnonzero(batch.true if truth else batch.false).tolist()
        return tuple([self._named(reason, row) for row in rows for reason in batch.explain(row)])

    def _named(self, reason: Reason, row: int) -> Reason:
        """With the member that the row is about put in."""
        if not self._variable:
            return reason
        member = self.members[row]
        obligation = reason.obligation
        return reason._replace(
            part=instantiate(reason.part, _ROW, member),
            obligation=None if obligation is None else instantiate(obligation, _ROW, member),
            binding=((self._variable, member), *reason.binding),
            samples={label.replace(_ROW, member): value for label, value in reason.samples.items()},
        )

    def progress(
        self,
        valid_us: int,
        values: Mapping[str, Value],
        domains: Domains | None = None,
        events: Collection[str] = (),
    ) -> None:
        """As `Progression.progress`."""
        domains = domains or _NO_DOMAINS
        if self._valid_us is not None and valid_us <= self._valid_us:
            raise ValueError(f"states go forward in time: {valid_us} us after {self._valid_us} us")
        if self._no_value == "skip" and lacking(required_labels(self.formula, domains), values):
            return
        batch = self._batch
        if batch is None and self._plain is None:
            batch = self._activate(domains)
        self._valid_us = valid_us
        if self._plain is not None:
            self._plain.progress(valid_us, values, domains, events)
        elif batch is not None and self._verdict == "undecided":
            columns = _Rows(self.members, lambda label: values.get(label, NO_VALUE))
            batch.progress(valid_us, columns, domains, events=_Rows(self.members, lambda label: label in events))
            self._verdict = self._together(batch)

    def _activate(self, domains: Domains) -> Batch | None:
        body, self.members, self._universal, self._variable = _split(self.formula, domains)
        policy: NoValuePolicy = "undecided" if self._no_value == "skip" else self._no_value
        try:
            self._batch = Batch(body, len(self.members), self._period_us, policy, domains)
        except Grows:
            self._plain = Progression(self.formula, self._period_us, self._no_value)
        return self._batch

    def _together(self, batch: Batch) -> Verdict:
        false, true = batch.false, batch.true
        if self._universal:
            return "false" if false.any() else "true" if true.all() else "undecided"
        return "true" if true.any() else "false" if false.all() else "undecided"


class _Rows(dict[str, Column]):
    """Columns by label, each made when it is asked for."""

    def __init__(self, members: tuple[str, ...], value: Callable[[str], Any]) -> None:
        super().__init__()
        self._members, self._value = members, value

    def get(self, label: str, _default: Any = None) -> Column:
        if _ROW not in label:
            return _column([self._value(label)] * len(self._members))
        return _column([self._value(label.replace(_ROW, member)) for member in self._members])


def _column(values: list[Any]) -> Column:
    """Truth values and numbers as numbers, missing ones NaN; anything else as it is."""
    if all(isinstance(value, bool) for value in values):
        return np.asarray(values, np.bool_)
    if all(_is_exact(value) for value in values):
        return np.asarray([np.nan if value is NO_VALUE else value for value in values], np.float64)
    found = np.empty(len(values), object)
    found[:] = values
    return found


def _is_exact(value: Any) -> bool:
    """Whether a column of floats holds it as it is."""
    return value is NO_VALUE or isinstance(value, float) or (value.__class__ is int and -_EXACT <= value <= _EXACT)


def _split(formula: Formula, domains: Domains) -> tuple[Formula, tuple[str, ...], bool, str]:
    """(instance, members, whether all must hold, variable); one nameless member if there is nothing to split."""
    inner = formula
    if isinstance(formula, Always) and isinstance(formula.operand, Forall):
        inner = formula.operand
    if not isinstance(inner, Forall | Exists) or inner.growing or not _only_in_features(inner):
        return formula, ("",), True, ""
    members = domain_members(inner.domain, domains)
    if not members:
        return formula, ("",), True, ""
    body = instantiate(inner.body, inner.variable, Variable(_ROW))
    if inner is not formula and isinstance(formula, Always):
        body = Always(body, formula.lo_us, formula.hi_us, place=formula.place)
    return body, members, isinstance(inner, Forall), inner.variable


def _only_in_features(quantifier: Forall | Exists) -> bool:
    """Whether the variable stands only where features name their objects, not as a value or in another domain."""
    return not any(
        one == Variable(quantifier.variable) and not isinstance(node, Feature)
        for node in walk(quantifier.body)
        for one in (*children(node), *_listed(node))
    )


def _listed(node: Any) -> list[Any]:
    if not isinstance(node, Domain):
        return []
    return [one for each in (node.base, *node.minus) if isinstance(each, tuple) for one in each]
