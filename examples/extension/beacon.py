"""A beacon that rings on request, and streams how often it has rung."""

from typing import Annotated

from pydantic import Field

from dyknow import Sample
from dyknow.agents.actions import REQUESTED, Action, Offer, Role
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.members.offers import Service
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.contents import Content
from dyknow.federation.messages.descriptions import LabelEntry

RINGS, PERIOD_US = "beacon-rings", 100_000
LABELS = """
[beacon-rings]
sort = "rings"
meaning = "how often the beacon has rung"
fields = { count = "" }
"""


class RingBeacon(Content):
    """`(ring-beacon times: 3)`: ring that often."""

    times: Annotated[int, Field(ge=1, le=1000)] = 1


class Beacon(Part):
    """Rings, and counts it in a stream of its own."""

    offers = (
        Offer(Service("beacon", "beacon"), (Action(RingBeacon, "on_ring", REQUESTED, Role.DELEGATE, typed=True),)),
    )

    def __init__(self, ports: Ports, _parts: PartRegistry) -> None:
        self.agent, self.clock, self.count = ports.agent, ports.clock, 0
        self.entry, of = ports.ontology[RINGS], ports.translation
        self.source = ports.network.add_source(of.local_label(RINGS, ports.unit), of.local_sort(RINGS))

    def labels(self) -> tuple[LabelEntry, ...]:
        """The stream, which other platforms and commands find by its label."""
        sort = self.entry.sort.name
        return (LabelEntry(label=RINGS, sort=sort, type_hash=self.entry.type_hash, period_us=PERIOD_US),)

    def on_ring(self, act: Act, content: RingBeacon, now_us: int) -> None:
        """Ring, and answer how often it has rung by now; `now_us` is the node clock."""
        self.count += content.times
        federation_us = self.clock.federation_us(now_us)
        valid_us = federation_us // PERIOD_US * PERIOD_US
        self.source.push(Sample(federation_us, valid_us, (float(self.count),)))
        self.agent.done(act, now_us, f"rung {self.count} times")
