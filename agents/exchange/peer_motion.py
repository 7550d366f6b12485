"""Plausibility of the motion that other platforms report: motion no vehicle can fly, or that two report alike.

It is only shown: reported motion is traffic, whether it can be flown or not, and others give way to it. Times are
federation time, those of conditions the node clock.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import chain
from typing import Final

from dyknow import NO_VALUE, Label, Sample
from dyknow.agents.part import Followed, Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.members.liveness import PlatformGone
from dyknow.federation.messages.descriptions import ConditionEntry
from dyknow.model.instants import US_PER_S, print_span
from dyknow.navigation.stated_motion import DEGREE_M, StatedMotion, StatedPlace, Unflown, moved_m

JUDGED: Final = frozenset({"heli-position", "heli-altitude", "heli-velocity", "camera-state"})
LOOK_US: Final = 500_000
SHOWN_US: Final = 10_000_000
"""How long something is shown after it was seen last."""
NOTED_AGAIN_US: Final = 600_000_000
AHEAD_S: Final = 2.0
MOST: Final = 512
SHOWN: Final = 8
DIGITS: Final = 8
ALIKE, ALIKE_M, RECENT_US = 5, 5.0, 3_000_000
"""Five equal positions at equal times, over a way, are no chance: two that stand next to each other may round alike."""


@dataclass(slots=True)
class _Seen:
    """An implausible report of a unit, in words, with the times of its first and last occurrence."""

    text: str
    since_us: int
    last_us: int


@dataclass(slots=True)
class _Alike:
    """Equal positions of two units."""

    first: StatedPlace
    last: StatedPlace
    number: int = 0
    later: int = 0
    earlier: int = 0


@dataclass(slots=True)
class _Peer:
    motion: StatedMotion = field(default_factory=StatedMotion)
    is_new: bool = False


class PeerMotion(Part):
    """See the module.

    Args:
        now_us: the node clock of the present step.
        offer: tells the directory that conditions have changed, at a time.
    """

    heeds_samples = True

    def __init__(self, ports: Ports, _parts: PartRegistry) -> None:
        self._unit, self._network, self._now_us = ports.unit, ports.network, ports.now_us
        self._offer, self._note = ports.offer, ports.note
        self._own = Label.parse(f"estimate[{ports.unit}]")
        self._ahead_us = round(AHEAD_S * US_PER_S * max(1.0, ports.clock.speed))
        self._peers: dict[str, _Peer] = {}
        self._seen: dict[tuple[str, str], _Seen] = {}
        self._noted_us: dict[tuple[str, str], int] = {}
        self._look_us: int | None = None
        self._is_news = False

    def take(self, unit: str, semantic_label: str, sample: Sample) -> None:
        """A sample of one of the labels `JUDGED`, in semantic units, came from a unit at a time."""
        at_us, valid_us, value, _ = sample
        if value is NO_VALUE or NO_VALUE in value:
            return
        peer = self._peers.get(unit)
        if peer is None:
            while len(self._peers) >= MOST:
                del self._peers[next(iter(self._peers))]
            peer = self._peers[unit] = _Peer()
        if self._look_us is None:
            self._look_us = self._now_us() + LOOK_US
        if valid_us > at_us + self._ahead_us:
            self._show(unit, "ahead", f"platform {unit} states its motion {print_span(valid_us - at_us)} ahead of time")
            return
        for found in self._judged(peer, semantic_label, sample):
            self._show(unit, found.kind, f"platform {unit} states {found.text}")

    def _judged(self, peer: _Peer, semantic_label: str, sample: Sample) -> Iterable[Unflown]:
        motion, (at_us, valid_us, value, quality) = peer.motion, sample
        match semantic_label:
            case "heli-position":
                peer.is_new = True
                return motion.on_position(valid_us, value[0], value[1], quality.deviation * DEGREE_M, at_us)
            case "heli-altitude":
                return motion.on_altitude(valid_us, value[0], quality.deviation)
            case "heli-velocity":
                motion.on_velocity(valid_us, *value)
            case "camera-state":
                return motion.on_camera(valid_us, value[0], value[1])
        return ()

    def _show(self, unit: str, kind: str, text: str) -> None:
        now_us = self._now_us()
        seen = self._seen.get((unit, kind))
        if seen is not None:
            seen.last_us = now_us
            return
        self._seen[unit, kind] = _Seen(text, now_us, now_us)
        self._is_news = True
        while len(self._seen) > MOST:
            del self._seen[next(iter(self._seen))]
        if now_us >= self._noted_us.get((unit, kind), -NOTED_AGAIN_US) + NOTED_AGAIN_US:
            self._noted_us.pop((unit, kind), None)
            self._noted_us[unit, kind] = now_us
            while len(self._noted_us) > MOST:
                del self._noted_us[next(iter(self._noted_us))]
            self._note(text)

    def conditions(self) -> Iterable[ConditionEntry]:
        """The members whose stated motion is not credible."""
        for seen in list(self._seen.values())[:SHOWN]:
            yield ConditionEntry(text=seen.text[:200], since_us=max(0, seen.since_us))

    def on_peer(self, change: PeerChange, now_us: int) -> None:  # noqa: ARG002  (as all parts)
        """A platform that is gone states nothing more; its conditions stay until their time is over."""
        if isinstance(change, PlatformGone):
            self._peers.pop(change.unit, None)

    @property
    def deadline_us(self) -> int | None:
        return self._look_us

    def on_time(self, now_us: int) -> Followed:
        """Compare the vehicles with each other; drop conditions without new evidence."""
        new = {unit for unit, peer in self._peers.items() if peer.is_new}
        if new:
            self._compare(new)
        for name, seen in list(self._seen.items()):
            if now_us > seen.last_us + SHOWN_US:
                del self._seen[name]
                self._is_news = True
        self._look_us = now_us + LOOK_US if new or self._seen else None
        if not self._is_news:
            return ()
        self._is_news = False
        self._offer(now_us)
        return None

    # -- two that state the same -------------------------------------------------------------------------------

    def _compare(self, new: set[str]) -> None:
        """Note equal positions at equal times; the stream that arrives later is the copy."""
        by_place: dict[tuple[int, float, float], tuple[str, StatedPlace]] = {}
        alike: dict[tuple[str, str], _Alike] = {}
        for unit, place in chain(self._own_places(), self._places(new)):
            where = place.valid_us, round(place.latitude_deg, DIGITS), round(place.longitude_deg, DIGITS)
            one, other = by_place.setdefault(where, (unit, place))
            if one != unit:
                found = alike.setdefault((one, unit), _Alike(place, place))
                found.last, found.number = place, found.number + 1
                found.later += one == self._unit or place.at_us > other.at_us
                found.earlier += one != self._unit and place.at_us < other.at_us
        for (one, unit), found in alike.items():
            if found.number >= ALIKE and sum(map(abs, moved_m(found.first, found.last))) >= ALIKE_M:
                self._show_alike(one, unit, found)

    def _show_alike(self, one: str, unit: str, found: _Alike) -> None:
        if one == self._unit:
            self._show(unit, "alike", f"platform {unit} states the positions of this platform")
        elif found.later == found.number:
            self._show(unit, "alike", f"platform {unit} states the positions of {one}, after it")
        elif found.earlier == found.number:
            self._show(one, "alike", f"platform {one} states the positions of {unit}, after it")
        else:
            self._show(unit, "alike", f"platforms {one} and {unit} state the same positions")

    def _places(self, new: set[str]) -> Iterator[tuple[str, StatedPlace]]:
        for unit in sorted(new):
            peer = self._peers[unit]
            peer.is_new = False
            places = peer.motion.places
            for place in places:
                if place.valid_us > places[-1].valid_us - RECENT_US:
                    yield unit, place

    def _own_places(self) -> Iterator[tuple[str, StatedPlace]]:
        generator = self._network.find(self._own)
        if generator is None or not generator.history.get_size():
            return
        newest_us = generator.history.get_latest().valid_us
        for sample in generator.history.get_between(newest_us - RECENT_US, newest_us):
            if sample.value is not NO_VALUE:
                latitude_deg, longitude_deg = sample.value[:2]
                yield self._unit, StatedPlace(sample.valid_us, latitude_deg, longitude_deg, sample.available_us)
