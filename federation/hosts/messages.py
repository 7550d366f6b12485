"""Messages between a platform and its knowledge process hosts on the local channel (thesis 5.2, 5.3).

A host offers prototypes; the platform begins and ends processes there, hands their inputs over and gets their outputs
back, many samples a message.

    host -> platform   Register  Made  Fault  Beat
    platform -> host   Welcome  Refuse  Begin  Want  Inputs  Chain  End

The platform sends a process at most `WINDOW` inputs more than the host says it has taken; `Backlog` holds the rest.
"""

from collections import deque
from collections.abc import Iterator
from typing import Any, Final, NamedTuple, TypeAlias

from dyknow.federation.messages.unpacking import MAX_BYTES
from dyknow.model.sample import Sample
from dyknow.policies.sampling import Grid

WINDOW: Final = 512
"""Inputs of one process that are under way."""
KEPT: Final = 1024
KEPT_BYTES: Final = 4_194_304
SAMPLES_BYTES: Final = MAX_BYTES - 64
"""So much of a message may be samples."""


class UnitOffer(NamedTuple):
    """A prototype of a computational unit; the fields are those of `UnitPrototype`."""

    name: str
    sort: str
    inputs: tuple[str, ...]
    samplewise: bool
    history_us: int
    cheaper: str
    priority: int


class SourceOffer(NamedTuple):
    """A prototype of a source; with a label a stream generator of the host."""

    name: str
    sort: str
    label: str


class FieldOffer(NamedTuple):
    """A field of a sort, and its unit; empty: a number without one."""

    name: str
    unit: str


class SortOffer(NamedTuple):
    """A sort that is declared with a unit or fields, and its values."""

    name: str
    unit: str
    fields: tuple[FieldOffer, ...]


class Register(NamedTuple):
    """The first message of a host: its identity, whether it lets processes follow each other, and its offer.

    `sorts`: the sorts of its prototypes that are declared with units or fields.
    """

    pid: int
    module: str
    train: bool
    units: tuple[UnitOffer, ...]
    sources: tuple[SourceOffer, ...]
    sorts: tuple[SortOffer, ...] = ()


class HostInput(NamedTuple):
    """A sample of input `i`, counted from 0."""

    i: int
    sample: Sample


class HostOutput(NamedTuple):
    """The outputs of a process.

    Attributes:
        taken: inputs it has been through since it began; how many of them, not which.
        serial: of the last `Chain` that held when it was made.
        past: whether it belongs to the history alone.
        samples: their available times count only where they are of the past.
    """

    process: int
    taken: int
    serial: int
    past: bool
    samples: tuple[Sample, ...]


class HostFault(NamedTuple):
    """Something a person wrote does not work."""

    process: int
    said: str


class Beat(NamedTuple):
    """The host lives; `dropped` samples were not taken in time."""

    dropped: int


class Welcome(NamedTuple):
    """The host's offer is taken: its prototypes can be used from now on.

    Attributes:
        labels: of the host's stream generators.
        epoch_us, speed: of the federation's clock.
        offset_us: the platform's node clock minus the monotonic clock of this machine.
    """

    unit: str
    labels: tuple[str, ...]
    epoch_us: int
    speed: float
    offset_us: int


class Refuse(NamedTuple):
    """The platform refuses the host's whole offer, and why."""

    reason: str


class Begin(NamedTuple):
    """Make a process; `output` is a policy in KPL, `grid` what of a source is wanted (None: all), `now_us` the time."""

    process: int
    prototype: str
    label: str
    now_us: int
    output: str
    grid: Grid | None


class Want(NamedTuple):
    """From now on this of a source is wanted."""

    process: int
    grid: Grid | None


class HostInputs(NamedTuple):
    """Samples for a process, in order; `past`: for its memory, and the history of its output."""

    process: int
    past: bool
    inputs: tuple[HostInput, ...]


class Chain(NamedTuple):
    """From now on input `i` of a process is what process `maker` makes, straight away (0: no longer)."""

    process: int
    i: int
    maker: int
    serial: int


class End(NamedTuple):
    """The process has no clients."""

    process: int


FromHost: TypeAlias = Register | HostOutput | HostFault | Beat
FromPlatform: TypeAlias = Welcome | Refuse | Begin | Want | HostInputs | Chain | End


class Backlog:
    """Packed samples that wait to be sent, the newest `KEPT` of them; dropped ones are counted."""

    __slots__ = ("_bytes", "_waiting", "dropped")

    def __init__(self) -> None:
        self._waiting: deque[tuple[Any, bytes]] = deque()
        self._bytes = self.dropped = 0

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, mark: Any, packed: bytes) -> int:
        """Let a sample wait; `mark` says what it shares a message with. How many gave way to it."""
        waiting, dropped = self._waiting, 0
        waiting.append((mark, packed))
        self._bytes += len(packed)
        while len(waiting) > KEPT or self._bytes > KEPT_BYTES:
            self._bytes -= len(waiting.popleft()[1])
            dropped += 1
        self.dropped += dropped
        return dropped

    def take(self, most: int) -> Iterator[tuple[Any, list[bytes]]]:
        """At most `most` of them, oldest first, those of one message together."""
        waiting = self._waiting
        while waiting and most > 0:
            mark, size, together = waiting[0][0], 0, list[bytes]()
            while waiting and most > 0 and waiting[0][0] == mark and size + len(waiting[0][1]) <= SAMPLES_BYTES:
                packed = waiting.popleft()[1]
                size += len(packed)
                together.append(packed)
                most -= 1
            self._bytes -= size
            yield mark, together
