"""What a roster makes of Zenoh's configuration, and the certificates that belong to it."""

from datetime import UTC, datetime, timedelta
from hashlib import sha256

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import load_pem_private_key

from dyknow.federation import keys
from dyknow.federation.security.tls import (
    Paths,
    authority_certificate,
    platform_certificate,
    tls_key,
    zenoh_security_config,
)
from dyknow.federation.security.trust import Roster, RosterMember
from dyknow.model.errors import NameRefused, RosterError

NOW = 1_700_000_000_000_000
PATHS = Paths("pki/ca.pem", "pki/uav1.pem", "pki/uav1.key")
ROOT = keys.namespace("field")


def roster() -> Roster:
    key = bytes(32)
    members = [
        RosterMember("0", key),
        RosterMember("uav1", key),
        RosterMember("uav2", key),
        RosterMember("cc", key, "command-centre"),
    ]
    return Roster({member.unit: member for member in members})


def allowed(config: dict, peer: str, message: str, key: str) -> bool:
    """Would a put, query or token of `peer` on `key` pass? As Zenoh: a rule must include what is asked for."""
    access = config["access_control"]
    ids = {rule for policy in access["policies"] if peer in policy["subjects"] for rule in policy["rules"]}
    return any(
        rule["id"] in ids
        and "ingress" in rule["flows"]
        and message in rule["messages"]
        and keys.matches(pattern, f"{ROOT}/{key}")
        for rule in access["rules"]
        for pattern in rule["key_exprs"]
    )


SECURED = zenoh_security_config(roster(), "uav1", PATHS, "field")


@pytest.mark.parametrize(
    ("message", "key"),
    [
        ("put", keys.act("uav1", "0", "interface")),
        ("put", keys.act("all", "0", "alarms")),
        ("put", keys.stream("0", "battery", "ab12cd34")),
        ("put", keys.heartbeat("0")),
        ("reply", keys.history("0", "battery")),
        ("reply", keys.describe("0")),
        ("reply", keys.clock("0")),
        ("declare_queryable", keys.clock("0")),
        ("liveliness_token", keys.token_platform("ab", "0", "uav", 1)),
        ("declare_subscriber", keys.inbox("0")),
        ("declare_subscriber", keys.BROADCAST),
        ("declare_subscriber", keys.stream_expr("battery", "ab12cd34")),
        ("declare_subscriber", keys.HEARTBEATS),
        ("query", keys.history("uav1", "battery")),
        ("query", keys.describe("uav1")),
        ("query", keys.clock("uav1")),
        ("declare_liveliness_subscriber", keys.TOKENS),
    ],
)
def test_a_peer_may_do_what_the_federation_needs_in_its_own_name_only(message: str, key: str) -> None:
    assert allowed(SECURED, "0", message, key)
    owned = message in {"put", "reply", "declare_queryable", "liveliness_token"}
    assert allowed(SECURED, "uav2", message, key) is (not owned and key != keys.inbox("0"))
    assert not allowed(SECURED, "uav9", message, key), "who is not in the roster may nothing"


def test_nobody_reads_what_is_sent_to_another() -> None:
    for expr in [keys.inbox("uav1"), "acl/**", "**"]:
        assert not allowed(SECURED, "0", "declare_subscriber", expr)


def test_a_command_centre_may_run_as_several_processes() -> None:
    assert allowed(SECURED, "cc", "put", keys.act("uav1", "cc-4711", "interface"))
    assert allowed(SECURED, "cc", "put", keys.heartbeat("cc-4711"))
    assert allowed(SECURED, "cc", "liveliness_token", keys.token_platform("ab", "cc-4711", "command-centre", 1))
    assert not allowed(SECURED, "uav2", "put", keys.act("uav1", "uav2-1", "interface"))


def test_what_is_revoked_is_not_let_in() -> None:
    config = zenoh_security_config(roster().revoked("uav2"), "uav1", PATHS, "field")
    [revoked] = [each for each in config["access_control"]["subjects"] if each["id"] == "uav2"]
    assert "uav2" not in revoked["cert_common_names"], "those that come after it may come back"
    assert "uav2" not in roster().revoked("uav2").admitted
    with pytest.raises(RosterError, match="revoked"):
        zenoh_security_config(roster().revoked("uav1"), "uav1", PATHS, "field")
    with pytest.raises(RosterError, match="not in the roster"):
        zenoh_security_config(roster(), "uav9", PATHS, "field")
    with pytest.raises(NameRefused):
        zenoh_security_config(roster(), "uav1", PATHS, "field/**")


def test_everything_else_is_denied_and_both_sides_show_certificates() -> None:
    assert SECURED["access_control"]["default_permission"] == "deny"
    tls = SECURED["transport"]["link"]["tls"]
    assert tls["enable_mtls"]
    assert tls["verify_name_on_connect"]
    assert SECURED["transport"]["link"]["protocols"] == ["tls"]
    assert not SECURED["scouting"]["gossip"]["enabled"]


def test_certificates_name_the_unit_and_are_signed_by_the_authority() -> None:
    authority_key, key = tls_key(bytes(40)), tls_key(bytes(39) + b"\1")
    authority_pem = authority_certificate(authority_key, "dyknow field, test", NOW)
    pem = platform_certificate(
        "uav1", key, authority_key, authority_pem, NOW, hosts=("127.0.0.1", "uav1.local"), days=10
    )
    authority, certificate = x509.load_pem_x509_certificate(authority_pem), x509.load_pem_x509_certificate(pem)
    certificate.verify_directly_issued_by(authority)
    assert certificate.subject.rfc4514_string() == "CN=uav1"
    assert certificate.not_valid_after_utc == datetime(2023, 11, 14, 22, 13, 20, tzinfo=UTC) + timedelta(days=10)
    names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert names.get_values_for_type(x509.DNSName) == ["uav1.local"]
    assert [str(address) for address in names.get_values_for_type(x509.IPAddress)] == ["127.0.0.1"]
    assert pem.startswith(b"-----BEGIN CERTIFICATE-----")


def test_keys_follow_from_their_entropy_alone() -> None:
    entropy = sha256(b"one").digest() + bytes(8)
    first, again = tls_key(entropy), tls_key(entropy)
    assert first == again != tls_key(sha256(b"two").digest() + bytes(8))
    assert isinstance(load_pem_private_key(first, None), ec.EllipticCurvePrivateKey)
    with pytest.raises(ValueError, match="40 random bytes"):
        tls_key(bytes(32))
