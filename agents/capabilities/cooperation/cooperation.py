"""Cooperative anchoring as a part: tracks of all platforms that export them, one name for each object, one picture (thesis 9.2, 10.4).

A platform whose specification exports `object-tracks` takes part. It imports the tracks and the identities of all others that
do, makes the picture (`anchoring/cooperation/picture.py`), offers what it calls its own tracks as `object-identities`, and the picture
as `global-objects`. There is no leader: each platform comes to the same names by itself, so that none is lost.
"""

from collections.abc import Callable, Iterable
from functools import partial

from dyknow import Sample, Value
from dyknow.agents.actions import FEDERATION, QUERIED, Action, Offer, Role
from dyknow.agents.capabilities.cooperation.shared_map import SharedMap
from dyknow.agents.capabilities.cooperation.track_records import (
    IDENTITIES,
    PICTURE,
    TRACKS,
    attributes_of,
    claim_value,
    ended_value,
    identity_claim,
    row_value,
    track_report,
)
from dyknow.agents.part import PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.anchoring.cooperation.picture import HOLD_US, GlobalPicture
from dyknow.anchoring.cooperation.reports import IdentityClaim
from dyknow.anchoring.cooperation.rows import PictureEvent
from dyknow.federation.members.liveness import PlatformAppeared, PlatformGone
from dyknow.federation.members.offers import LabelAppeared, LabelGone
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import ObjectPicture, PictureEntry
from dyknow.federation.messages.descriptions import LabelEntry

CLAIMS_US = 1_000_000
"""Period at which an unchanged claim is repeated."""
ROWS_A_PAGE = 40
NAMES_A_LIFE = 100


