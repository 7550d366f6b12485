"""The platforms whose tracks are imported: their streams are requested, and their samples passed on."""

from collections.abc import Callable
from dataclasses import dataclass, field

from dyknow import Network, Policy, Sample
from dyknow.agents.exchange.local_instance import LocalInstance
from dyknow.agents.exchange.subscription_keeper import SubscriptionKeeper
from dyknow.network.stream_proxy import StreamProxy

MAX_DELAY_US = 1_000_000


@dataclass(slots=True)
class _Partner:
    """One platform: its streams, by semantic label, with their periods and subscriptions here."""

    streams: dict[str, tuple[int, StreamProxy]] = field(default_factory=dict)


class Partners:
    """Asks for streams of other platforms, changeable while it runs.

    Args:
        take: called with unit, semantic label and a sample that came, in semantic units.
    """

    def __init__(
        self,
        network: Network,
        local: LocalInstance,
        keeper: SubscriptionKeeper,
        take: Callable[[str, str, Sample], None],
    ) -> None:
        self._network, self._local, self._keeper, self._take = network, local, keeper, take
        self._partners: dict[str, _Partner] = {}

    @property
    def units(self) -> tuple[str, ...]:
        """The platforms whose streams are requested, sorted."""
        return tuple(sorted(self._partners))

    def labels(self, unit: str) -> frozenset[str]:
        """The labels that are requested of a platform."""
        partner = self._partners.get(unit)
        return frozenset() if partner is None else frozenset(partner.streams)

    def want(self, unit: str, wanted: dict[str, int], now_us: int) -> None:
        """Have these streams of a platform from now on, by semantic label with their periods, and no others. Node clock."""
        partner = self._partners.setdefault(unit, _Partner())
        for label, (period_us, subscription) in tuple(partner.streams.items()):
            if wanted.get(label) != period_us:
                subscription.cancel()
                del partner.streams[label]
                self._keeper.need(unit, (label, period_us, MAX_DELAY_US), now_us, wanted=False)
        for label, period_us in wanted.items():
            if label not in partner.streams:
                local, to_semantic = self._local.source(label, unit)
                subscription = self._network.connect(local, Policy(), to_semantic.into(self._taker(unit, label)))
                partner.streams[label] = period_us, subscription
                self._keeper.need(unit, (label, period_us, MAX_DELAY_US), now_us, wanted=True)
        if not partner.streams:
            del self._partners[unit]

    def _taker(self, unit: str, label: str) -> Callable[[Sample], None]:
        def take(sample: Sample) -> None:
            self._take(unit, label, sample)

        return take
