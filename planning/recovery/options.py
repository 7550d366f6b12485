"""The options of a mission's execution and recovery, and its status."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

from dyknow.planning.execution.events import AskHuman

AGAIN: Final = "try again"
GIVE_UP: Final = "give up"
DROP: Final = "drop "
"""Begins the answer that drops a goal, its name follows."""


@dataclass(frozen=True, slots=True)
class MissionOptions:
    """Times in microseconds.

    Attributes:
        period_us: of the states.
        search_us: how long a search may take.
        question_us: how long a question waits for an answer.
        default_answer: the answer assumed for an unanswered question.
        locate_us: how long objects are looked for.
        patience_us: how long an action waits for states that show its conditions, and values may be missing unnoticed.
        most_replans: how many new plans are made in all.
    """

    period_us: int = 200_000
    search_us: int = 10_000_000
    question_us: int = 60_000_000
    default_answer: str = GIVE_UP
    locate_us: int = 120_000_000
    patience_us: int = 5_000_000
    most_replans: int = 100

    def question(self, number: int, why: str, droppable: tuple[str, ...], now_us: int) -> AskHuman:
        """The question when nothing else helps."""
        options = (AGAIN, *(f"{DROP}{name}" for name in droppable), GIVE_UP)
        default = self.default_answer if self.default_answer in options else GIVE_UP
        return AskHuman(number, why, options, default, now_us + self.question_us)


class MissionPhase(StrEnum):
    """The phase of a mission."""

    READY = "ready"
    SEARCHING = "searching for a plan"
    EXECUTING = "executing"
    LOCATING = "locating"
    ASKING = "asking"
    SUSPENDED = "suspended"
    WITH_PILOT = "waiting for the pilot"
    ENDED = "ended"


@dataclass(frozen=True, slots=True)
class MissionStatus:
    """The status of a mission.

    Attributes:
        why: why it is in this phase.
        steps: (number, unit, action, phase, since when) of the plan that is executed.
        flags: labels of the execution flags that are set.
        faults: how often each fault was met.
        assumed: the changes by recovery operators, newest last.
    """

    name: str
    phase: MissionPhase
    since_us: int
    why: str
    steps: tuple[tuple[int, str, str, str, int], ...]
    flags: tuple[str, ...]
    faults: tuple[tuple[str, int], ...]
    replans: int
    assumed: tuple[str, ...]
    goals: tuple[str, ...]
    dropped: tuple[str, ...]
    left_out: tuple[str, ...]
    question: AskHuman | None = None

    def as_json(self) -> dict[str, Any]:
        steps = [
            {"step": number, "unit": unit, "action": shown, "phase": phase, "since_us": since_us}
            for number, unit, shown, phase, since_us in self.steps
        ]
        question = None if self.question is None else self.question._asdict()
        return {
            "mission": self.name,
            "phase": str(self.phase),
            "since_us": self.since_us,
            "why": self.why,
            "steps": steps,
            "flags": list(self.flags),
            "faults": dict(self.faults),
            "replans": self.replans,
            "assumed": list(self.assumed),
            "goals": list(self.goals),
            "dropped": list(self.dropped),
            "left_out": list(self.left_out),
            "question": question,
        }
