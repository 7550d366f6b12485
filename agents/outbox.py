"""What a host has to say and has not said yet: bounded, the newest samples of each process; a full one blocks nobody."""

from dyknow.errors import ContentError
from federation.host_codec import encode, made_of, pack_sample
from federation.hosting import Backlog, Beat, Fault, FromHost, Made, Register

MAX_FAULTS = 64


class Outbox:
    """Samples wait per process and travel many at a time; a process that is no more has nothing to say."""

    def __init__(self) -> None:
        self._first: list[bytes] = []
        self._waiting: dict[int, Backlog] = {}
        self._taken: dict[int, int] = {}
        self.dropped = 0

    def put(self, message: FromHost) -> None:
        """Something is to be said; a sample that cannot be said becomes a fault."""
        if isinstance(message, Register | Beat):
            self._first.append(encode(message))
        elif isinstance(message, Fault):
            self._fault(message)
        else:
            self._put(message)

    def forget(self, process: int) -> None:
        """A process is no more."""
        if self._waiting.pop(process, None) is not None:
            del self._taken[process]

    def take(self) -> list[bytes]:
        """All messages that are to be said now; none if there is nothing to say."""
        messages, self._first = self._first, []
        waiting, self._waiting = self._waiting, {}
        for process, backlog in waiting.items():
            taken = self._taken.pop(process)
            if not len(backlog):
                messages.append(made_of(process, taken, 0, False, ()))
            for (serial, past), packed in backlog.take(len(backlog)):
                messages.append(made_of(process, taken, serial, past, packed))
        return messages

    def _put(self, made: Made) -> None:
        process = made.process
        backlog = self._waiting.setdefault(process, Backlog())
        self._taken[process] = made.taken
        for sample in made.samples:
            try:
                self.dropped += backlog.put((made.serial, made.past), pack_sample(sample))
            except ContentError as wrong:
                self._fault(Fault(process, str(wrong)))

    def _fault(self, fault: Fault) -> None:
        if len(self._first) < MAX_FAULTS:
            self._first.append(encode(fault))
