"""The only module that imports zenoh. Bytes become events here and nowhere else; effects become calls.

Handlers stamp, post and return: a handler that worked or waited would stall the whole session, one that raised would be
swallowed. Their kind follows from `python -m bench callbacks`: plain callbacks for declarations, which Zenoh feeds from
a thread and a queue of their own; they take 190 k samples/s, direct ones (`indirect=False`) 24 k/s, since each fetches
the interpreter's lock again, and at 1 kHz both need the same time within the noise. For the answers to a question
direct ones, since a plain one would start a thread for every question.
"""

import contextlib
import json
import socket
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import zenoh
from zenoh.handlers import Callback

from dyknow.federation import transport as wire
from dyknow.model.errors import SessionFailed
from dyknow.proxies.zenoh.configuration import ZenohOptions, zenoh_config
from dyknow.proxies.zenoh.link_gate import LinkGate
from dyknow.proxies.zenoh.open_questions import OpenAsks
from dyknow.proxies.zenoh.session_exchange import Exchange, Step, leave_within
from dyknow.proxies.zenoh.tcp_close import Closing

T = TypeVar("T")
Declaration: TypeAlias = wire.Subscribe | wire.DeclareQueryable | wire.DeclareToken | wire.WatchTokens
Post: TypeAlias = Callable[[wire.WireEvent], None]

_MAX_PUBLISHERS = 512
_LOOK_S = 1.0
_LEAVE_S = 2.0

# All DROP, and none express: an express put costs its caller 25 us instead of 1, and a ping-pong of acts is not faster
# for it (`python -m bench express`).
_PRIORITY = {
    wire.Urgency.ACT: zenoh.Priority.INTERACTIVE_HIGH,
    wire.Urgency.CONTROL: zenoh.Priority.INTERACTIVE_HIGH,
    wire.Urgency.STREAM: zenoh.Priority.DATA,
    wire.Urgency.BULK: zenoh.Priority.DATA_LOW,
}


