"""From `key=value` words to contents."""

import pytest

from dyknow.agents.extensions import typed_actions
from dyknow.federation.messages.contents import CreateMulticast, read
from dyknow.model.errors import WrongCall
from dyknow.runtime.configuration.wording import content_with, typed, values_of

NOW_US = 1_800_000_000_000_000


def test_the_message_of_the_thesis_can_be_typed() -> None:
    pairs = ["semantic-labels=heli-position,heli-altitude", "sample-period=1s", "delay=1000ms", "to-units=0"]
    found = content_with("create-multicast", values_of("create-multicast", pairs), NOW_US)
    assert str(found.expr()) == (
        "(create-multicast semantic-labels: (sequence heli-position heli-altitude) "
        "sample-period: 1.0 delay: 1.0 to-units: (sequence 0))"
    )


def test_instants_are_relative_to_federation_time() -> None:
    pairs = ["semantic-labels=battery", "sample-period=1s", "delay=1s", "to-units=0", "from=+5s", "to=2030-01-01"]
    found = content_with("create-multicast", values_of("create-multicast", pairs), NOW_US)
    assert isinstance(found, CreateMulticast)
    assert found.from_us == NOW_US + 5_000_000
    assert found.to_us == 1_893_456_000_000_000


def test_numbers_and_truth_values_are_read() -> None:
    goto = content_with("goto", values_of("goto", ["latitude_deg=55.7", "longitude_deg=13", "altitude_m=60"]), NOW_US)
    assert goto.expr().arguments == {"latitude_deg": 55.7, "longitude_deg": 13.0, "altitude_m": 60.0}
    monitor = content_with(
        "monitor-proximity", values_of("monitor-proximity", ["profile=nmac", "avoidance=off"]), NOW_US
    )
    assert monitor.expr().arguments == {"profile": "nmac", "avoidance": False}


@pytest.mark.parametrize(
    ("task", "pairs", "said"),
    [
        ("monitor-proximty", [], "Did you mean 'monitor-proximity'"),
        ("monitor-proximity", ["profil=nmac"], "Did you mean 'profile'"),
        ("monitor-proximity", ["profile"], "write key=value"),
        ("monitor-proximity", ["avoidance=perhaps"], "neither true nor false"),
        ("goto", ["latitude_deg=55.7"], r"goto needs longitude_deg=\.\.\."),
        ("goto", ["latitude_deg=north"], "is not a number"),
        ("hold", ["now=1"], "takes nothing"),
        ("take-off", [], "unknown task 'take-off'"),
        ("create-monitor", ["generation=1"], "create-monitor has no 'generation'"),
        ("create-monitor", ["name=proximity", "profile=nmac"], "create-monitor has no 'profile'"),
        ("create-monitor", ["name=proximity", "parameters=radius:250"], "create-monitor has no 'parameters'"),
        ("create-multicast", ["sample-period=5"], "say 5ms or 5s"),
        ("create-multicast", ["sample-period=often"], "is not a duration"),
    ],
)
def test_what_does_not_fit_is_told_with_its_remedy(task: str, pairs: list[str], said: str) -> None:
    with pytest.raises(WrongCall, match=said.replace("takes nothing", "Takes nothing|takes nothing")):
        content_with(task, values_of(task, pairs), NOW_US)


def test_what_can_be_typed_is_what_the_parts_of_a_platform_declare_so() -> None:
    assert typed() == typed_actions()


def test_every_task_is_a_content_that_platforms_can_read() -> None:
    for head, action in typed().items():
        assert action.content.head == head
    assert read(content_with("hold", values_of("hold", []), NOW_US).expr()) == content_with(
        "hold", values_of("hold", []), NOW_US
    )
