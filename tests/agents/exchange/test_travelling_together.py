"""Streams with the same receivers are sent in one message. A stream is sent to its own receivers only."""

from dyknow.agents.platform import Platform
from dyknow.federation import keys
from dyknow.federation.messages.codec import Rider, StreamedSamples, StreamSample, decode_samples, encode_samples
from dyknow.federation.transport import Put
from tests.agents.exchange.test_federation_agent import multicast
from tests.box import Box


def put_of(wire: Box, owner: str, since: int) -> list[tuple[str, StreamedSamples]]:
    """The label and the content of each message of samples that `owner` has sent since that many puts."""
    found = [(keys.parse_key(crossed.put.key), crossed.put.payload) for crossed in wire.wire.log[since:]]
    return [
        (key.label, decode_samples(data)) for key, data in found if type(key) is keys.StreamKey and key.owner == owner
    ]


def test_what_the_same_receivers_get_is_one_message_an_instant(wire: Box, node: Platform) -> None:
    wire.asked("0", "1", multicast("heli-position", "heli-altitude", "heli-velocity", to=("0",)))
    wire.run(1.0)
    since = len(wire.wire.log)
    wire.run(2.0)
    put = put_of(wire, "1", since)
    assert len(put) == 10, "an instant every 200 ms"
    for label, found in put:
        labels = {label, *(rider.label for rider in found.riders)}
        assert labels == {"heli-position", "heli-altitude", "heli-velocity"}
        assert len({sample.valid_us for each in (found, *found.riders) for sample in each.samples}) == 1
    for name in ("heli-position", "heli-altitude", "heli-velocity"):
        assert node.built.gateway.latest(name, "1").valid_us == put[-1][1].samples[0].valid_us
    accounts = [record.stream.account for record in node.built.gateway.importer.imports.streams.values()]
    assert all((account.lost, account.duplicates, account.recovered) == (0, 0, 0) for account in accounts)


def test_a_stream_for_others_does_not_travel_along(wire: Box, node: Platform) -> None:
    wire.join("2")
    wire.run(1.0)
    wire.asked("0", "1", multicast("heli-position", to=("0", "2")))
    wire.asked("0", "1", multicast("heli-altitude", to=("0",)))
    wire.run(1.0)
    since = len(wire.wire.log)
    wire.run(1.0)
    put = put_of(wire, "1", since)
    assert {label for label, _ in put} == {"heli-position", "heli-altitude"}
    assert all(found.riders == () for _, found in put)


def test_a_lost_message_is_asked_for_again_stream_by_stream(wire: Box, node: Platform) -> None:
    wire.asked("0", "1", multicast("heli-position", "heli-altitude", to=("0",)))
    wire.run(1.0)
    lost: list[Put] = []

    def drop(_by: str, _to: str, put: Put) -> bool:
        if put.key.startswith("x/1/") and len(lost) < 3:
            lost.append(put)
            return True
        return False

    wire.wire.drop = drop
    wire.run(3.0)
    assert len(lost) == 3
    accounts = [record.stream.account for record in node.built.gateway.importer.imports.streams.values()]
    assert [(account.recovered, account.lost) for account in accounts] == [(3, 0), (3, 0)]


def test_a_rider_that_nobody_asked_for_changes_nothing(wire: Box, node: Platform) -> None:
    """A member may put what it likes beside its own stream; it is taken under its own name and only as far as agreed."""
    wire.asked("0", "1", multicast(to=("0",)))
    wire.run(1.0)
    key = next(crossed.put.key for crossed in wire.wire.log if crossed.put.key.startswith("x/1/"))
    boot = wire.platform("1").config.boot
    labels = node.ports.network.labels()
    strange = Rider("battery", "0123abcd", (StreamSample(1, wire.now_us, (0.5,)),))
    wire.put(key, encode_samples(boot, (), riders=(strange,) * 16))
    wire.run(0.01)
    assert node.ports.network.labels() == labels
    assert len(node.built.gateway.importer.imports.streams) == 1
