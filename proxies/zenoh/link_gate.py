"""The members that may be linked, by certificate: one link is closed without disturbing the others, as often as needed.

Zenoh reads its rules when a session is opened and closes no single link. It says of each link what certificate the
other side has shown; the socket of one whose certificate the roster does not admit is shut down, and Zenoh drops the
link. So are the oldest of more links with one certificate than a member may have, or it would take the places of all
others: a member that lost its link is linked again at once, though the dead one is listed still. The gate looks when
a transport is made, and Zenoh waits for it before it sends anything but the handshake. It looks twice a second
besides, for links that were there when the roster changed.

Of a peer that dials again while its last transport ends Zenoh tells the link alone, when it routes to it already. So
nothing is put until such an end is over, which takes 2 ms; members that dial without end may delay puts, by half of
the time, not hold them up.
"""

import contextlib
import os
import socket
import stat
import threading
import time
from collections.abc import Callable, Iterable
from ipaddress import ip_address
from pathlib import Path
from typing import Any, TypeAlias

from dyknow.federation.security.tls import LINKS, SESSIONS, named_until
from dyknow.federation.security.trust import Roster
from dyknow.federation.transport import CertificateEnds, HandlerFailed, LinkClosed, RosterKept, RosterRead
from dyknow.model.errors import RosterError
from dyknow.proxies.files.named_files import bounded_text

Post: TypeAlias = Callable[[LinkClosed | RosterRead | RosterKept | CertificateEnds | HandlerFailed], None]
Address: TypeAlias = tuple[str, int]
Ends: TypeAlias = tuple[str, str]
_LOOK_S = 0.5
CLOSED_AT_ONCE, MOST_OF_ONE = 2, SESSIONS
"""Surplus links of one certificate that are closed in each look: a session that is closed dials again at once, and a
handshake costs more than a link that is quiet. While places are scarce all are closed."""
RESERVED = 64
"""Places that are left when they are scarce."""
_CHUNK = 65_536
_STEP_S, _WAITS_S = 0.0005, 0.1
"""How often one put looks for the ends of transports that may not stay, and for how long it waits."""
_AHEAD_US = 86_400_000_000