class Cooperation(SharedMap):
    """Makes the picture. Times of the picture are federation time.

    Attributes:
        picture: None while the platform exports no tracks.
        tracks: the label of its own tracks.
        takers: the consumers of the samples of their streams, by semantic label.
    """

    own = shared = TRACKS
    shown = PICTURE
    made = (IDENTITIES, PICTURE)
    heeds_samples = True
    offers = (Offer(FEDERATION, (Action(ObjectPicture, "on_object_picture", QUERIED, Role.OBSERVER),)),)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        super().__init__(ports, parts)
        self._clock, self._trusted = ports.clock, ports.config.trusted
        self._offset_of, self._now_us, self._note, self._offer = ports.offset_of, ports.now_us, ports.note, ports.offer
        self.takers: dict[str, Callable[[str, Sample], None]] = {TRACKS: self._on_track, IDENTITIES: self._on_identity}
        self._sort = ports.translation.ontology[TRACKS].sort
        self.tracks = self._labels[TRACKS]
        self._add(self.made)
        self.picture: GlobalPicture | None = None
        self._boots: dict[str, int] = {}
        self._claimed: dict[str, tuple[IdentityClaim, int]] = {}

    def labels(self) -> Iterable[LabelEntry]:
        return () if self.picture is None else super().labels()

    # -- taking part -------------------------------------------------------------------------------------------

    def _begin(self, now_us: int) -> None:
        self._due_us = None
        if not self._take(self._on_own):
            return
        if self.picture is None:
            self.picture = GlobalPicture(self._unit, self._first_number(NAMES_A_LIFE), self._trusted)
        for entry in self._directory.entries():
            if any(each.label == TRACKS for each in entry.labels):
                self._meet(entry.unit, entry.boot, now_us)
        self._offer(now_us)

    def _on_end(self) -> None:
        """The specification exports them no longer, or otherwise."""
        if self.picture is not None:
            self.picture.arrive(self._unit, self._clock.federation_us(self._now_us()), restarted=True)
        self._due_us = 0

    def _meet(self, unit: str, boot: int, now_us: int) -> None:
        """Take another platform that exports tracks into the picture."""
        if self.picture is None or unit == self._unit or self._agreements.disagreement(unit, TRACKS):
            return
        federation_us = self._clock.federation_us(now_us)
        self.picture.arrive(unit, federation_us, restarted=self._boots.get(unit, boot) != boot)
        self._boots[unit] = boot

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """Platforms and their tracks come and go."""
        if self.picture is None:
            return
        match change:
            case LabelAppeared(unit, label) if label.label == TRACKS:
                entry = self._directory.entry(unit)
                if entry is not None:
                    self._meet(unit, entry.boot, now_us)
            case LabelGone(unit, label) if label.label == TRACKS and unit in self._boots:
                self.picture.depart(unit, self._clock.federation_us(now_us), "shares no tracks now")
            case PlatformGone(unit, _, why) if unit in self._boots:
                self.picture.depart(unit, self._clock.federation_us(now_us), str(why))
            case PlatformAppeared(unit, boot, _) if unit in self._boots:
                self._meet(unit, boot, now_us)

    # -- samples -----------------------------------------------------------------------------------------------

    def _on_own(self, sample: Sample) -> None:
        self._on_sample(self._unit, TRACKS, sample)

    def _on_sample(self, unit: str, label: str, sample: Sample) -> None:
        take = self.takers.get(label)
        if self.picture is not None and take is not None:
            take(unit, sample)

    def _on_track(self, unit: str, sample: Sample) -> None:
        report = track_report(unit, sample, self._sort)
        if self.picture is not None and report is not None:
            self.picture.report(report, max(self._network.now_us, sample.available_us))

    def _on_identity(self, unit: str, sample: Sample) -> None:
        claim = identity_claim(unit, sample.value)
        if self.picture is not None and claim is not None:
            self.picture.claim(claim, max(self._network.now_us, sample.available_us))

    # -- time --------------------------------------------------------------------------------------------------

    @property
    def deadline_us(self) -> int | None:
        if self._due_us is not None:
            return 0
        if self.picture is None:
            return None
        due_us = self.picture.deadline_us
        return 0 if due_us is None else self._clock.wall_us(due_us)

    def on_time(self, now_us: int) -> None:
        """Look at all tracks when that is due, and report what is new."""
        if self._due_us is not None:
            self._begin(now_us)
        due_us = self.deadline_us
        if self.picture is None or due_us is None or now_us < due_us:
            return
        federation_us = self._clock.federation_us(now_us)
        for unit in self.partners.units:
            offset = self._offset_of(unit)
            if offset is not None:
                self.picture.clock_sd_us[unit] = offset.bound_us // 2
        for event in self.picture.on_time(federation_us):
            self._tell(event)
        self._claim(federation_us)
        at_us = federation_us - HOLD_US
        self._show(partial(self._values, self.picture, at_us), ended_value, federation_us, federation_us)

    def _tell(self, event: PictureEvent) -> None:
        """Note platforms that come and go, and refused reports."""
        if event.kind in {"arrived", "departed"}:
            self._note(f"picture: platform {event.name} {event.kind}: {event.because}")
        elif event.kind == "refused":
            self._note(f"picture: of platform {event.name} is left out: {event.because}")

    def _claim(self, federation_us: int) -> None:
        if self.picture is None:
            return
        held = {claim.symbol: claim for claim in self.picture.claims()}
        for symbol, claim in held.items():
            known, told_us = self._claimed.get(symbol, (None, 0))
            if known != claim or federation_us - told_us >= CLAIMS_US:
                self._claimed[symbol] = claim, federation_us
                self._push(IDENTITIES, federation_us, claim_value(claim), federation_us)
        for symbol in self._claimed.keys() - held.keys():
            del self._claimed[symbol]

    @staticmethod
    def _values(picture: GlobalPicture, at_us: int) -> dict[str, tuple[int, Value]]:
        return {row.name: (max(at_us, row.state.valid_us), row_value(row)) for row in picture.rows(at_us)}

    # -- questions ---------------------------------------------------------------------------------------------

    def on_object_picture(self, act: Act, _content: ObjectPicture, now_us: int) -> None:
        """`(object-picture)`: the rows whose tracks the requester may see; without members there is no picture here.

        Raises:
            Denied: it may see none of it.
        """
        if self.picture is None:
            self._agent.answer(act, Performative.INFORM, ObjectPicture(members=(), objects=()), now_us)
            return
        self._agreements.check(act.sender.unit, TRACKS)
        members = tuple(sorted(self.picture.present))
        hidden = self._hidden(self.partners.units, act.sender.unit)
        entries = [
            PictureEntry(
                symbol=row.name,
                by=row.by,
                tracks=tuple(f"{key.unit}:{key.symbol}" for key in row.tracks)[:ROWS_A_PAGE],
                others=row.others,
                seen_us=row.seen_us,
                attributes=attributes_of(row),
            )
            for row in self.picture.rows(self._clock.federation_us(now_us))
            if hidden.isdisjoint(row.by)
        ]
        self._agent.answer_pages(
            act,
            entries,
            ROWS_A_PAGE,
            lambda page, more: ObjectPicture(members=members, objects=page, more=more),
            now_us,
        )
