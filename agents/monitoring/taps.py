"""Inputs of the monitors: one subscription a stream and period, shared by all monitors that read it."""

from collections.abc import Callable
from typing import TypeAlias

from dyknow import Sample
from dyknow.network.stream_proxy import StreamProxy

MAX_PREDICTIONS = 1024
"""Predicted samples of one stream whose making is remembered."""
Feed: TypeAlias = Callable[[Sample], None]


class Tap:
    """One subscription that feeds many synchronisers: every pair needs the platform's own position.

    Attributes:
        made_us: of the newest samples that were predicted, by valid time: when that was.
    """

    def __init__(self) -> None:
        self.feeds: tuple[Feed, ...] = ()
        self.subscription: StreamProxy | None = None
        self.made_us: dict[int, int] = {}

    def on_sample(self, sample: Sample) -> None:
        prediction = sample.quality.prediction
        if prediction is not None:
            self.made_us[sample.valid_us] = prediction.made_us
            if len(self.made_us) > MAX_PREDICTIONS:
                del self.made_us[next(iter(self.made_us))]
        for feed in self.feeds:
            feed(sample)
