"""The global picture: one row for each object, whichever members see it.

    picture = GlobalPicture("0")
    picture.arrive("1", now_us)
    picture.report(TrackReport("1", "co7", state), now_us)     # of every member, this one too
    picture.claim(IdentityClaim("1", "co7", "car1_1", born_us, since_us), now_us)
    for event in picture.on_time(now_us): ...
    picture.claims(); picture.rows(now_us)                     # what to claim for tracks of "0"; the picture

Each member has a picture of its own and reports and claims for its own tracks. A look at all tracks is made on the grid of
`PERIOD_US`, for the time `HOLD_US` before, so that what comes late is there. Times are federation time.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from functools import partial
from itertools import count
from types import MappingProxyType
from typing import Final

import numpy as np

from dyknow import US_PER_S
from dyknow.anchoring.cooperation.evidence import Pair, TrackEvidence, ordered
from dyknow.anchoring.cooperation.grouping import groups
from dyknow.anchoring.cooperation.identities import Claims, Held, Named, named
from dyknow.anchoring.cooperation.memory import ABSENT_KEPT_US, KEPT_US, Remembered, has_room, matches
from dyknow.anchoring.cooperation.reports import IdentityClaim, ReportGate, TrackKey, TrackReport
from dyknow.anchoring.cooperation.rows import PictureEvent, PictureEventKind, PictureRow
from dyknow.anchoring.cooperation.tracks import NOISE, Tracks
from dyknow.anchoring.links.states import ObjectState, intersected, moved

PERIOD_US: Final = 200_000
HOLD_US: Final = 600_000
NEW_US: Final = US_PER_S
"""A track is seen for so long before its object gets a name."""
TURN_US: Final = 600_000
"""How much longer each further member waits for the first to name what they see together."""
WAIT_US: Final = 3 * US_PER_S
"""How long a track waits for a name if it may be that of another member's."""
STABLE_US: Final = 400_000
"""A name is given up when it has been another's for so long."""
MEET_US: Final = 2 * US_PER_S
"""Likewise where the other may be of the same object: after a cut it takes so long to see that it is."""
MOST_EVENTS: Final = 1000
_ALL: Final[Mapping[str, float]] = MappingProxyType({})


