"""Speech acts: the messages of FIPA ACL (SC00061G), with parameters for reliable delivery on a lossy wire."""

from base64 import b64decode, b64encode
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from typing import Any, Final, NamedTuple

from dyknow.federation import keys
from dyknow.federation.messages.sexpr import Expr, ExprReader, ExprValue, QuotedText, print_value
from dyknow.model.errors import NameRefused, TextError


class Performative(StrEnum):
    """The 22 communicative acts of FIPA SC00037J."""

    ACCEPT_PROPOSAL = "accept-proposal"
    AGREE = "agree"
    CANCEL = "cancel"
    CFP = "cfp"
    CONFIRM = "confirm"
    DISCONFIRM = "disconfirm"
    FAILURE = "failure"
    INFORM = "inform"
    INFORM_IF = "inform-if"
    INFORM_REF = "inform-ref"
    NOT_UNDERSTOOD = "not-understood"
    PROPAGATE = "propagate"
    PROPOSE = "propose"
    PROXY = "proxy"
    QUERY_IF = "query-if"
    QUERY_REF = "query-ref"
    REFUSE = "refuse"
    REJECT_PROPOSAL = "reject-proposal"
    REQUEST = "request"
    REQUEST_WHEN = "request-when"
    REQUEST_WHENEVER = "request-whenever"
    SUBSCRIBE = "subscribe"


PERFORMATIVES: Final = {performative.value: performative for performative in Performative}


@dataclass(frozen=True, slots=True)
class AgentName:
    """An agent on a platform, printed `interface@0`. The unit `all` addresses that agent everywhere.

    Raises:
        NameRefused: the agent or the unit is not a name that a key can carry.
    """

    agent: str
    unit: str

    def __post_init__(self) -> None:
        keys.agent(self.agent)
        if self.unit != keys.EVERYBODY:
            keys.unit(self.unit)

    def __str__(self) -> str:
        return f"{self.agent}@{self.unit}"

    @staticmethod
    def parse(text: str) -> "AgentName":
        """Read `agent@unit`; raises NameRefused."""
        if len(text) > 128:
            raise NameRefused(f"{text[:80]!r}... is too long for an agent's name")
        return _agent_name(text)


@lru_cache(maxsize=4096)
def _agent_name(text: str) -> AgentName:
    agent, at, unit = text.partition("@")
    if not at:
        raise NameRefused(f"{text!r} is not an agent's name: agent@unit")
    return AgentName(agent, unit)


class Act(NamedTuple):
    """One speech act. None is a parameter that is not set.

    Attributes:
        performative: the kind of the act.
        sender: the agent whose act it is.
        receiver: the agent that gets it; unit `all` is every platform.
        content: its content.
        conversation_id: the conversation it belongs to; a name as `keys.conversation` has it.
        protocol: the interaction protocol, e.g. `fipa-request`.
        reply_with: the `in_reply_to` of an answer.
        in_reply_to: the `reply_with` of the act it answers.
        reply_by_us: when silence becomes a failure; microseconds, the sender's node clock.
        language: of the content.
        encoding: of the content.
        ontology: which gives the content's words their meaning.
        reply_to: the agent that shall get the answer, if not the sender.
        boot: which life of the sender's platform; greater in each later one.
        seq: number of the act in that life, by which duplicates are known.
        created_us: when it was made; microseconds, the sender's node clock.
        acks: sequence numbers of the receiver's acts that have arrived.
        evidence: of a task that the sender acts for: the act that delegated it, as it arrived there.
        original: this act as it arrived here, signature and all; it is not sent.
    """

    performative: Performative
    sender: AgentName
    receiver: AgentName
    content: Expr | None = None
    conversation_id: str | None = None
    protocol: str | None = None
    reply_with: str | None = None
    in_reply_to: str | None = None
    reply_by_us: int | None = None
    language: str | None = None
    encoding: str | None = None
    ontology: str | None = None
    reply_to: AgentName | None = None
    boot: int = 0
    seq: int = 0
    created_us: int = 0
    acks: tuple[int, ...] = ()
    evidence: bytes = b""
    original: bytes = b""

    @property
    def key(self) -> str:
        """The key it travels on; an act that arrives on another key is not what it says."""
        return keys.act(self.receiver.unit, self.sender.unit, self.receiver.agent)

    def __str__(self) -> str:
        return print_act(self)


