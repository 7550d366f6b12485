"""Platforms that offer how much gas there is at a cost, and one that calls for it."""

from collections.abc import Mapping
from typing import Any

from dyknow import Quality
from dyknow.agents.capabilities.calls.calls import Calls
from dyknow.agents.effects import Fed
from dyknow.federation.calls.call import StreamCall
from tests.box import Box

LABEL = 'sort level in bar\nlabel gas-level : level "how much gas there is"\n'
CALL = f"{LABEL}call gas-level as gas[best] with sample every 100ms, max delay 500ms, min certainty 0.8\nstream out = gas[best]"
PERIOD_US = 100_000


def offer(cost: float, promise: str = "sample every 100ms, max delay 200ms, min certainty 0.9", to: str = "") -> str:
    """The specification of a platform that offers it."""
    receivers = f" to {to}" if to else ""
    return (
        f"{LABEL}source level sensor\nstrmgen gas[self] = sensor\n"
        f"offer gas-level = gas[self] at cost {cost}{receivers} with {promise}\n"
    )


class Market:
    """A federation of offers; each sensor is read ten times a second, its value being the number of its unit.

    Attributes:
        certainty: of what the sensor of a unit brings; None: it brings nothing.
        every: which samples of all it brings.
    """

    def __init__(self, box: Box, offers: Mapping[str, str], call: str = CALL) -> None:
        self.box, self.offers = box, offers
        self.certainty: dict[str, float | None] = dict.fromkeys(offers, 0.95)
        self.every: dict[str, int] = {}
        for unit, text in offers.items():
            box.join(unit)
            box.specify(unit, text)
        box.join("0")
        if call:
            box.specify("0", call)
        box.at(box.now_us, self._read)

    def _read(self) -> None:
        for unit, certainty in self.certainty.items():
            valid_us = self.box.now_us - self.box.now_us % PERIOD_US
            is_brought = certainty is not None and valid_us // PERIOD_US % self.every.get(unit, 1) == 0
            if unit in self.box.running and is_brought:
                self.box.happens(unit, Fed(self.box.now_us, "sensor", valid_us, float(unit), Quality(certainty or 0.0)))
        self.box.at(self.box.now_us + PERIOD_US, self._read)

    @property
    def call(self) -> StreamCall:
        [stream] = self.box.platform("0").part(Calls)._streams
        assert stream.call is not None
        return stream.call

    def news(self, *events: str) -> list[tuple[str, str]]:
        """What happened in the call of platform 0, of these kinds: event and unit."""
        told = [each for each in self.box.nodes["0"].results if each["event"] == "call"]
        return [(each["what"], each["unit"]) for each in told if not events or each["what"] in events]

    def samples(self) -> list[tuple[int, Any]]:
        """(valid time, value) of what came under the label of the caller."""
        told = [each for each in self.box.nodes["0"].results if each["event"] == "sample"]
        return [(each["valid_us"], each["value"]) for each in told]

    def takes_us(self, unit: str, within_s: float) -> int:
        """How long it is until samples of `unit` come, at most `within_s` seconds; microseconds."""
        since_us = self.box.now_us
        before = len(self.samples())
        while self.box.now_us < since_us + within_s * 1e6:
            self.box.run(0.05)
            if any(value == float(unit) for _, value in self.samples()[before:]):
                break
        return self.box.now_us - since_us
