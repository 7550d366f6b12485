"""What feeds the monitors: one subscription a stream and period, whatever many monitors look at it."""

from collections.abc import Callable
from typing import TypeAlias

from dyknow import Sample
from dyknow.network.stream_proxy import StreamProxy
from federation.sharing.translation import Convert

MAX_PREDICTIONS = 1024
"""Predicted samples of one stream whose making is remembered."""
Feed: TypeAlias = Callable[[Sample], None]


class Tap:
    """One subscription that feeds many synchronisers: every pair needs the platform's own position.

    Attributes:
        made_us: of the newest samples that were predicted, by valid time: when that was.
    """

    def __init__(self, to_semantic: Convert) -> None:
        self.feeds: tuple[Feed, ...] = ()
        self.subscription: StreamProxy | None = None
        self.made_us: dict[int, int] = {}
        self._to_semantic = to_semantic

    def on_sample(self, sample: Sample) -> None:
        prediction = sample.quality.prediction
        if prediction is not None:
            self.made_us[sample.valid_us] = prediction.made_us
            if len(self.made_us) > MAX_PREDICTIONS:
                del self.made_us[next(iter(self.made_us))]
        value = self._to_semantic(sample.value)
        if value is not sample.value:
            sample = sample._replace(value=value)
        for feed in self.feeds:
            feed(sample)
