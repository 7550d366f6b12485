"""One knowledge process host: connects to its platform, lets processes work, reads sources; connects again when left.

One thread owns the processes. The line's threads and those of sources leave messages in a queue, or in the outbox, and
continue; messages of the host are bounded (`agents/hosts/outbox.py`), those to it are bounded by the platform.
"""

import threading
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Final

from dyknow import Sample
from dyknow.agents.hosts.knowledge_host import KnowledgeHost, Read
from dyknow.agents.hosts.outbox import Outbox
from dyknow.federation.hosts.codec import decode_from_host, decode_from_platform, encode
from dyknow.federation.hosts.messages import Beat, Begin, End, FromHost, HostFault, HostOutput, Refuse, Want, Welcome
from dyknow.federation.members.clock import FederationClock
from dyknow.model.errors import ContentError, DecodeError, EndpointFailed, Refused
from dyknow.proxies.hosts.connection import BEAT_S, Line, connect
from dyknow.runtime.hosts.sources import SourceThread
from dyknow.runtime.loop import leave_alone_what_is_loaded

AGAIN_S: Final = 0.2
TOGETHER: Final = 256
"""Messages that are taken before a process works again."""
MAX_REPORTED: Final = 1000
_ENDED: Final = None


class HostProcess:
    """Runs a host until `stop`.

    Args:
        host: the host to run.
        path: of the platform's socket.
        say: takes an event for the user, as a JSON object.

    Raises:
        Refused: its offer cannot be encoded.
    """

    def __init__(self, host: KnowledgeHost, path: Path, say: Callable[[dict[str, Any]], None]) -> None:
        self._host, self._path, self._say = host, path, say
        try:
            self._registration = host.registration()
            decode_from_host(encode(self._registration))
        except (ContentError, DecodeError) as wrong:
            raise Refused(f"what the module offers cannot be registered: {wrong}", "not-supported") from None
        self._going = True
        self._queue: SimpleQueue[Any] = SimpleQueue()
        self._lock = threading.Lock()
        self._outbox = Outbox()
        self._line: Line | None = None
        self._sources: dict[int, SourceThread] = {}
        self._resting: list[SourceThread] = []
        self._labels: dict[int, str] = {}
        self._faults = set[tuple[str, str]]()
        self._sent_s = 0.0
        self._clock = FederationClock()
        self._offset_us = 0

    def run(self) -> None:
        """Serve the platform, and the one that comes after it, until `stop`.

        Raises:
            EndpointFailed: there is no platform at the first try.
            Refused: the platform refuses the whole offer.
        """
        is_first = True
        leave_alone_what_is_loaded()
        while self._going:
            try:
                connected = connect(self._path)
            except OSError as wrong:
                if is_first:
                    raise EndpointFailed(f"{self._path}: {wrong}") from None
                time.sleep(AGAIN_S)
                continue
            is_first = False
            self._serve(connected)

    def stop(self) -> None:
        """From any thread, or a signal."""
        self._going = False
        self._queue.put(_ENDED)

    def _serve(self, connected: Any) -> None:
        """One connection, from registration to its end."""
        self._queue, self._outbox = SimpleQueue(), Outbox()
        queue = self._queue
        self._outbox.put(self._registration)
        line = self._line = Line(connected, queue.put, lambda: queue.put(_ENDED), self._take)
        line.start()
        try:
            while self._going and self._step():
                pass
        finally:
            line.close()
            for process in tuple(self._sources):
                self._rest(process)
            self._host.reset()
            connected.close()
        if self._going:
            self._say({"event": "lost"})

    def _step(self) -> bool:
        """Let processes work on their inputs, one action, and take new messages; False when the connection is over."""
        worked = self._act()
        try:
            for _ in range(TOGETHER):
                came = self._queue.get(not worked)
                worked = True
                if came is _ENDED:
                    return False
                self._on_came(came)
        except Empty:
            pass
        return True

    def _act(self) -> bool:
        """One action from its beginning to its end; False if there was none to begin."""
        while (said := self._host.work(self._now_us())) is not None:
            self._put(said)
            if not self._host.acting:
                return True
        return False

    def _on_came(self, came: Any) -> None:
        if isinstance(came, SourceThread):
            for samples in came.taken():
                if self._sources.get(came.process) is came:
                    self._put(self._host.on_reading(came.process, samples))
            return
        try:
            message = decode_from_platform(came)
            steps = self._host.on_message(message)
        except DecodeError as wrong:
            raise Refused(
                f"the platform is not understood ({wrong}): is it another version?", "other-version"
            ) from None
        if isinstance(message, Begin):
            self._labels[message.process] = message.label
        for step in steps:
            self._perform(step)

    def _perform(self, step: Any) -> None:
        match step:
            case Welcome():
                self._clock = FederationClock(step.epoch_us, step.speed)
                self._offset_us = step.offset_us
                said = self._registration
                names = [each.name for each in said.units] + [each.name for each in said.sources if not each.label]
                self._say({"event": "registered", "prototypes": names, "labels": list(step.labels)})
            case Refuse(reason):
                raise Refused(reason, "not-registered")
            case Read():
                self._read(step)
            case Want(process, grid):
                if process in self._sources:
                    self._sources[process].grid = grid
            case End(process):
                self._rest(process)
                self._labels.pop(process, None)
                with self._lock:
                    self._outbox.forget(process)
            case _:
                self._put((step,))

    def _read(self, read: Read) -> None:
        self._resting = [each for each in self._resting if not each.is_at_rest]
        before = [each for each in self._resting if each.source is read.source]
        source = SourceThread(read, before, self._now_us, self._wall_s, self._on_reading, self._on_fault)
        self._sources[read.process] = source
        source.start()

    def _rest(self, process: int) -> None:
        source = self._sources.pop(process, None)
        if source is not None:
            source.rest()
            self._resting.append(source)

    # From the threads of sources, and of the line

    def _on_reading(self, source: SourceThread, samples: Sequence[Sample]) -> None:
        if not self._host.is_train:
            self._put((HostOutput(source.process, 0, 0, False, tuple(samples)),))
        elif source.leave(samples):
            self._queue.put(source)

    def _on_fault(self, process: int, said: str) -> None:
        self._put((HostFault(process, said),))

    def _put(self, said: Iterable[FromHost]) -> None:
        with self._lock:
            for each in said:
                self._outbox.put(each)
                if isinstance(each, HostFault):
                    self._tell(each)
        if self._line is not None:
            self._line.wake()

    def _tell(self, fault: HostFault) -> None:
        """Report faults of units at the host, too; each once."""
        label = self._labels.get(fault.process, "")
        if (label, fault.said) not in self._faults and len(self._faults) < MAX_REPORTED:
            self._faults.add((label, fault.said))
            self._say({"event": "fault", "label": label, "said": fault.said})

    def _take(self) -> list[bytes]:
        with self._lock:
            messages = self._outbox.take()
        now_s = time.monotonic()
        if not messages and now_s - self._sent_s >= BEAT_S / 2:
            messages = [encode(Beat(self._outbox.dropped))]
        if messages:
            self._sent_s = now_s
        return messages

    def _now_us(self) -> int:
        """Federation time: the platform's node clock is so far from the clock that all processes here share."""
        return self._clock.federation_us(time.monotonic_ns() // 1000 + self._offset_us)

    def _wall_s(self, span_us: int) -> float:
        return span_us / self._clock.speed / 1e6
