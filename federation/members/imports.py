"""The streams that a member imports: each sample taken off the wire once, and lost ones asked for again.

The receiver decides about a sample: a platform translates it into a local source, a command prints it.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from dyknow.federation import keys
from dyknow.federation.members.deadlines import Deadlines
from dyknow.federation.messages.codec import StreamSample, decode_recovered, decode_samples
from dyknow.federation.sharing.streams import ImportStream
from dyknow.federation.transport import Answered, Arrived, Ask, AskEnded, Subscribe, Unsubscribe

ImportName: TypeAlias = tuple[str, str, str]
"""Owner, semantic label and policy hash."""
Take: TypeAlias = Callable[[Sequence[StreamSample], int], None]
"""Takes new samples of one stream, and when they arrived (node clock)."""
OnEvery: TypeAlias = Callable[[int], None]
"""Only each `every`-th sample of one stream comes from now on; 1: all."""


@dataclass(slots=True)
class ImportRecord:
    """One stream of one owner: its subscriber, when it was last heard of, when it asks for missing samples.

    `valid_us` is the valid time of the newest sample that came by itself, federation time.

    Only each `every`-th sample of its period comes; more than 1 while the owner sheds load.
    """

    stream: ImportStream
    take: Take
    heard_us: int
    on_every: OnEvery | None = None
    due_us: int | None = None
    every: int = 1
    valid_us: int | None = None


class Imports:
    """All imported streams of one member. Times are the node clock.

    Args:
        questions: numbers the questions of the whole node.

    Attributes:
        streams: by owner, semantic label and policy hash.
        changes: how many streams have begun or ended.
        tails: by owner, the tails that need not be compared again.
    """

    def __init__(self, questions: Iterator[int]) -> None:
        self.streams: dict[ImportName, ImportRecord] = {}
        self.changes = 0
        self.tails: dict[str, Sequence[tuple[str, str, int]]] = {}
        self._questions = questions
        self._by_key: dict[str, ImportRecord] = {}
        self._asked: dict[int, ImportRecord] = {}
        self._due: Deadlines[ImportName] = Deadlines()

    def begin(self, name: ImportName, take: Take, now_us: int, on_every: OnEvery | None = None) -> list[Subscribe]:
        """Listen to a stream that its owner announced; nothing if it is imported already.

        `on_every` is called when the owner begins to send another share of its samples.
        """
        if name in self.streams:
            return []
        imported = ImportRecord(ImportStream(*name, self._questions), take, now_us, on_every)
        self.streams[name] = self._by_key[keys.stream(*name)] = imported
        self.tails.pop(name[0], None)
        self.changes += 1
        return [Subscribe(keys.stream_expr(*name[1:]))]

    def end(self, name: ImportName) -> list[Unsubscribe]:
        """Stop listening; the key is unsubscribed with the last stream on it."""
        if self.streams.pop(name, None) is None:
            return []
        del self._by_key[keys.stream(*name)]
        self._due.set(name, None)
        self.tails.pop(name[0], None)
        self.changes += 1
        if any(other[1:] == name[1:] for other in self.streams):
            return []
        return [Unsubscribe(keys.stream_expr(*name[1:]))]

    def on_owner(self, owner: str, boot: int) -> None:
        """The directory names the incarnation of `owner`: numbers of an earlier one no longer count."""
        self.tails.pop(owner, None)
        for imported in self.streams.values():
            if imported.stream.owner == owner:
                imported.stream.on_owner(boot)
                self._schedule(imported)

    def on_arrived(self, event: Arrived) -> bool:
        """Samples were put on a stream's key; False if it is no stream's.

        Raises:
            DecodeError: they are malformed.
        """
        key, at_us, payload = event
        imported = self._by_key.get(key)
        if imported is None:
            name = keys.parse_key(key)
            if type(name) is not keys.StreamKey:
                return False
            boot, entries, riders, every = decode_samples(payload)
            owner = name.owner
        else:
            boot, entries, riders, every = decode_samples(payload)
            self._take(imported, boot, entries, every, at_us)
            owner = imported.stream.owner
        for label, policy_hash, carried in riders:
            imported = self.streams.get((owner, label, policy_hash))
            if imported is not None:
                self._take(imported, boot, carried, every, at_us)
        return True

    def _take(self, imported: ImportRecord, boot: int, entries: Sequence[StreamSample], every: int, at_us: int) -> None:
        imported.heard_us = at_us
        if every != imported.every:
            imported.every = every
            if imported.on_every is not None:
                imported.on_every(every)
        new = imported.stream.on_samples(boot, entries, at_us)
        if new:
            imported.valid_us = new[-1].valid_us
        if new is not entries:  # a sample in order changes nothing about the missing ones
            self._schedule(imported)
        imported.take(new, at_us)

    def on_tails(self, owner: str, boot: int, tails: Sequence[tuple[str, str, int]], now_us: int) -> bool:
        """A heartbeat of `owner` names the newest number of each stream, so that a lost last sample is noticed.

        Returns whether anything is due because of it.
        """
        is_due = False
        for label, policy_hash, tail in tails:
            imported = self.streams.get((owner, label, policy_hash))
            if imported is None:
                continue
            self.tails[owner] = tails
            if not imported.stream.has(boot, tail):
                imported.stream.on_tail(boot, tail, now_us)
                self._schedule(imported)
                is_due = is_due or imported.stream.deadline_us is not None
        return is_due

    def on_answered(self, event: Answered) -> bool:
        """Recovered samples; False if the question is not from here.

        Raises:
            DecodeError: they are malformed.
        """
        imported = self._asked.get(event.question)
        if imported is None:
            return False
        new = imported.stream.on_recovered(decode_recovered(event.payload), event.at_us)
        self._schedule(imported)
        imported.take(new, event.at_us)
        return True

    def on_ask_ended(self, event: AskEnded) -> bool:
        """No more answers come; False if the question is not from here."""
        imported = self._asked.pop(event.question, None)
        if imported is not None:
            imported.stream.on_ask_ended(event.question, event.at_us)
            self._schedule(imported)
        return imported is not None

    @property
    def deadline_us(self) -> int | None:
        return self._due.next_us

    def on_time(self, now_us: int) -> list[Ask]:
        """Ask for missing samples."""
        asks: list[Ask] = []
        for name in self._due.pop_due(now_us):
            imported = self.streams.get(name)
            if imported is None:
                continue
            imported.due_us = None
            for ask in imported.stream.on_time(now_us):
                self._asked[ask.question] = imported
                asks.append(ask)
            self._schedule(imported)
        return asks

    def _schedule(self, imported: ImportRecord) -> None:
        stream = imported.stream
        if (due_us := stream.deadline_us) != imported.due_us:
            imported.due_us = due_us
            self._due.set((stream.owner, stream.label, stream.policy_hash), due_us)