class ZenohEdge:
    """One session, and the declarations of a node on it. All calls come from one thread.

    Args:
        options: the federation and how to find it.
        post: takes what the wire tells, on Zenoh's threads: must neither block nor raise.
        now_us: the node clock.
    """

    def __init__(self, options: ZenohOptions, post: Post, now_us: Callable[[], int]) -> None:
        self._config = json.dumps(zenoh_config(options, _address_of))
        self._post, self._now_us = post, now_us
        self._session: zenoh.Session | None = None
        self._exchange: Exchange | None = None
        self._listeners: list[Any] = []
        self._closing = Closing()
        self._options = options
        self._gate: LinkGate | None = None
        self._zid = ""
        self._publishers: dict[str, tuple[wire.Urgency, zenoh.Publisher]] = {}
        self._declared: dict[Declaration, Any] = {}
        self._watches: dict[wire.WatchTokens, _TokenWatch] = {}
        self._asks: OpenAsks[zenoh.Query] = OpenAsks()
        self._performers: dict[type, Callable[[Any], None]] = {
            wire.Put: self._put,
            wire.Ask: self._ask,
            wire.Answer: self._answer,
            wire.AnswerEnd: lambda effect: self._asks.end(effect.ask),
            wire.Subscribe: self._declare,
            wire.DeclareQueryable: self._declare,
            wire.DeclareToken: self._declare,
            wire.WatchTokens: self._watch,
            wire.Unsubscribe: lambda effect: self._undeclare(wire.Subscribe(effect.key_expr)),
            wire.UndeclareToken: lambda effect: self._undeclare(wire.DeclareToken(effect.key)),
            wire.Reopen: lambda _effect: self._reopen(),
        }

    @property
    def zid(self) -> str:
        """Identity of the first session, for the keys of tokens. A later session puts its own in its place."""
        return self._zid

    @property
    def is_open(self) -> bool:
        """Whether there is a session; while one is exchanged for another there is none."""
        return self._session is not None

    def peers(self) -> tuple[str, ...]:
        """Identities of the sessions that ours is linked with."""
        return tuple(sorted(map(str, self._opened.info.peers_zid())))

    def open(self) -> None:
        """Open the session; takes a few milliseconds, 50 without peers.

        Raises:
            SessionFailed: an endpoint cannot be listened on, or the configuration is refused.
        """
        if self._options.roster is not None and self._options.security is not None:
            own = Path(self._options.security["transport"]["link"]["tls"]["listen_certificate"])
            self._gate = LinkGate(self._options.roster, own, self._linked, self._peers, self._post, self._now_us)
        try:
            self._take(zenoh.open(zenoh.Config.from_json5(self._config)))
        except zenoh.ZError as failed:
            raise SessionFailed(f"the session does not open: {_said(failed)}") from None

    def _linked(self) -> list[zenoh.Link]:
        session = self._session
        try:
            return [] if session is None else list(session.info.links())
        except zenoh.ZError:  # it is being closed
            return []

    def _peers(self) -> list[str]:
        session = self._session
        try:
            return [] if session is None else list(map(str, session.info.peers_zid()))
        except zenoh.ZError:  # it is being closed
            return []

    def _take(self, session: zenoh.Session) -> None:
        self._session, self._zid = session, self._zid or str(session.zid())
        info = session.info
        self._listeners = [
            info.declare_transport_events_listener(Callback(self._on_transport, indirect=False), history=True),
            info.declare_link_events_listener(Callback(self._on_link, indirect=False), history=True),
        ]

    def perform(self, effect: wire.WireEffect) -> None:
        """Carry out one effect. A refusal of Zenoh is posted as `HandlerFailed`: a node outlives its session."""
        try:
            if self._gate is not None:
                self._gate.wait()
            if self._exchange is None or self._is_exchanged(self._exchange):
                self._performers[type(effect)](effect)
            else:
                self._defer(effect)
        except (zenoh.ZError, SessionFailed) as failed:
            self._post(wire.HandlerFailed(type(effect).__name__, self._now_us(), _said(failed)))

    def close(self) -> None:
        """Leave: tokens first, the last declared before the others, so that peers see it. Again does nothing."""
        with contextlib.suppress(zenoh.ZError):
            if self._exchange is not None:
                self._session = self._exchange.result(_LEAVE_S)
        self._exchange = None
        if self._gate is not None:
            self._gate.close()
        leave_within(_LEAVE_S, self._left())
        self._declared.clear()
        self._watches.clear()

    @property
    def _opened(self) -> zenoh.Session:
        if self._session is None:
            raise SessionFailed("there is no session: open it first")
        return self._session

    # Samples out

    def _put(self, effect: wire.Put) -> None:
        key, payload, urgency = effect
        found = self._publishers.get(key)
        if found is None or found[0] is not urgency:
            found = self._published(key, urgency)
        found[1].put(payload)

    def _published(self, key: str, urgency: wire.Urgency) -> tuple[wire.Urgency, zenoh.Publisher]:
        """Declared once per key: its puts cost half of the session's. The oldest of too many gives way."""
        if key in self._publishers:
            _end(self._publishers.pop(key)[1].undeclare)
        elif len(self._publishers) >= _MAX_PUBLISHERS:
            _end(self._publishers.pop(next(iter(self._publishers)))[1].undeclare)
        publisher = self._opened.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.DROP, priority=_PRIORITY[urgency]
        )
        found = self._publishers[key] = (urgency, publisher)
        return found

    # Questions

    def _ask(self, effect: wire.Ask) -> None:
        question = effect.question

        def on_reply(reply: zenoh.Reply) -> None:
            if (found := reply.ok) is not None:
                self._post(wire.Answered(question, str(found.key_expr), self._now_us(), found.payload.to_bytes()))

        self._opened.get(
            effect.key,
            Callback(
                self._guarded("answer", on_reply),
                lambda: self._post(wire.AskEnded(question, self._now_us())),
                indirect=False,
            ),
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=effect.timeout_us / 1e6,
            payload=effect.payload,
            priority=zenoh.Priority.INTERACTIVE_LOW,
            congestion_control=zenoh.CongestionControl.DROP,
        )

    def _on_query(self, declared: str, query: zenoh.Query) -> None:
        """A question to many (`*/df`) is to this node one for the key that it declared."""
        now_us = self._now_us()
        key = str(query.key_expr) if "*" in declared else declared
        asked = query.payload.to_bytes() if query.payload is not None else b""
        self._post(wire.Asked(self._asks.add(query, now_us), key, now_us, asked))

    def _answer(self, effect: wire.Answer) -> None:
        query = self._asks.get(effect.ask)
        if query is not None:
            query.reply(effect.key, effect.payload)

    # Declarations

    def _declare(self, effect: Declaration) -> None:
        if effect not in self._declared:
            self._declared[effect] = self._made(effect)

    def _undeclare(self, effect: wire.Subscribe | wire.DeclareToken) -> None:
        declared = self._declared.pop(effect, None)
        if declared is not None:
            declared.undeclare()

    def _watch(self, effect: wire.WatchTokens) -> None:
        """Watch; watching already, look again: lost changes are posted, appearance and end."""
        if effect in self._declared:
            self._watches[effect].look(self._opened)
        else:
            self._watches.setdefault(effect, _TokenWatch(effect.key_expr, self._post, self._now_us))
            self._declare(effect)

    def _made(self, effect: Declaration) -> Any:
        session = self._opened
        match effect:
            case wire.Subscribe(key_expr):  # this node's own puts need not come back to it
                handler = self._guarded("sample", self._on_sample)
                return session.declare_subscriber(key_expr, handler, allowed_origin=zenoh.Locality.REMOTE)
            case wire.DeclareQueryable(key_expr):
                asked = self._guarded("question", partial(self._on_query, key_expr))
                return session.declare_queryable(key_expr, asked)
            case wire.DeclareToken(key):
                return session.liveliness().declare_token(key.replace(f"/{self._zid}/", f"/{session.zid()}/"))
            case wire.WatchTokens(key_expr):
                handler = self._guarded("token", self._watches[effect].on_token)
                return session.liveliness().declare_subscriber(key_expr, handler, history=True)

    def _reopen(self) -> None:
        """A new session with a new identity, since links of the old one may be half dead at the other side."""
        self._exchange = Exchange(self._left(), self._config)

    def _is_exchanged(self, exchange: Exchange) -> bool:
        """Whether the new session is there; then all is declared on it, tokens last: a member that sees one finds the rest."""
        if not exchange.is_over:
            return False
        self._exchange = None
        session = exchange.result()
        if session is not None:
            self._take(session)
            again, self._declared = self._declared, {}
            for effect in sorted(again, key=lambda effect: isinstance(effect, wire.DeclareToken)):
                self._declare(effect)
        return True

    def _defer(self, effect: wire.WireEffect) -> None:
        """Handle an effect between two sessions: declarations wait, and puts are lost as on a cut wire."""
        match effect:
            case wire.Ask(question):
                self._post(wire.AskEnded(question, self._now_us()))
            case wire.WatchTokens(key_expr):
                self._watches.setdefault(effect, _TokenWatch(key_expr, self._post, self._now_us))
                self._declared.setdefault(effect)
            case wire.Subscribe() | wire.DeclareQueryable() | wire.DeclareToken():
                self._declared.setdefault(effect)
            case wire.Unsubscribe(key_expr):
                self._declared.pop(wire.Subscribe(key_expr), None)
            case wire.UndeclareToken(key):
                self._declared.pop(wire.DeclareToken(key), None)

    def _left(self) -> list[Step]:
        """The session is ours no more; returns the steps of leaving it. The declarations are remembered."""
        if self._session is None:
            return []
        session, self._session = self._session, None
        tokens = [made for effect, made in self._declared.items() if isinstance(effect, wire.DeclareToken)]
        others = [made for effect, made in self._declared.items() if not isinstance(effect, wire.DeclareToken)]
        leaving = [*reversed(tokens), *reversed(others), *(publisher for _, publisher in self._publishers.values())]
        self._publishers.clear()
        self._asks.end_all()
        return [*(made.undeclare for made in leaving if made is not None), session.close]

    # Events in

    def _on_sample(self, found: zenoh.Sample) -> None:
        self._post(wire.Arrived(str(found.key_expr), self._now_us(), found.payload.to_bytes()))

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        """Called before Zenoh routes to the peer: until a peer has said what it listens to, all that is put goes there."""
        if event.kind == zenoh.SampleKind.PUT and self._gate is not None:
            self._gate.on_transport(str(event.transport.zid))

    def _on_link(self, event: zenoh.LinkEvent) -> None:
        if event.kind == zenoh.SampleKind.PUT:
            if self._gate is not None:
                self._gate.on_link(event.link)
            self._closing.stop_waiting()

    def _guarded(self, where: str, handler: Callable[[T], None]) -> Callable[[T], None]:
        def guarded(found: T) -> None:
            try:
                handler(found)
            except Exception as failed:  # noqa: BLE001  whatever it is: Zenoh would print it and go on
                self._post(wire.HandlerFailed(where, self._now_us(), repr(failed)))

        return guarded


