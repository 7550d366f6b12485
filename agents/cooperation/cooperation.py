"""Cooperative anchoring as a part: tracks of all platforms that export them, one name for each object, one picture (thesis 9.2, 10.4).

A platform whose specification exports `object-tracks` takes part. It imports the tracks and the identities of all others that
do, makes the picture (`anchoring/cooperation/picture.py`), offers what it calls its own tracks as `object-identities`, and the picture
as `global-objects`. There is no leader: each platform comes to the same names by itself, so that none is lost.
"""

from collections.abc import Callable, Iterable

from agents.actions import FEDERATION, QUERIED, Action, Offer, Role
from agents.cooperation.track_records import (
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
from agents.exchange.label_agreements import LabelAgreements
from agents.exchange.local_instance import LocalInstance
from agents.exchange.partners import Partners
from agents.exchange.subscription_keeper import SubscriptionKeeper
from agents.part import Part, PeerChange
from agents.ports import PartRegistry, Ports
from anchoring.cooperation.picture import HOLD_US, GlobalPicture
from anchoring.cooperation.reports import IdentityClaim
from anchoring.cooperation.rows import PictureEvent
from dyknow import Label, Policy, Sample
from dyknow.network.generator import Subscription
from federation.members.liveness import PlatformAppeared, PlatformGone
from federation.members.offers import LabelAppeared, LabelGone
from federation.messages.acts import Act, Performative
from federation.messages.contents import ObjectPicture, PictureEntry
from federation.messages.descriptions import LabelEntry

CLAIMS_US = 1_000_000
"""So often a claim is repeated that has not changed."""
ROWS_A_PAGE = 40
_FIRST, _LIVES = 100, 1000


class Cooperation(Part):
    """Makes the picture. Times of the picture are federation time.

    Attributes:
        picture: None while the platform exports no tracks.
        tracks: the label of its own tracks.
        partners: the platforms whose streams are asked for.
        takers: the consumers of the samples of their streams, by semantic label.
    """

    heeds_samples = True
    offers = (Offer(FEDERATION, (Action(ObjectPicture, "on_object_picture", QUERIED, Role.OBSERVER),)),)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._boot, self._agent = ports.config.unit, ports.config.boot, ports.agent
        self._clock, self._network = ports.clock, ports.network
        self._translation, self._directory = ports.translation, ports.directory
        self._agreements = parts[LabelAgreements]
        self._offset_of, self._now_us, self._note, self._offer = ports.offset_of, ports.now_us, ports.note, ports.offer
        self._trusted = ports.config.trusted
        self.takers: dict[str, Callable[[str, Sample], None]] = {TRACKS: self._on_track, IDENTITIES: self._on_identity}
        self.partners = Partners(ports.network, parts[LocalInstance], parts[SubscriptionKeeper], self._on_sample)
        self._sort = ports.translation.ontology[TRACKS].sort
        self._labels = {
            name: ports.translation.local_label(name, ports.config.unit) for name in (TRACKS, IDENTITIES, PICTURE)
        }
        self.tracks = self._labels[TRACKS]
        for name in (IDENTITIES, PICTURE):
            ports.network.add_source(self._labels[name], ports.translation.local_sort(name))
        self.picture: GlobalPicture | None = None
        self._taken: Subscription | None = None
        self._boots: dict[str, int] = {}
        self._claimed: dict[str, tuple[IdentityClaim, int]] = {}
        self._shown = set[str]()
        self._is_due = False
        ports.network.meet(self._on_label)

    def labels(self) -> Iterable[LabelEntry]:
        if self.picture is None:
            return ()
        ontology = self._translation.ontology
        return [
            LabelEntry(label=name, sort=ontology[name].sort.name, type_hash=ontology[name].type_hash, period_us=0)
            for name in (IDENTITIES, PICTURE)
        ]

    # -- taking part -------------------------------------------------------------------------------------------

    def _on_label(self, label: Label) -> None:
        """The tracks of this platform are there."""
        if label == self.tracks and self._taken is None:
            self._is_due = True

    def _begin(self, now_us: int) -> None:
        self._is_due = False
        if self._taken is not None or not self._network.has(self.tracks):
            return
        self._taken = self._network.subscribe(self.tracks, Policy(), self._on_own, self._on_end)
        if self.picture is None:
            first = self._boot // 1000 % _LIVES * _FIRST + 1
            self.picture = GlobalPicture(self._unit, first, self._trusted)
        for entry in self._directory.entries():
            if any(each.label == TRACKS for each in entry.labels):
                self._meet(entry.unit, entry.boot, now_us)
        self._offer(now_us)

    def _on_end(self) -> None:
        """The specification exports them no longer, or otherwise."""
        self._taken = None
        if self.picture is not None:
            self.picture.arrive(self._unit, self._clock.federation_us(self._now_us()), restarted=True)
        self._is_due = True

    def _meet(self, unit: str, boot: int, now_us: int) -> None:
        """Another platform exports tracks."""
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
            take(unit, self._translation.to_semantic(label).sample(sample))

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
        if self._is_due:
            return 0
        if self.picture is None:
            return None
        due_us = self.picture.deadline_us
        return 0 if due_us is None else self._clock.wall_us(due_us)

    def on_time(self, now_us: int) -> None:
        """Look at all tracks when that is due, and report what is new."""
        if self._is_due:
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
        self._show(federation_us)

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

    def _show(self, federation_us: int) -> None:
        """The picture as a stream, while it has subscribers."""
        if self.picture is None or not self._network.generator(self._labels[PICTURE]).subscriptions:
            return
        at_us = federation_us - HOLD_US
        rows = {row.name: row for row in self.picture.rows(at_us)}
        with self._network.instant.whole():
            for row in rows.values():
                self._push(PICTURE, max(at_us, row.state.valid_us), row_value(row), federation_us)
            for name in self._shown - rows.keys():
                self._push(PICTURE, federation_us, ended_value(name), federation_us)
        self._shown = set(rows)

    def _push(self, name: str, valid_us: int, value: object, now_us: int) -> None:
        self._network.push(self._labels[name], valid_us, self._translation.to_local(name)(value), now_us)

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
        requester = act.sender.unit
        hidden = {unit for unit in self.partners.units if not self._may_hand_on(unit, requester)}
        rows = [each for each in self.picture.rows(self._clock.federation_us(now_us)) if hidden.isdisjoint(each.by)]
        entries = [
            PictureEntry(
                symbol=row.name,
                by=row.by,
                tracks=tuple(f"{key.unit}:{key.symbol}" for key in row.tracks)[:ROWS_A_PAGE],
                others=row.others,
                seen_us=row.seen_us,
                attributes=attributes_of(row),
            )
            for row in rows
        ]
        self._agent.answer_pages(
            act,
            entries,
            ROWS_A_PAGE,
            lambda page, more: ObjectPicture(members=members, objects=page, more=more),
            now_us,
        )

    def _may_hand_on(self, unit: str, requester: str) -> bool:
        """Whether a platform shares its tracks with the requester, too."""
        entry = self._directory.entry(unit)
        named = next((each.receivers for each in (entry.labels if entry else ()) if each.label == TRACKS), ())
        return not named or requester in named
