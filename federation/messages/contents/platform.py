"""Contents about a platform: its tasks, its audit log, its directory, its specification."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from dyknow.federation.messages.contents import parts
from dyknow.federation.messages.descriptions import Count, SemanticLabel

MAX_FILES = 4
"""That a specification may name, where it comes as a speech act."""
MAX_NAMES = 64
"""Names or lines in one act about changes of specifications."""


class Tasks(parts.Content):
    """Which delegated tasks are there?"""


class TaskEntry(parts.ContentPart):
    """One task.

    Attributes:
        ended_by: the platform that ended it here, which is neither its delegate nor a command centre.
        monitors: the monitored formulas, by name; `avoidance`: whether platforms then give way to each other.
    """

    head: ClassVar[str] = "task"

    conversation: parts.Conversation
    task: parts.Word
    unit: parts.Unit
    state: parts.Line
    delegator: parts.Agent | None = None
    since_us: parts.Instant | None = None
    ended_by: parts.Unit | None = None
    monitors: Annotated[tuple[parts.Word, ...], Field(max_length=parts.MAX_LIST)] = ()
    avoidance: bool | None = None


class TaskList(parts.Content):
    tasks: Annotated[tuple[TaskEntry, ...], Field(max_length=parts.MAX_LIST)]


class TaskOver(parts.Content):
    """A task is over everywhere: permits and assignments for it no longer count. Of the platform that leads it."""

    task: parts.Conversation


class Acts(parts.Content):
    """Subscribe: tell me of every act that enters or leaves."""


class ActLog(parts.Content):
    """One act as it passed the Interface Agent; `act` is its text, missing for bytes that were no act."""

    at_us: parts.Instant
    direction: Literal["in", "out"]
    peer: parts.Line
    outcome: parts.Prose
    act: parts.Printed | None = None


class ActList(parts.Content):
    """The acts that are remembered: the query is without `acts`, the answer with them."""

    acts: Annotated[tuple[ActLog, ...], Field(max_length=parts.MAX_LIST)] | None = None
    more: bool = False


class Directory(parts.Content):
    """Subscribe: tell me when a platform, a service or a label appears or goes."""


class DirectoryEvent(parts.Content):
    """Something in the directory changed: e.g. `platform-appeared`, `service-gone`; `what` is the service or label."""

    event: parts.Word
    unit: parts.Unit
    at_us: parts.Instant
    what: parts.Word | None = None


class Search(parts.Content):
    """Query for the platforms that provide a service or have a label."""

    service: parts.Word | None = None
    semantic_label: SemanticLabel | None = None


class SearchResult(parts.Content):
    """Those platforms. `missing_units` are gone without a good-bye, `missing_since` when they were last heard there."""

    head = "found"
    agents: Annotated[tuple[parts.Agent, ...], Field(max_length=parts.MAX_LIST)]
    missing_units: parts.Units = ()
    missing_since: Annotated[tuple[parts.Instant, ...], Field(max_length=parts.MAX_LIST)] = ()


class Specification(parts.Content):
    """What does your instance hold? `number`: an earlier configuration, counted from 0.

    As KPL, or what runs of it now as a graph in another form.
    """

    number: Count | None = None
    form: Literal["kpl", "text", "json", "mermaid", "dot"] = "kpl"


class SpecificationText(parts.Content):
    """Part of a specification; `at_us` is since when it is, or was, held (federation time), `last` the newest number."""

    text: parts.Printed
    number: Count
    last: Count
    at_us: parts.Instant
    more: bool = False


class RestoreSpecification(parts.Content):
    """Hold again what you held in that configuration."""

    number: Count


class NamedText(parts.ContentPart):
    """A file that a specification names, by the path it is named with."""

    path: parts.Line
    text: parts.Formula


class Reset(parts.Content):
    """Forget the samples of a stream that your specification declares (thesis 5.3.2), by its own label."""

    stream: parts.Formula


class AddDeclarations(parts.Content):
    """Declare more: `text` is KPL, `files` what it names, `file` where it is from."""

    text: parts.Formula
    files: Annotated[tuple[NamedText, ...], Field(max_length=MAX_FILES)] = ()
    file: parts.Line = ""


class LoadSpecification(parts.Content):
    """Hold this in place of what you hold; as `AddDeclarations`."""

    text: parts.Formula
    files: Annotated[tuple[NamedText, ...], Field(max_length=MAX_FILES)] = ()
    file: parts.Line = ""


class RemoveDeclarations(parts.Content):
    """Declare these no more: names of declarations; with the kind, `stream speed`, where several have the name."""

    names: Annotated[tuple[parts.Line, ...], Field(min_length=1, max_length=MAX_NAMES)]


class SpecificationChanged(parts.Content):
    """Configuration `number` is held from now on: its new and removed declarations; `more` such are not listed."""

    number: Count
    added: Annotated[tuple[parts.Line, ...], Field(max_length=MAX_NAMES)] = ()
    removed: Annotated[tuple[parts.Line, ...], Field(max_length=MAX_NAMES)] = ()
    more: Count = 0
    warnings: Annotated[tuple[parts.Text, ...], Field(max_length=MAX_NAMES)] = ()


class Leave(parts.Content):
    """Leave the federation; streams that are set up continue (thesis 9.3.4)."""


class Rejoin(parts.Content):
    """Come back to the federation."""
