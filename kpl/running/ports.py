"""Ports of a running specification: callbacks, and the federation for what concerns other platforms."""

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias

from dyknow import Label, Sample, TextError
from dyknow.kpl.syntax.specification import Declaration, Export, MonitorDeclaration, StreamTerm
from dyknow.model.semantic_labels import SemanticLabel
from dyknow.reasoning import AlarmEvent
from dyknow.reasoning.formulas.tree import Formula

if TYPE_CHECKING:
    from dyknow.anchoring.links.objects import LinkEvent

Undo: TypeAlias = Callable[[], None]
Admission: TypeAlias = Literal["refuse", "longer"]


def nothing() -> None:
    """There is nothing to take back."""


class Federation(Protocol):
    """The port for declarations that concern other platforms; each method returns a function that undoes it."""

    def define(self, label: SemanticLabel) -> Undo: ...
    def export(self, declaration: Export, term: StreamTerm) -> Undo:
        """`term` is that of the declaration, with the unit for `self`."""

    def import_(self, semantic: str, unit: str, term: StreamTerm) -> Undo: ...
    def monitor(self, declaration: MonitorDeclaration, formula: Formula) -> tuple[Undo, bool]:
        """And whether the instance has to run it: the formula is over streams of its own."""


class LoadGovernor(Protocol):
    """Decides about new work while there is too much to do (10.7)."""

    @property
    def full(self) -> bool:
        """Whether there is no time for more."""

    def refusals(self, new: Iterable[Declaration], text: str) -> list[TextError]:
        """Errors for declarations that are refused now."""

    def hold_back(self, known: Collection[int], now_us: int) -> None:
        """Lengthen the periods of new streams; `known` are the ids of the proxies of the others."""


@dataclass(slots=True)
class Hooks:
    """Callbacks of an instance.

    Attributes:
        on_output: name of a declared stream, and a sample of it.
        on_link: name of a declared stream, and whether its inputs have producers.
        on_alarm: an alarm of a monitor opened or closed.
        on_found: a wanted object was found, is tracked, lost or found again.
        on_fault: code of a user failed, or a stream cannot be made, for that label: the reason.
        on_producer: a stream of several producers is from this one now; None: from none.
    """

    on_output: Callable[[str, Sample], None] = lambda _name, _sample: None
    on_link: Callable[[str, bool], None] = lambda _name, _linked: None
    on_alarm: Callable[[AlarmEvent], None] = lambda _event: None
    on_found: Callable[["LinkEvent"], None] = lambda _event: None
    on_fault: Callable[[Label, str], None] = lambda _label, _said: None
    on_producer: Callable[[Label, Label | None], None] = lambda _label, _producer: None
