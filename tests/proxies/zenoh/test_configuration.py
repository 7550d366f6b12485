import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.model.errors import NameRefused
from dyknow.proxies.zenoh.configuration import ZenohOptions, merged, multicast_port, zenoh_config


def nowhere(interface: str) -> str:
    raise AssertionError(f"{interface} was asked for")


def test_by_default_peers_meet_by_scouting_on_loopback_and_nowhere_else() -> None:
    config = zenoh_config(ZenohOptions(), nowhere)
    assert config["namespace"] == "dyknow/default"
    assert config["listen"]["endpoints"] == ["tcp/127.0.0.1:0"]
    assert config["scouting"]["multicast"]["enabled"]
    assert config["scouting"]["multicast"]["interface"] == "lo"
    assert config["connect"]["endpoints"] == []
    assert config["transport"]["link"]["tx"]["lease"] == 2000
    assert not config["transport"]["shared_memory"]["enabled"]


def test_endpoints_to_dial_end_scouting_and_are_tried_for_ever() -> None:
    config = zenoh_config(ZenohOptions(connect=("tcp/127.0.0.1:7447",)), nowhere)
    assert not config["scouting"]["multicast"]["enabled"]
    assert config["connect"]["timeout_ms"] == -1
    assert config["connect"]["exit_on_failure"] is False
    assert config["scouting"]["gossip"]["autoconnect_strategy"]["peer"]["to_peer"] == "greater-zid", "one side dials"


def test_federations_of_different_names_scout_on_different_ports() -> None:
    ports = {multicast_port(name) for name in ("default", "crossing", "patrol", "swarm", "mixed")}
    assert len(ports) == 5
    assert all(20_000 <= port < 32_000 for port in ports)


def test_another_interface_is_listened_on_by_its_address() -> None:
    config = zenoh_config(ZenohOptions(interface="eth0"), lambda name: {"eth0": "10.0.0.7"}[name])
    assert config["listen"]["endpoints"] == ["tcp/10.0.0.7:0"]
    assert config["scouting"]["multicast"]["interface"] == "eth0"


def test_security_is_merged_over_the_rest_and_its_protocol_is_listened_with() -> None:
    security = {
        "transport": {"link": {"protocols": ["tls"], "tls": {"enable_mtls": True}}},
        "access_control": {"rules": []},
    }
    config = zenoh_config(ZenohOptions(security=security), nowhere)
    assert config["listen"]["endpoints"] == ["tls/127.0.0.1:0"]
    assert config["transport"]["link"]["tls"]["enable_mtls"]
    assert config["transport"]["link"]["tx"]["lease"] == 2000, "what security does not mention stays"
    assert config["access_control"] == {"rules": []}


def test_a_name_that_cannot_be_part_of_a_key_is_refused() -> None:
    for name in ("", "a/b", "**", "@a", "A b", "x" * 65):
        with pytest.raises(NameRefused):
            zenoh_config(ZenohOptions(federation=name), nowhere)


TREES = st.recursive(st.integers(), lambda inner: st.dictionaries(st.sampled_from("abc"), inner, max_size=3))


@given(st.dictionaries(st.sampled_from("abc"), TREES), st.dictionaries(st.sampled_from("abc"), TREES))
def test_merging_keeps_what_is_not_mentioned_and_takes_what_is(
    base: dict[str, object], over: dict[str, object]
) -> None:
    both = merged(base, over)
    assert set(both) == set(base) | set(over)
    for name, value in both.items():
        if name not in over:
            assert value == base[name]
        elif not isinstance(over[name], dict):
            assert value == over[name]
    assert merged(both, over) == both
