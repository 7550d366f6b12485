"""What others say of their tracks is read, or is nothing; no number that is taken in ends a reader."""

from itertools import product

import pytest

from dyknow import NO_VALUE, Label, Sample
from dyknow.agents.capabilities.cooperation import track_records
from dyknow.agents.capabilities.cooperation.track_records import IDENTITIES, TRACKS, identity_claim
from dyknow.agents.capabilities.saliency import records
from dyknow.agents.exchange.import_proxy import ImportProxy
from dyknow.federation.sharing.ontology import default_ontology
from dyknow.federation.sharing.ranges import _MOST

ONTOLOGY = default_ontology()
READERS = {
    TRACKS: lambda sample, sort: track_records.track_report("3", sample, sort),
    IDENTITIES: lambda sample, _sort: identity_claim("3", sample.value),
    track_records.RELATIONS: lambda sample, _sort: track_records.pair_relation(sample),
    track_records.EVENTS: lambda sample, _sort: track_records.pair_event(sample),
    records.ENTRIES: lambda sample, _sort: records.person_entry("3", sample),
    records.PERCEPTS: lambda sample, _sort: records.person_look("3", sample),
}


@pytest.mark.parametrize("label", READERS)
def test_a_reader_bears_every_value_that_is_taken_in(label):
    sort = ONTOLOGY[label].sort
    for sign, texts, truth in product((1.0, -1.0, 0.0, None), ("", "a" * 16_384), (True, False)):
        value = tuple(
            texts if field.unit == "text" else truth if field.unit == "bool"
            else NO_VALUE if sign is None else sign * _MOST[field.unit] for field in sort.fields
        )  # fmt: skip
        sort.check(value)
        READERS[label](Sample(0, 0, value), sort)


def test_a_number_beyond_its_range_is_not_taken_in(wire):
    """What a member says of the age of an identity could not be an instant."""
    platform = wire.fly("0", 0.0, 0.0)
    wire.run(1.0)
    proxy = platform.part(ImportProxy)
    take = proxy._source("3", IDENTITIES)
    for born_s in (1e303, -1e303, 6.1e10, float("nan"), float("inf"), True, "soon"):
        take(Sample(wire.now_us, wire.now_us, ("car-1", "3-car-1", born_s, 1.0, False)))
    assert proxy.refused == {"range": 1, "sort": 6}
    take(Sample(wire.now_us, wire.now_us, ("car-1", "3-car-1", 1.5, 2.0, False)))
    generator = platform.ports.network.generator(Label.parse(f"{IDENTITIES}[3]"))
    assert [sample.value[2] for sample in generator.history.get_between(0, wire.now_us)] == [1.5]


def test_a_claim_is_read_in_microseconds():
    claim = identity_claim("3", ("car-1", "3-car-1", 1.5, 2.0, False))
    assert claim is not None
    assert (claim.born_us, claim.since_us) == (1_500_000, 2_000_000)
    assert identity_claim("3", ("car-1", "3-car-1", NO_VALUE, 2.0, False)) is None