_PARAMETERS: Final = {
    ":sender": "sender",
    ":receiver": "receiver",
    ":content": "content",
    ":conversation-id": "conversation_id",
    ":protocol": "protocol",
    ":reply-with": "reply_with",
    ":in-reply-to": "in_reply_to",
    ":reply-by": "reply_by_us",
    ":language": "language",
    ":encoding": "encoding",
    ":ontology": "ontology",
    ":reply-to": "reply_to",
    ":X-boot": "boot",
    ":X-seq": "seq",
    ":X-created": "created_us",
    ":X-acks": "acks",
    ":X-evidence": "evidence",
}
_AGENTS: Final = frozenset({"sender", "receiver", "reply_to"})
_NUMBERS: Final = frozenset({"boot", "seq", "created_us", "reply_by_us"})


def print_act(act: Act) -> str:
    """`(request :sender interface@1 :receiver interface@0 :content (monitor-proximity) ...)`, on one line.

    Parameters that FIPA does not know begin with `:X-`, as it prescribes.
    """
    parts = [str(act.performative)]
    for name, attribute in _PARAMETERS.items():
        value = getattr(act, attribute)
        if value not in (None, (), b"") and not (attribute in {"boot", "seq", "created_us"} and value == 0):
            parts += [name, str(value) if attribute in _AGENTS else print_value(_said(value))]
    return f"({' '.join(parts)})"


def _said(value: Any) -> ExprValue:
    said: ExprValue = QuotedText(b64encode(value).decode()) if isinstance(value, bytes) else value
    return said


def parse_act(text: str) -> Act:
    """Read back what `print_act` wrote; blanks, line ends and the order of parameters are free.

    Raises:
        TextError: the place, and the expected word.
    """
    reader = ExprReader(text)
    reader.take("(")
    performative = PERFORMATIVES.get(reader.peek())
    if performative is None:
        raise reader.wrong(f"{reader.peek()!r:.40} is not one of FIPA's 22 performatives")
    reader.word()
    found: dict[str, Any] = {"performative": performative}
    while reader.peek() != ")":
        attribute = _PARAMETERS.get(reader.peek())
        if attribute is None or attribute in found:
            raise reader.wrong("a parameter that was not given yet is expected here", repair=":receiver interface@0")
        reader.word()
        found[attribute] = _parameter(reader, attribute)
    reader.take(")")
    reader.end()
    if not {"sender", "receiver"} <= found.keys():
        raise TextError(
            "an act needs a :sender and a :receiver", text=text, repair=":sender cc@1 :receiver interface@0"
        )
    return Act(**found)


def _parameter(reader: ExprReader, attribute: str) -> Any:
    begins = reader.position
    value: ExprValue = reader.value(1)
    if attribute in _AGENTS:
        with suppress(NameRefused):
            if isinstance(value, str):
                return AgentName.parse(value)
        fits = False
    elif attribute == "content":
        fits = isinstance(value, Expr)
    elif attribute in _NUMBERS:
        fits = type(value) is int
    elif attribute == "acks":
        fits = isinstance(value, tuple) and all(type(seq) is int for seq in value)
    elif attribute == "evidence":
        with suppress(ValueError):
            if isinstance(value, str):
                return b64decode(value, validate=True)
        fits = False
    else:
        fits = isinstance(value, str)
    if not fits:
        raise reader.wrong(f"this cannot be the {attribute.removesuffix('_us').replace('_', '-')} of an act", at=begins)
    return value
