"""A capability from outside: one folder, registered by its module's name; nothing else is touched."""

import pytest

from dyknow.agents.config import PlatformConfig
from dyknow.agents.extensions import load_extension, typed_actions
from dyknow.agents.part import Part
from dyknow.agents.platform import Platform
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import CreateMulticast, Done, Query, Samples
from dyknow.federation.sharing.ontology import default_ontology
from dyknow.model.errors import UnitError
from dyknow.runtime.configuration.config import NodeConfig
from dyknow.runtime.configuration.resolved import platform_config
from tests.box import EPOCH, Box

P = Performative
NAME = "examples.extension"


@pytest.fixture
def extended(wire: Box) -> Box:
    """Platforms 0 and 1 have loaded the extension; 2 has not."""
    extension = load_extension(NAME)
    ontology = default_ontology().extended(extension.labels)
    for unit in "01":
        wire.join(unit, extensions=extension.parts, ontology=ontology)
    wire.join("2")
    wire.centre()
    wire.run(1.0)
    return wire


def test_a_peer_calls_it_and_its_stream_is_queried_and_exported(extended: Box) -> None:
    from examples.extension.beacon import RingBeacon

    rung = extended.asked("1", "0", RingBeacon(times=2))
    assert rung.performatives == [P.AGREE, P.INFORM]
    assert rung.contents[-1] == Done(text="rung 2 times")
    (samples,) = extended.asked("2", "0", Query(semantic_label="beacon-rings"), P.QUERY_REF).contents
    assert isinstance(samples, Samples)
    assert samples.samples[0].value == {"count": 2.0}
    stream = CreateMulticast(semantic_labels=("beacon-rings",), sample_period_s=0.1, delay_s=0.1, to_units=("1",))
    assert extended.asked("cc", "0", stream).performatives == [P.AGREE, P.INFORM]
    for _ in range(3):
        extended.asked("1", "0", RingBeacon())
    extended.run(0.5)
    assert extended.platform("1").built.gateway.latest("beacon-rings", "0").value[0] >= 3.0


def test_it_is_in_the_directory_and_one_without_it_does_not_understand(extended: Box) -> None:
    from examples.extension.beacon import RingBeacon

    offering = extended.member("cc").directory.search(service="beacon")
    assert sorted(entry.unit for entry in offering) == ["0", "1"]
    assert [e.unit for e in extended.member("cc").directory.search(label="beacon-rings")] == ["0", "1"]
    assert extended.asked("1", "2", RingBeacon()).performatives == [P.NOT_UNDERSTOOD]


def test_a_node_loads_what_its_configuration_names() -> None:
    config = NodeConfig(unit="0", extensions=(NAME,))
    resolved = platform_config(config, PlatformConfig("0", 1).clock, EPOCH, "")
    assert [part.__name__ for part in resolved.extensions] == ["Beacon"]
    assert "beacon-rings" in resolved.ontology
    assert "ring-beacon" in typed_actions((NAME,))
    assert "ring-beacon" not in typed_actions()


@pytest.mark.parametrize(
    ("name", "why"),
    [("tests.nothing", "there is no module"), ("tests.agents.conftest", "expected a module with PARTS")],
)
def test_what_is_no_extension_is_refused_with_the_reason(name: str, why: str) -> None:
    with pytest.raises(UnitError, match=why):
        load_extension(name)


def test_a_part_that_wants_what_there_is_not_or_handles_nothing_stops_the_start() -> None:
    class Wanting(Part):
        def __init__(self, moon: object) -> None:
            self.moon = moon

    class Idle(load_extension(NAME).parts[0]):  # type: ignore[misc]
        on_ring = None

    with pytest.raises(UnitError, match=r"Wanting cannot be built of \(ports, parts\), see dyknow.agents.ports"):
        Platform(PlatformConfig("0", EPOCH, extensions=(Wanting,)), EPOCH)
    ontology = default_ontology().extended(load_extension(NAME).labels)
    with pytest.raises(UnitError, match="Idle has no method on_ring"):
        Platform(PlatformConfig("0", EPOCH, extensions=(Idle,), ontology=ontology), EPOCH)
