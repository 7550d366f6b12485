"""Messages of a host that wait to be sent: bounded, the newest samples of each process; a full one blocks no thread."""

from dyknow.federation.hosts.codec import encode, made_of, pack_sample
from dyknow.federation.hosts.messages import Backlog, Beat, FromHost, HostFault, HostOutput, Register
from dyknow.model.errors import ContentError

MAX_FAULTS = 64


class Outbox:
    """Samples wait per process and travel many at a time; a process that has ended sends nothing."""

    def __init__(self) -> None:
        self._first: list[bytes] = []
        self._waiting: dict[int, Backlog] = {}
        self._taken: dict[int, int] = {}
        self.dropped = 0

    def put(self, message: FromHost) -> None:
        """Leave a message; a sample that cannot be encoded becomes a fault."""
        if isinstance(message, Register | Beat):
            self._first.append(encode(message))
        elif isinstance(message, HostFault):
            self._fault(message)
        else:
            self._put(message)

    def forget(self, process: int) -> None:
        """A process is no more."""
        if self._waiting.pop(process, None) is not None:
            del self._taken[process]

    def take(self) -> list[bytes]:
        """Take all messages that wait."""
        messages, self._first = self._first, []
        waiting, self._waiting = self._waiting, {}
        for process, backlog in waiting.items():
            taken = self._taken.pop(process)
            if not len(backlog):
                messages.append(made_of(process, taken, 0, False, ()))
            for (serial, past), packed in backlog.take(len(backlog)):
                messages.append(made_of(process, taken, serial, past, packed))
        return messages

    def _put(self, made: HostOutput) -> None:
        process = made.process
        backlog = self._waiting.setdefault(process, Backlog())
        self._taken[process] = made.taken
        for sample in made.samples:
            try:
                self.dropped += backlog.put((made.serial, made.past), pack_sample(sample))
            except ContentError as wrong:
                self._fault(HostFault(process, str(wrong)))

    def _fault(self, fault: HostFault) -> None:
        if len(self._first) < MAX_FAULTS:
            self._first.append(encode(fault))
