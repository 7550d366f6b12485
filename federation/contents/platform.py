"""What a platform tells of itself: its tasks, its account, its directory, its labels."""

from typing import Annotated, Literal

from pydantic import Field

from federation.contents.parts import (
    MAX_LIST,
    Agent,
    Content,
    Conversation,
    Formula,
    Instant,
    Line,
    Part,
    Prose,
    Unit,
    Units,
    Word,
)
from federation.wire import Count, SemanticLabel


class Tasks(Content):
    """Which delegated tasks are there?"""


class Task(Part):
    conversation: Conversation
    task: Word
    unit: Unit
    state: Line
    delegator: Agent | None = None
    since_us: Instant | None = None


class TaskList(Content):
    tasks: Annotated[tuple[Task, ...], Field(max_length=MAX_LIST)]


class Acts(Content):
    """Subscribe: tell me of every act that enters or leaves."""


class ActLog(Content):
    """One act as it passed the Interface Agent; `act` is its text, missing for bytes that were no act."""

    at_us: Instant
    direction: Literal["in", "out"]
    peer: Line
    outcome: Prose
    act: Formula | None = None


class ActList(Content):
    """The acts that are remembered: asked without `acts`, answered with them."""

    acts: Annotated[tuple[ActLog, ...], Field(max_length=MAX_LIST)] | None = None
    more: bool = False


class Directory(Content):
    """Subscribe: tell me when a platform, a service or a label appears or goes."""


class DirectoryEvent(Content):
    """Something in the directory changed: e.g. `platform-appeared`, `service-gone`; `what` is the service or label."""

    event: Word
    unit: Unit
    at_us: Instant
    what: Word | None = None


class Search(Content):
    """Who provides a service, or has a label?"""

    service: Word | None = None
    semantic_label: SemanticLabel | None = None


class Found(Content):
    """Who does. `missing_units` were there and fell silent: they did not say good-bye, and no session ended first."""

    agents: Annotated[tuple[Agent, ...], Field(max_length=MAX_LIST)]
    missing_units: Units = ()


class Labels(Content):
    """Which labels has the local instance? For agents of the same platform."""


class LabelList(Content):
    labels: Annotated[tuple[Line, ...], Field(max_length=MAX_LIST)]


class Latest(Content):
    """The latest value of a local label? For agents of the same platform."""

    label: Line


class Specification(Content):
    """What does your instance hold? `number`: what it held in an earlier configuration, counted from 0.

    As KPL, or what runs of it now as a graph in another form.
    """

    number: Count | None = None
    form: Literal["kpl", "text", "json", "mermaid", "dot"] = "kpl"


class SpecificationText(Content):
    """Part of a specification; `at_us` is since when it is, or was, held (federation time), `last` the newest number."""

    text: Formula
    number: Count
    last: Count
    at_us: Instant
    more: bool = False


class RestoreSpecification(Content):
    """Hold again what you held in that configuration."""

    number: Count


class Leave(Content):
    """Leave the federation; streams that are set up go on (thesis 9.3.4)."""


class Rejoin(Content):
    """Come back to the federation."""