class GlobalPicture:
    """The picture of one member.

    Args:
        unit: the member; it names what it sees first.
        first: the number in the first name that it gives.
        trusted: how far other members are trusted, in [0, 1], by unit; others wholly.

    Attributes:
        gate: counts of refused reports, by member and reason.
        recent: the latest events.
        clock_sd_us: by member, the standard deviation of its clock against ours.
    """

    def __init__(self, unit: str, first: int = 1, trusted: Mapping[str, float] = _ALL) -> None:
        self.unit, self._trusted = unit, trusted
        self.gate = ReportGate()
        self.recent: deque[PictureEvent] = deque(maxlen=MOST_EVENTS)
        self.clock_sd_us: dict[str, int] = {}
        self._tracks, self._evidence = Tracks(self.gate), TrackEvidence()
        self._claims = Claims(self.gate.refuse)
        self._objects: dict[str, Remembered] = {}
        self._numbers = count(first)
        self._present = {unit}
        self._names = {unit}
        self._next_us: int | None = None
        self._named: list[Named] = []
        self._wrong_since_us: dict[TrackKey, int] = {}
        self._news: list[PictureEvent] = []
        self._reported: dict[tuple[str, str], int] = {}

    # Reports of members

    def arrive(self, unit: str, now_us: int, *, restarted: bool = False) -> None:
        """A member is there from now on; after a restart its symbols mean other tracks."""
        if restarted:
            self._tracks.restart(unit)
        if unit not in self._present:
            self._present.add(unit)
            self._claims.arrive(unit, now_us)
            self._note(now_us, "arrived", unit, "restarted" if restarted else "heard of")

    def depart(self, unit: str, now_us: int, why: str = "gone") -> None:
        """A member is gone, or cut off; its objects are kept."""
        if unit in self._present and unit != self.unit:
            self._present.discard(unit)
            self._claims.depart(unit, now_us)
            self._note(now_us, "departed", unit, why)

    def name_for(self, unit: str, *, names: bool = True) -> None:
        """Give names to the tracks of a member that has no picture of its own, or no longer: its symbols mean other tracks then."""
        if names is not (unit in self._names):
            self._tracks.restart(unit)
            (self._names.add if names else self._names.discard)(unit)

    def report(self, report: TrackReport, now_us: int) -> None:
        """Take the state of a track."""
        if report.unit not in self._present:
            self.arrive(report.unit, now_us)
        trust = self._trusted.get(report.unit, 1.0)
        if trust <= 0.0:
            self.gate.refuse(report.unit, "not trusted")
            return
        if trust < 1.0:
            state = report.state._replace(covariance=np.asarray(report.state.covariance) / trust)
            report = report._replace(state=state)
        self._tracks.take(report, now_us)

    def claim(self, claim: IdentityClaim, now_us: int) -> None:
        """Take what another member calls one of its tracks."""
        key = self._tracks.key(claim.unit, claim.symbol)
        track = self._tracks.get(key)
        if claim.unit == self.unit or track is None or not self.gate.is_affordable(claim.unit, now_us):
            return
        known = self._objects.get(claim.identity)
        is_taken = known is not None and key not in known.tracks
        is_new = key not in self._claims.held or self._claims.held[key].name != claim.identity
        if known is not None and is_taken and is_new and not known.is_seen:
            latest = track.seen[-1] if track.seen else None
            if latest is None or not known.may_be_at(latest):
                self.gate.refuse(claim.unit, "claims an object that is elsewhere")
                return
        before = self._claims.held.get(key)
        if self._claims.take(key, claim, now_us, None if known is None else known.born_us, is_taken=is_taken):
            self._is_now(before, claim.identity)

    # Claims, names and events

    def claims(self) -> list[IdentityClaim]:
        """The names that this member claims for its own tracks."""
        held = self._claims.held
        return [
            IdentityClaim(key.unit, key.symbol, each.name, each.born_us, each.since_us)
            for key in self._tracks.of(self.unit)
            if key == self._tracks.key(key.unit, key.symbol) and (each := held.get(key)) is not None
        ]

    def has(self, name: str) -> bool:
        """Whether there is an object of that name."""
        return name in self._objects

    def is_tracked_by(self, unit: str, name: str) -> bool:
        """Whether a member has a track of the object of that name."""
        return name in self._objects and any(key.unit == unit for key in self._objects[name].tracks)

    def name_of(self, unit: str, symbol: str) -> str | None:
        """The name of the object that a member tracks under a symbol."""
        key = self._tracks.key(unit, symbol)
        return next((each.name for each in self._named if key in each.tracks), None)

    def events(self, symbol: str | None = None) -> list[PictureEvent]:
        """The events that this member reports, of one object or of all; `symbol`: its name, or of a track of ours."""
        name = symbol if symbol is None or symbol in self._objects else self.name_of(self.unit, symbol)
        mine = (each for each in self.recent if each.by in {"", self.unit})
        tracks = self._objects[name].tracks if name in self._objects else ()
        names = {name, symbol, *map(str, tracks)}
        return [each for each in mine if symbol is None or each.name in names]

    def rows(self, now_us: int) -> list[PictureRow]:
        """All objects, by name."""
        return [self._row(each, now_us) for _, each in sorted(self._objects.items())]

    def _row(self, one: Remembered, now_us: int) -> PictureRow:
        by = tuple(sorted(one.units)) if one.is_seen else ()
        return PictureRow(one.name, one.at(now_us), one.seen_us, by, tuple(sorted(one.tracks)), one.others)

    @property
    def present(self) -> frozenset[str]:
        """The members that are there."""
        return frozenset(self._present)

    @property
    def deadline_us(self) -> int | None:
        """When the next look is due; None: at the first report."""
        return self._next_us

    # Looks

    def on_time(self, now_us: int) -> list[PictureEvent]:
        """Look at all tracks on the grid; returns the events."""
        due_us = now_us // PERIOD_US * PERIOD_US
        if self._next_us is not None and now_us < self._next_us:
            return []
        self._next_us = due_us + PERIOD_US
        self._look(due_us - HOLD_US, now_us)
        news, self._news = self._news, []
        return news

    def _look(self, at_us: int, now_us: int) -> None:
        gone = self._tracks.forget(now_us)
        self._evidence.forget(gone)
        self._claims.forget(gone)
        for key in gone:
            self._wrong_since_us.pop(key, None)
        joined, split = self._evidence.look(self._tracks, at_us, self.clock_sd_us)
        keys = [track.key for track in self._tracks if track.seen_us]
        self._possess(at_us)
        made = named(groups(keys, self._evidence), self._claims.held, partial(self._say, at_us))
        made = self._decide(made, at_us)
        self._named = made
        self._explain(joined, split, at_us)
        self._remember(made, at_us, now_us)
        self._report_refusals(now_us)

    def _is_live(self, key: TrackKey, at_us: int) -> bool:
        track = self._tracks.get(key)
        return track is not None and key.unit in self._present and track.is_live(at_us)

    def _say(self, at_us: int, key: TrackKey) -> float:
        """How far the member of a track is trusted, if it sees it."""
        return self._trusted.get(key.unit, 1.0) if self._is_live(key, at_us) else 0.0

    def _possess(self, at_us: int) -> None:
        """A track that we name holds its name at most since it is one thing."""
        for unit in self._names:
            for key, track in self._tracks.of(unit).items():
                held = self._claims.held.get(key)
                if held is None or not track.seen:
                    continue
                if track.check_course():
                    self._note(
                        at_us, "doubted", held.name, f"{key} turned as no vehicle does: it may be another", self.unit
                    )
                held.since_us = max(held.since_us, track.steady_us)

    def _decide(self, made: list[Named], at_us: int) -> list[Named]:
        """Name our tracks: as their group, as the object expected there, or with a new name."""
        unnamed: dict[TrackKey, ObjectState] = {}
        due: dict[TrackKey, int] = {}
        for at, each in enumerate(made):
            keys = [key for key in sorted(each.tracks) if key.unit in self._names and self._is_live(key, at_us)]
            if each.name is not None:
                for key in keys:
                    self._adopt(key, each, at_us)
            elif keys:  # tracks of one object are no rivals: one stands for all
                key, state = keys[0], self._tracks.of(keys[0].unit)[keys[0]].course
                if state is not None:
                    unnamed[key] = state
                    if self._is_due(key, each, at_us):
                        due[key] = at
        found = matches(unnamed, self._objects.values(), at_us)
        for key, at in due.items():
            if key in found.found:
                name, distance = found.found[key]
                because = f"{key} is where it was expected, d^2 = {distance:.1f}"
                self._note(at_us, "reacquired", name, because, self.unit)
                born_us = self._objects[name].born_us
            elif key in found.open and at_us - self._tracks.of(key.unit)[key].first_us < WAIT_US:
                continue
            else:
                name, born_us = self._new_name(), at_us
                self._note(at_us, "appeared", name, f"{key} is none of the known objects", self.unit)
            self._claims.held[key] = Held(name, born_us, at_us)
            self._wrong_since_us.pop(key, None)
            made[at] = made[at]._replace(name=name)
        return made

    def _is_due(self, key: TrackKey, group: Named, at_us: int) -> bool:
        """Whether to name what has no name yet: it was seen for long enough, and it is our turn."""
        track = self._tracks.of(key.unit)[key]
        held = self._claims.held.get(key)
        if held is not None:  # its name is another's
            known = self._objects.get(held.name)
            is_near = known is not None and bool(track.seen) and known.may_be_at(track.seen[-1])
            return self._is_stable(key, at_us, MEET_US if is_near else STABLE_US)
        seen_for_us = at_us - track.first_us
        turn = sorted(each.unit for each in group.tracks if self._is_live(each, at_us)).index(key.unit)
        waits_us = NEW_US + turn * TURN_US
        return seen_for_us >= (WAIT_US if self._evidence.is_open(key) else waits_us)

    def _adopt(self, key: TrackKey, group: Named, at_us: int) -> None:
        held = self._claims.held.get(key)
        if held is not None and held.name == group.name:
            self._wrong_since_us.pop(key, None)
            return
        if group.name is None or (held is not None and not self._is_stable(key, at_us)):
            return
        self._wrong_since_us.pop(key, None)
        born_us = min(self._claims.held[each].born_us for each in group.tracks if self._has(each, group.name))
        self._claims.held[key] = Held(group.name, born_us, at_us)
        self._is_now(held, group.name)
        if held is not None:
            self._note(at_us, "renamed", group.name, f"{key}, which was {held.name}, is {group.name}", self.unit)

    def _is_now(self, before: Held | None, name: str) -> None:
        """A track has another name: if no track holds the one before, that is another name of the same object."""
        if before is None or any(each.name == before.name for each in self._claims.held.values()):
            return
        gone, known = self._objects.pop(before.name, None), self._objects.get(name)
        if gone is not None and known is not None:
            known.others = tuple(dict.fromkeys((*known.others, gone.name, *gone.others)))[-8:]

    def _has(self, key: TrackKey, name: str) -> bool:
        held = self._claims.held.get(key)
        return held is not None and held.name == name

    def _is_stable(self, key: TrackKey, at_us: int, for_us: int = STABLE_US) -> bool:
        since_us = self._wrong_since_us.setdefault(key, at_us)
        return at_us - since_us >= for_us

    def _new_name(self) -> str:
        while True:
            name = f"car{self.unit}_{next(self._numbers)}"
            if name not in self._objects:
                return name

    # Kept objects

    def _remember(self, made: Iterable[Named], at_us: int, now_us: int) -> None:
        seen = set[str]()
        for each in made:
            live = [key for key in sorted(each.tracks) if self._is_live(key, at_us)]
            if each.name is None or not live:
                continue
            states = [state for key in live if (state := self._whereabouts(key)) is not None]
            units = frozenset(key.unit for key in live)
            if states and (each.name in self._objects or has_room(self._objects, units)):
                seen.add(each.name)
                self._see(each, live, states, at_us)
        for name, one in tuple(self._objects.items()):
            if name not in seen:
                self._keep(one, at_us, now_us)

    def _whereabouts(self, key: TrackKey) -> ObjectState | None:
        track = self._tracks.get(key)
        return None if track is None or not track.seen else track.seen[-1]

    def _see(self, group: Named, live: list[TrackKey], states: list[ObjectState], at_us: int) -> None:
        name = group.name or ""
        valid_us = max(state.valid_us for state in states)
        fused = moved(states[0], valid_us, NOISE)
        for state in states[1:]:
            fused = intersected(fused, moved(state, valid_us, NOISE))
        units, known = frozenset(key.unit for key in live), self._objects.get(name)
        if known is None:
            born_us = min(self._claims.held[key].born_us for key in group.tracks if self._has(key, name))
            known = self._objects[name] = Remembered(name, born_us, fused, valid_us, units)
            if not any(key.unit == self.unit for key in live):
                self._note(at_us, "appeared", name, f"{', '.join(map(str, live))}", live[0].unit)
        elif not known.is_seen and not any(each.name == name for each in self._news):
            because = f"{', '.join(map(str, live))} after {_span(valid_us - known.seen_us)}"
            self._note(at_us, "reacquired", name, because, live[0].unit)
        known.state, known.seen_us, known.units, known.is_seen = fused, valid_us, units, True
        known.tracks = group.tracks
        for other in group.others:
            if other in self._objects and not self._objects[other].is_seen:
                del self._objects[other]
        known.others = tuple(dict.fromkeys((*known.others, *group.others)))[-8:]

    def _keep(self, one: Remembered, at_us: int, now_us: int) -> None:
        """Keep an object that no member sees, or forget it."""
        if one.is_seen:
            one.is_seen = False
            away = sorted(one.units - self._present)
            why = f"{', '.join(away)} is cut off" if away else f"not seen by {', '.join(sorted(one.units))}"
            self._note(at_us, "lost", one.name, why, self._reporter(one))
        kept_us = KEPT_US if one.units <= self._present else ABSENT_KEPT_US
        if now_us - one.seen_us > kept_us:
            del self._objects[one.name]
            self._note(at_us, "forgotten", one.name, f"not seen for {_span(now_us - one.seen_us)}", self._reporter(one))

    # Words

    def _reporter(self, one: Remembered) -> str:
        """The member that reports what happens to an object that is not seen."""
        return min(one.units & self._present or self._present)

    def _explain(self, joined: Iterable[Pair], split: Iterable[Pair], at_us: int) -> None:
        for kind, pairs in (("joined", joined), ("split", split)):
            for pair in pairs:
                evidence = self._evidence.pairs.get(ordered(*pair))
                name = next((each.name for each in self._named if pair[0] in each.tracks), None)
                if evidence is not None:
                    text = f"{pair[0]} and {pair[1]}: d^2 = {evidence.mean:.1f}, mean of {len(evidence.distances)}"
                    self._note(
                        at_us, "joined" if kind == "joined" else "split", name or str(pair[0]), text, pair[0].unit
                    )

    def _report_refusals(self, now_us: int) -> None:
        """Report what is refused, at the first time and at each tenfold."""
        for (unit, reason), number in self.gate.refused.items():
            told = self._reported.get((unit, reason), 0)
            if number >= max(1, 10 * told):
                self._reported[unit, reason] = number
                self._note(now_us, "refused", unit, f"{reason}, {number} times")

    def _note(self, valid_us: int, kind: PictureEventKind, name: str, because: str, by: str = "") -> None:
        event = PictureEvent(valid_us, kind, name, because, by)
        self.recent.append(event)
        self._news.append(event)


def _span(span_us: int) -> str:
    return f"{span_us / US_PER_S:.1f} s"
