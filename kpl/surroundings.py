"""What a running specification meets: who is told of it, and who does what concerns other platforms."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from dyknow import Sample
from kpl.specification import MonitorDeclaration, StreamTerm
from reasoning import AlarmEvent
from reasoning.formulas import Formula

Undo: TypeAlias = Callable[[], None]


def nothing() -> None:
    """There is nothing to take back."""


class Federation(Protocol):
    """What the room above does for declarations that concern other platforms; each returns how to take it back."""

    def export(self, semantic: str, term: StreamTerm) -> Undo: ...
    def import_(self, semantic: str, unit: str, term: StreamTerm) -> Undo: ...
    def monitor(self, declaration: MonitorDeclaration, formula: Formula) -> Undo | None:
        """None: the formula is over streams of this instance."""


@dataclass(slots=True)
class Hooks:
    """Who is told what the instance does.

    Attributes:
        on_output: name of a declared stream, and a sample of it.
        on_link: name of a declared stream, and whether somebody makes what it is made of.
        on_alarm: an alarm of a monitor opened or closed.
    """

    on_output: Callable[[str, Sample], None] = lambda _name, _sample: None
    on_link: Callable[[str, bool], None] = lambda _name, _linked: None
    on_alarm: Callable[[AlarmEvent], None] = lambda _event: None
