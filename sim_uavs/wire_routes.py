"""Who subscribes what, found by key: a put costs what it reaches, not what there is."""

from federation import keys
from sim_uavs.wire_sessions import Direction, Session

_ANY = "*"


def _start(key_expr: str) -> tuple[str, str]:
    """The two chunks that a key or an expression begins with; `*` for what an expression leaves open."""
    first, _, rest = key_expr.partition("/")
    second = rest.partition("/")[0]
    if _ANY in first:
        return _ANY, _ANY
    return first, _ANY if _ANY in second else second


class Routes:
    """The subscriptions of all sessions, and the way of each put.

    A way that many share, such as that of a heartbeat, is kept by its sender until a subscription or one of its
    transports changes. Dictionaries are sets that keep their order.
    """

    def __init__(self) -> None:
        self._wanted: dict[tuple[str, str], dict[str, dict[Session, None]]] = {}
        self._version = 0

    def subscribe(self, session: Session, key_expr: str) -> None:
        session.subscriptions.setdefault(key_expr)
        self._wanted.setdefault(_start(key_expr), {}).setdefault(key_expr, {})[session] = None
        self._version += 1

    def unsubscribe(self, session: Session, key_expr: str) -> None:
        session.subscriptions.pop(key_expr, None)
        self._forget(session, key_expr)

    def open(self, session: Session) -> None:
        """A session is there that has declared already what the one before it did."""
        for key_expr in session.subscriptions:
            self.subscribe(session, key_expr)

    def close(self, session: Session) -> None:
        """Nothing reaches the session any more."""
        for key_expr in session.subscriptions:
            self._forget(session, key_expr)

    def _forget(self, session: Session, key_expr: str) -> None:
        start = _start(key_expr)
        wanted = self._wanted.get(start, {})
        sessions = wanted.get(key_expr, {})
        if sessions.pop(session, session) is None:
            self._version += 1
        if not sessions:
            wanted.pop(key_expr, None)
        if not wanted:
            self._wanted.pop(start, None)

    def of(self, session: Session, key: str) -> tuple[Direction, ...]:
        """Where a put of `session` on `key` passes now."""
        if session.routes_version != self._version:
            session.routes_version = self._version
            session.routes.clear()
        found = session.routes.get(key)
        if found is None:
            found = tuple(self._directions(session, key))
            if len(found) > 1:
                session.routes[key] = found
        return found

    def _directions(self, session: Session, key: str) -> list[Direction]:
        first, second = _start(key)
        receivers: dict[Session, None] = {}
        for start in ((first, second), (first, _ANY), (_ANY, _ANY)):
            for key_expr, sessions in self._wanted.get(start, {}).items():
                if keys.matches(key_expr, key):
                    receivers.update(sessions)
        transports = session.transports
        ways = [transports[to.number].direction(session) for to in receivers if to.number in transports]
        return [way for way in ways if way.passes]