class _TokenWatch:
    """The tokens of one expression that are believed alive."""

    def __init__(self, key_expr: str, post: Post, now_us: Callable[[], int]) -> None:
        self._key_expr, self._post, self._now_us = key_expr, post, now_us
        self._alive: set[str] = set()

    def on_token(self, found: zenoh.Sample) -> None:
        self._set(str(found.key_expr), alive=found.kind == zenoh.SampleKind.PUT)

    def look(self, session: zenoh.Session) -> None:
        """Ask for the present tokens (answered from the session's own state) and post the differences."""
        believed, seen = set(self._alive), set[str]()

        def on_reply(reply: zenoh.Reply) -> None:
            if (found := reply.ok) is not None:
                seen.add(str(found.key_expr))

        def on_end() -> None:
            for key in seen - believed:
                self._set(key, alive=True)
            for key in believed - seen:
                self._set(key, alive=False)

        session.liveliness().get(self._key_expr, Callback(on_reply, on_end, indirect=False), timeout=_LOOK_S)

    def _set(self, key: str, *, alive: bool) -> None:
        (self._alive.add if alive else self._alive.discard)(key)
        self._post(wire.TokenChanged(key, self._now_us(), alive))


def _said(failed: Exception) -> str:
    """Zenoh's error without the place in its sources that it ends in."""
    return str(failed).partition(" at /")[0]


def _end(leave: Callable[[], object]) -> None:
    """Undeclare or close something; Zenoh's stubs leave both untyped."""
    leave()


def _address_of(interface: str) -> str:
    """The IPv4 address of a network interface of this machine."""
    import psutil

    present = psutil.net_if_addrs()
    for address in present.get(interface, []):
        if address.family == socket.AF_INET:
            return str(address.address)
    raise SessionFailed(f"no IPv4 address on interface {interface!r}; this machine has {', '.join(sorted(present))}")