class LinkGate:
    """Closes links to certificates that a roster does not admit, as its file says at any time.

    Args:
        path: of the roster.
        certificate: our own.
        links: lists the present links; called from a thread of the gate.
        sessions: lists the sessions that there are transports to.
        post: takes what became of links and of the file.
        now_us: the node clock.
    """

    def __init__(
        self,
        path: Path,
        certificate: Path,
        links: Callable[[], Iterable[Any]],
        sessions: Callable[[], Iterable[str]],
        post: Post,
        now_us: Callable[[], int],
    ) -> None:
        self._path, self._links, self._sessions, self._post, self._now_us = path, links, sessions, post, now_us
        self._stamp = self._stamped()
        self.roster = Roster.parse(path.read_text("utf-8"))
        self._admitted = self.roster.admitted
        self._lock = threading.Lock()
        self._of_one: dict[str, dict[Ends, None]] = {}
        self._closed: set[Ends] = set()
        _, ends_us = named_until(certificate.read_bytes())
        self._ends_us: int | None = ends_us
        self._ending: dict[str, int] = {}
        self._may_wait = _WAITS_S, time.monotonic()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="roster", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._ended.set()
        self._thread.join()

    def on_transport(self, zid: str) -> None:
        """A transport to that session is made: close it at once if it may not stay."""
        if zid in self.look():
            with self._lock:
                self._ending[zid] = self._ending.get(zid, 0) + 1

    def wait(self) -> None:
        """Wait until the transports that may not stay have ended, for half of the time at most."""
        if not self._ending:
            return
        begun_s = time.monotonic()
        left_s, at_s = self._may_wait
        left_s = min(_WAITS_S, left_s + (begun_s - at_s) / 2)
        while not self._have_ended() and time.monotonic() - begun_s < left_s:
            time.sleep(_STEP_S)
        ended_s = time.monotonic()
        self._may_wait = max(0.0, left_s - (ended_s - begun_s)), ended_s

    def _have_ended(self) -> bool:
        """Whether no transport is left that may not stay."""
        before = self._ending.copy()
        there = set(self._sessions())
        with self._lock:
            for zid, dialled in before.items():
                if zid not in there and self._ending.get(zid) == dialled:  # else it was made again meanwhile
                    del self._ending[zid]
        return not self._ending

    def look(self) -> set[str]:
        """Close every link that there is and that may not stay; the sessions that they went to."""
        links = list(self._links())
        there = {_ends(link) for link in links}
        with self._lock:
            self._closed &= there
            for name, of_one in list(self._of_one.items()):
                self._of_one[name] = {ends: None for ends in of_one if ends in there}
                if not self._of_one[name]:
                    del self._of_one[name]
        return {str(link.zid) for link in links if not self.on_link(link)}

    def on_link(self, link: Any) -> bool:
        """A link is there; whether it stays: its certificate is admitted, and it is not the oldest of too many."""
        name, ends = str(link.auth_identifier), _ends(link)
        member = self._admitted.get(link.auth_identifier)
        if member is None:
            if _shut(*map(_address, ends)):
                self._post(LinkClosed(name, self._now_us()))
            return False
        with self._lock:
            if ends not in self._closed:  # else Zenoh has not noticed yet
                self._of_one.setdefault(name, {})[ends] = None
            is_full = sum(map(len, self._of_one.values())) > SESSIONS - RESERVED
        if is_full:
            for each in list(self._of_one):  # whichever member takes the place of the one that is linked now
                self._close_surplus(each, MOST_OF_ONE)
        return True

    def _close_surplus(self, name: str, most: int) -> None:
        """Close the oldest of too many links with one certificate, at most `most` now."""
        with self._lock:
            of_one, member = self._of_one.get(name, {}), self._admitted.get(name)
            surplus = max(0, len(of_one) - (LINKS[member.role] if member is not None else 0))
            closed = list(of_one)[: min(most, surplus)]
            for each in closed:
                del of_one[each]
                self._closed.add(each)
        for each in closed:
            if _shut(*map(_address, each)):
                self._post(LinkClosed(name, self._now_us(), surplus=True))

    def _watch(self) -> None:
        while not self._ended.wait(_LOOK_S):
            try:
                self._read()
                if self._ends_us is not None and self._now_us() >= self._ends_us - _AHEAD_US:
                    self._post(CertificateEnds(self._ends_us, self._now_us()))
                    self._ends_us = None
                self.look()
                self._have_ended()
                for name in list(self._of_one):
                    self._close_surplus(name, CLOSED_AT_ONCE)
            except Exception as failed:  # noqa: BLE001  (contained: the gate looks again)
                self._post(HandlerFailed("roster and links", self._now_us(), repr(failed)))

    def _read(self) -> None:
        stamp = self._stamped()
        if stamp is None or stamp == self._stamp:
            return
        self._stamp = stamp
        try:
            text = bounded_text(self._path)
            roster = Roster.parse(text)
        except (OSError, RosterError) as wrong:
            self._post(RosterKept(str(wrong), self._now_us()))
            return
        if roster.is_successor_of(self.roster):
            self.roster, self._admitted = roster, roster.admitted
            self._post(RosterRead(text, self._now_us()))
        elif roster != self.roster:
            same = (roster.identity, roster.federation) == (self.roster.identity, self.roster.federation)
            why = f"its generation {roster.generation} is not later than {self.roster.generation}"
            self._post(RosterKept(why if same else "it is that of another federation", self._now_us()))

    def _stamped(self) -> tuple[int, int, int] | None:
        try:
            found = self._path.stat()
        except OSError:
            return None
        return found.st_ino, found.st_mtime_ns, found.st_size


def _ends(link: Any) -> Ends:
    return str(link.src), str(link.dst)


def _address(locator: str) -> Address:
    """Of `tls/127.0.0.1:7447`."""
    host, _, port = locator.partition("/")[2].partition("?")[0].partition("#")[0].rpartition(":")
    return _plain(host.strip("[]")), int(port)


def _plain(host: str) -> str:
    found = ip_address(host.partition("%")[0])
    mapped = getattr(found, "ipv4_mapped", None)
    return str(mapped or found)


def _shut(here: Address, there: Address) -> bool:
    """Shut the socket between these addresses down, and take what Zenoh has not read; whether there was one."""
    for name in Path("/dev/fd").iterdir():
        with contextlib.suppress(OSError):  # closed meanwhile, or no connection
            if stat.S_ISSOCK(name.stat().st_mode):
                with socket.socket(fileno=os.dup(int(name.name))) as copy:
                    if _connects(copy, here, there):
                        copy.shutdown(socket.SHUT_RDWR)  # from now on what arrives is answered by a reset
                        with contextlib.suppress(OSError):
                            while copy.recv(_CHUNK, socket.MSG_DONTWAIT):
                                pass
                        return True
    return False


def _connects(copy: socket.socket, here: Address, there: Address) -> bool:
    if copy.type != socket.SOCK_STREAM or copy.family not in {socket.AF_INET, socket.AF_INET6}:
        return False
    ends = [(_plain(host), port) for host, port, *_ in (copy.getsockname(), copy.getpeername())]
    return ends == [here, there]
