"""Subscriptions, found by key: a put costs what it reaches, not what there is."""

from dyknow.federation import keys
from dyknow.sim_uavs.world.sessions import Direction, Session

_ANY = "*"


def _start(key_expr: str) -> tuple[str, str]:
    """The two chunks that a key or an expression begins with; `*` for a chunk that an expression leaves open."""
    first, _, rest = key_expr.partition("/")
    second = rest.partition("/")[0]
    if _ANY in first:
        return _ANY, _ANY
    return first, _ANY if _ANY in second else second


class DeclaredRoutes:
    """Which sessions have declared which expressions. Dictionaries are sets that keep their order."""

    def __init__(self) -> None:
        self._sessions: dict[tuple[str, str], dict[str, dict[Session, None]]] = {}

    def add(self, session: Session, key_expr: str) -> None:
        self._sessions.setdefault(_start(key_expr), {}).setdefault(key_expr, {})[session] = None

    def discard(self, session: Session, key_expr: str) -> None:
        start = _start(key_expr)
        declared = self._sessions.get(start, {})
        sessions = declared.get(key_expr, {})
        sessions.pop(session, None)
        if not sessions:
            declared.pop(key_expr, None)
        if not declared:
            self._sessions.pop(start, None)

    def matching(self, key: str) -> dict[Session, None]:
        """The sessions whose expressions match `key`."""
        first, second = _start(key)
        found: dict[Session, None] = {}
        for start in ((first, second), (first, _ANY), (_ANY, _ANY)):
            for key_expr, sessions in self._sessions.get(start, {}).items():
                if keys.matches(key_expr, key):
                    found.update(sessions)
        return found


class Routes:
    """The subscriptions of all sessions, and the way of each put.

    A way that many share, such as that of a heartbeat, is kept by its sender until a subscription or one of its
    transports changes.
    """

    def __init__(self) -> None:
        self._subscribed = DeclaredRoutes()
        self._version = 0

    def subscribe(self, session: Session, key_expr: str) -> None:
        session.subscriptions.setdefault(key_expr)
        self._subscribed.add(session, key_expr)
        self._version += 1

    def unsubscribe(self, session: Session, key_expr: str) -> None:
        session.subscriptions.pop(key_expr, None)
        self._subscribed.discard(session, key_expr)
        self._version += 1

    def open(self, session: Session) -> None:
        """A session is there that has declared already what the one before it did."""
        for key_expr in session.subscriptions:
            self.subscribe(session, key_expr)

    def close(self, session: Session) -> None:
        """Nothing reaches the session from now on."""
        for key_expr in session.subscriptions:
            self._subscribed.discard(session, key_expr)
        self._version += 1

    def of(self, session: Session, key: str) -> tuple[Direction, ...]:
        """Where a put of `session` on `key` passes now."""
        if session.routes_version != self._version:
            session.routes_version = self._version
            session.routes.clear()
        found = session.routes.get(key)
        if found is None:
            transports = session.transports
            receivers = self._subscribed.matching(key)
            ways = [transports[to.number].direction(session) for to in receivers if to.number in transports]
            found = tuple([way for way in ways if way.passes])
            if len(found) > 1:
                session.routes[key] = found
        return found
