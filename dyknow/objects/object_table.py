"""The objects of one stream of object states: which are there, and since when (thesis 8.5.1, 8.7.5).

An object is there from the valid time of its first state. It has vanished with a state whose field `end` is true, or
`SILENCE_US` after its last state, as the active cars of section 8.7.5.
"""

from collections.abc import Callable, Iterator
from typing import Final, NamedTuple, TypeAlias

from dyknow.model.errors import SortError
from dyknow.model.instants import US_PER_S
from dyknow.model.labels import Label
from dyknow.model.members import MAX_MEMBERS, member_name
from dyknow.model.sample import Sample
from dyknow.model.values import NO_VALUE, Sort
from dyknow.network.process import FAR_US, ProcessNetwork
from dyknow.network.stream_proxy import StreamProxy
from dyknow.policies.policy import Policy

SILENCE_US: Final = 60 * US_PER_S
"""How long an object stays that has no new state, and no end."""


class ObjectChange(NamedTuple):
    """An object appeared, or vanished, at a valid time."""

    valid_us: int
    symbol: str
    appeared: bool


OnChange: TypeAlias = Callable[[ObjectChange, int], None]
"""Takes a change, and the present time."""
OnState: TypeAlias = Callable[[Sample], None]
Undo: TypeAlias = Callable[[], None]


class ObjectTable:
    """Takes one stream of object states while its objects are followed; a state costs the same however many there are.

    Times: microseconds of federation time. A newcomer beyond `MAX_MEMBERS` is left out, which is a fault.

    Attributes:
        label: of the stream.
        newest: the newest state of each object, in the order of when it came.
        proxy: the stream, while it is taken.
    """

    def __init__(self, network: ProcessNetwork, label: Label, sort: Sort) -> None:
        self.label, self.sort = label, sort
        self.newest: dict[str, Sample] = {}
        self._network = network
        self.proxy: StreamProxy | None = None
        self._on_change: dict[int, OnChange] = {}
        self._on_state: dict[str, dict[int, OnState]] = {}
        self._refused = set[str]()

    # Who follows

    def follow(self, on_change: OnChange) -> Undo:
        """Tell of every object that appears or vanishes from now on; `newest` has those that are there."""
        self._begin()
        self._on_change[id(on_change)] = on_change

        def undo() -> None:
            self._on_change.pop(id(on_change), None)
            self._tidy()

        return undo

    def follow_one(self, symbol: str, on_state: OnState) -> Undo:
        """Hand on every state of one object; its newest one at once."""
        self._begin()
        self._on_state.setdefault(symbol, {})[id(on_state)] = on_state
        if symbol in self.newest:
            on_state(self.newest[symbol])

        def undo() -> None:
            followers = self._on_state.get(symbol, {})
            followers.pop(id(on_state), None)
            if not followers:
                self._on_state.pop(symbol, None)
            self._tidy()

        return undo

    def read(self) -> list[tuple[str, Sample]]:
        """The objects that are there now, as far as the stream holds them, with their newest states."""
        undo = self.follow(_ignore)
        found = list(self.newest.items())
        undo()
        return found

    def _tidy(self) -> None:
        if not self._on_change and not self._on_state:
            self._rest()

    # Samples of the stream

    def _begin(self) -> None:
        """Take the stream, and learn from its held samples which objects are there."""
        if self.proxy is not None:
            return
        network = self._network
        self.proxy = network.connect(self.label, Policy(), self._on_sample, self._on_link)
        generator = network.find(self.label)
        for sample in () if generator is None else generator.held():
            if sample.valid_us + SILENCE_US > network.now_us:
                self._on_sample(sample)
        network.step(self)

    def _rest(self) -> None:
        proxy, self.proxy = self.proxy, None
        self.newest.clear()
        self._refused.clear()
        self._network.unstep(self)
        if proxy is not None:
            proxy.cancel()

    def _on_link(self, linked: bool) -> None:
        """Without a producer no object is there."""
        if not linked:
            for symbol in tuple(self.newest):
                self._vanish(symbol, self._network.now_us, self._network.now_us)

    def _on_sample(self, sample: Sample) -> None:
        if sample.value is NO_VALUE:
            return
        symbol: str = sample.value[0]
        if self.sort.is_end(sample.value):
            if symbol in self.newest:
                self._vanish(symbol, sample.valid_us, sample.available_us)
            return
        known = self.newest.pop(symbol, None)
        if known is None and not self._admits(symbol):
            return
        self.newest[symbol] = sample if known is None or sample.valid_us >= known.valid_us else known
        self._hand_on(symbol, sample)
        if known is None:  # followers from now on get its newest state
            self._tell(ObjectChange(sample.valid_us, symbol, appeared=True), sample.available_us)

    def _hand_on(self, symbol: str, sample: Sample) -> None:
        for on_state in tuple(self._on_state.get(symbol, {}).values()):
            on_state(sample)

    def _admits(self, symbol: str) -> bool:
        if len(self.newest) >= MAX_MEMBERS:
            self._refuse("", f"more than {MAX_MEMBERS} objects at once: {symbol[:40]} and others are left out")
            return False
        try:
            member_name(symbol)
        except SortError as wrong:
            self._refuse("symbols", f"{wrong}; a symbol is a name or a whole number")
            return False
        return True

    def _refuse(self, why: str, said: str) -> None:
        """Reported once while it takes the stream."""
        if why not in self._refused:
            self._refused.add(why)
            self._network.on_fault(self.label, said)

    def _vanish(self, symbol: str, valid_us: int, now_us: int) -> None:
        del self.newest[symbol]
        self._tell(ObjectChange(valid_us, symbol, appeared=False), now_us)

    def _tell(self, change: ObjectChange, now_us: int) -> None:
        for on_change in tuple(self._on_change.values()):
            on_change(change, now_us)

    # Time

    @property
    def deadline_us(self) -> int | None:
        """When the object with the oldest state vanishes; far away, and not none, while there is none."""
        if self.proxy is None:
            return None
        longest = next(iter(self.newest.values()), None)
        return FAR_US if longest is None else longest.valid_us + SILENCE_US

    def on_time(self, now_us: int) -> None:
        for symbol, state in self._silent(now_us):
            self._vanish(symbol, state.valid_us + SILENCE_US, now_us)

    def _silent(self, now_us: int) -> Iterator[tuple[str, Sample]]:
        while self.newest:
            symbol, state = next(iter(self.newest.items()))
            if state.valid_us + SILENCE_US > now_us:
                return
            yield symbol, state


def _ignore(_change: ObjectChange, _now_us: int) -> None:
    """No change is of interest."""
