"""What a command centre knows: its conversations, the platforms it sees, and by which keys it believes whom."""

from dataclasses import dataclass, field

from console.errors import FederationFailed, NothingFound, WrongCall
from dyknow.errors import DyknowError
from federation.acts import Act, Performative
from federation.contents import ActList, AlarmList, Content, ImportList, Monitors, Query, Reason
from federation.directory import Entry
from federation.trust import Roster, Signer

P = Performative


@dataclass(slots=True)
class Dialogue:
    """One conversation that this command centre opened, and what has come of it.

    `said` are the answers with what they mean (None where that is not understood), `failed` why nothing more will
    come, `over` that nothing more will; the answer to a `paged` question may come in several acts.
    """

    conversation: str
    unit: str
    said: list[tuple[Act, Content | None]] = field(default_factory=list)
    failed: str | None = None
    over: bool = False
    paged: bool = False

    @property
    def agreed(self) -> bool:
        return any(act.performative is P.AGREE for act, _ in self.said)

    @property
    def results(self) -> list[Content]:
        """What was informed of, in order."""
        return [content for act, content in self.said if act.performative is P.INFORM and content is not None]

    @property
    def trouble(self) -> str | None:
        """Why it did not succeed, or None: silence, refusal, failure or not-understood."""
        for act, content in self.said:
            if act.performative in {P.REFUSE, P.FAILURE, P.NOT_UNDERSTOOD}:
                words = content.text if isinstance(content, Reason) else str(act.performative)
                return f"{act.performative}: {words}"
        return self.failed


def failure_of(dialogue: Dialogue, otherwise: str) -> DyknowError:
    """What a conversation without the result that was asked for means; `otherwise` where nobody said why."""
    answers = {act.performative for act, _ in dialogue.said}
    words = f"platform {dialogue.unit}: {dialogue.trouble or otherwise}"
    if P.NOT_UNDERSTOOD in answers:
        return WrongCall(words)
    return NothingFound(words) if P.REFUSE in answers else FederationFailed(words)


@dataclass(frozen=True, slots=True)
class Seen:
    """A platform as people see it: `state` is alive, suspect, gone or refused; `entry` None if it never spoke."""

    unit: str
    kind: str
    state: str
    entry: Entry | None


@dataclass(frozen=True, slots=True)
class Keyring:
    """The roster by which others are believed, and the key with which this command centre signs."""

    roster: Roster
    signer: Signer


def is_paged(content: Content) -> bool:
    """Whether what answers it may come in several acts."""
    if isinstance(content, Query):
        return content.op == "between"
    return isinstance(content, AlarmList | ActList | ImportList | Monitors)
