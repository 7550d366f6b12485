"""One conversation that a member opened, as a record of its answers."""

from dataclasses import dataclass, field

from dyknow.federation.messages import contents
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import Content, Reason

P = Performative
DECLINED = frozenset({P.REFUSE, P.FAILURE, P.NOT_UNDERSTOOD})


@dataclass(slots=True)
class Dialogue:
    """The answers of `unit`.

    Attributes:
        said: the answers with their contents (None: not understood).
        failed: why no further answer comes, or None.
        over: whether no further answer comes.
        about: the content of the question.
    """

    unit: str
    conversation: str = ""
    said: list[tuple[Act, Content | None]] = field(default_factory=list)
    failed: str | None = None
    over: bool = False
    about: Content | None = None

    def on_reply(self, act: Act, content: Content | None, is_last: bool, _now_us: int) -> None:
        """Note an answer."""
        self.said.append((act, content))
        self.over = self.over or is_last

    def on_silence(self, why: str, _now_us: int) -> None:
        """Note that no further answer comes."""
        self.failed, self.over = why, True

    @property
    def agreed(self) -> bool:
        return any(act.performative is P.AGREE for act, _ in self.said)

    @property
    def results(self) -> list[Content]:
        """The informed contents, in order."""
        return [content for act, content in self.said if act.performative is P.INFORM and content is not None]

    @property
    def refusal(self) -> tuple[Performative, Reason | None] | None:
        """How it was declined, and why; None if it was not."""
        for act, content in self.said:
            if act.performative in DECLINED:
                return act.performative, content if isinstance(content, Reason) else None
        return None

    @property
    def trouble(self) -> str | None:
        """Why it did not succeed, or None: refusal, failure, not-understood or silence."""
        if self.refusal is None:
            return self.failed
        performative, reason = self.refusal
        return f"{performative}: {performative if reason is None else reason.text}"


def is_paged(content: contents.Content) -> bool:
    """Whether the answer may come in several acts."""
    if isinstance(content, contents.Query | contents.QueryStream):
        return content.op in {"between", "last", "slice"}
    return isinstance(
        content,
        contents.AlarmList
        | contents.ActList
        | contents.ImportList
        | contents.Monitors
        | contents.ObjectEvents
        | contents.ObjectList
        | contents.ObjectPicture
        | contents.SaliencyRows
        | contents.Specification,
    )
