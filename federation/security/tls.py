"""Mutual TLS and access control: the part of Zenoh's configuration that a roster decides, and its certificates.

Access control is by certificate: the common name is the unit, and the unit stands at a fixed place of every key
(`dyknow.federation.keys`), so no platform speaks, streams or lives under another's name. A certificate of a member that
comes back has a number after the unit. Zenoh reads the rules when a session is opened: they hold for the next
certificates of every member, too, and which of them is admitted is decided link by link
(`dyknow.proxies.zenoh.link_gate`).
"""

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from hashlib import sha256
from ipaddress import ip_address
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from dyknow.federation import keys
from dyknow.federation.messages.unpacking import MAX_BYTES
from dyknow.federation.security.trust import Role, Roster, RosterMember, common_name
from dyknow.model.errors import RosterError
from dyknow.model.instants import US_PER_S

if TYPE_CHECKING:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey

MAX_MESSAGE: Final = 1_048_576
LINKS: Final[Mapping[Role, int]] = {"uav": 8, "observer": 8, "command-centre": 32}
"""Links of one certificate to one session at once: a process has one, and another while it opens its session again."""
SESSIONS: Final = 512
"""With which one is linked at most: more than one member takes before its surplus links are closed."""
OPEN_MS: Final = 3000
NEXT_CERTIFICATES: Final = 8
"""How many times a member comes back before those that run must be started again."""
_ALL_MESSAGES: Final = [
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
]


class Paths(NamedTuple):
    """Files in PEM: the authority's certificate, and the platform's own certificate and private key."""

    authority: str
    certificate: str
    key: str


def zenoh_security_config(roster: Roster, unit: str, paths: Paths, federation: str) -> dict[str, Any]:
    """What to add to the Zenoh configuration of `unit`: TLS with certificates of both sides, one rule set per peer.

    Raises:
        RosterError: `unit` is not in the roster, or is revoked.
        NameRefused: the federation cannot be part of a key.
    """
    own = roster.member(unit)
    if own is None or own.revoked:
        raise RosterError(f"{unit} is {'revoked' if own else 'not in the roster'}: it cannot join {federation}")
    root = keys.namespace(federation)
    peers = [member for _, member in sorted(roster.members.items())]
    return {
        "scouting": {"gossip": {"enabled": False}},
        "transport": {
            "unicast": {"max_sessions": SESSIONS, "open_timeout": OPEN_MS, "accept_timeout": OPEN_MS},
            "link": {
                "protocols": ["tls"],
                "rx": {"max_message_size": MAX_MESSAGE},
                "tls": {
                    "root_ca_certificate": paths.authority,
                    "enable_mtls": True,
                    "verify_name_on_connect": True,
                    "close_link_on_expiration": True,
                    "listen_private_key": paths.key,
                    "listen_certificate": paths.certificate,
                    "connect_private_key": paths.key,
                    "connect_certificate": paths.certificate,
                },
            },
        },
        "low_pass_filter": [
            {
                "id": "size",
                "flows": ["ingress"],
                "messages": ["put", "delete", "query", "reply"],
                "key_exprs": ["**"],
                "size_limit": MAX_BYTES,
            }
        ],
        "access_control": {
            "enabled": True,
            "default_permission": "deny",
            "rules": [_own_rule(root), *(rule for peer in peers for rule in _rules(peer, root))],
            "subjects": [
                {"id": peer.unit, "cert_common_names": _certificates(peer), "link_protocols": ["tls"]} for peer in peers
            ],
            "policies": [
                {
                    "id": f"peer {peer.unit}",
                    "subjects": [peer.unit],
                    "rules": ["out", *(rule["id"] for rule in _rules(peer, root))],
                }
                for peer in peers
            ],
        },
    }


def _certificates(peer: RosterMember) -> list[str]:
    """The present certificate, unless it is revoked, and the next ones, which no member has yet."""
    first = peer.certificate + peer.revoked
    return [common_name(peer.unit, number) for number in range(first, first + 1 + NEXT_CERTIFICATES)]


def _own_rule(root: str) -> dict[str, Any]:
    """The rule for our own messages: all are allowed. Wildcards do not match the tokens' `@`, so they are spelt out."""
    return {
        "id": "out",
        "permission": "allow",
        "flows": ["egress"],
        "messages": _ALL_MESSAGES,
        "key_exprs": [f"{root}/**", f"{root}/{keys.TOKENS}"],
    }


def _rules(peer: RosterMember, root: str) -> list[dict[str, Any]]:
    """The rules for a peer: its own acts, life and answers; and the keys that it may listen to and ask for."""
    names = [peer.unit, f"{peer.unit}-$*"] if peer.role != "uav" else [peer.unit]
    said = ["acl/*/{}/**", "x/{}/**", "hb/{}/**"]
    answered = ["q/{}/**", "{}/df", "time/{}"]
    heard = ["acl/{}/**"]
    everybody = [keys.BROADCAST, "x/**", keys.HEARTBEATS]
    asked = ["q/**", "*/df", "time/*"]
    return [
        _rule(peer, "speaks as itself", ["put", "delete"], _for(names, said), root),
        _rule(peer, "answers as itself", ["reply", "declare_queryable"], _for(names, answered), root),
        _rule(peer, "is alive", ["liveliness_token"], _for(names, ["@df/v1/*/{}/**"]), root),
        _rule(peer, "may listen", ["declare_subscriber"], [*_for(names, heard), *everybody], root),
        _rule(peer, "may ask", ["query"], asked, root),
        _rule(peer, "may watch", ["declare_liveliness_subscriber", "liveliness_query"], [keys.TOKENS], root),
    ]


def _for(names: list[str], patterns: list[str]) -> list[str]:
    return [pattern.format(name) for pattern in patterns for name in names]


def _rule(peer: RosterMember, what: str, messages: list[str], patterns: list[str], root: str) -> dict[str, Any]:
    return {
        "id": f"{peer.unit} {what}",
        "permission": "allow",
        "flows": ["ingress"],
        "messages": messages,
        "key_exprs": [f"{root}/{pattern}" for pattern in patterns],
    }


# Certificates


def tls_key(entropy: bytes) -> bytes:
    """A private key (P-256, PKCS#8, PEM) out of at least 40 secret random bytes."""
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

    order = 0xFFFFFFFF00000000FFFFFFFFFFFFFFFFBCE6FAADA7179E84F3B9CAC2FC632551
    if len(entropy) < 40:
        raise ValueError(f"a private key needs 40 random bytes, got {len(entropy)}")
    key = ec.derive_private_key(int.from_bytes(entropy, "big") % (order - 1) + 1, ec.SECP256R1())
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())


def authority_certificate(key_pem: bytes, name: str, now_us: int, days: int = 3650) -> bytes:
    """The certificate (PEM) with which the holder of `key_pem` signs those of the platforms."""
    from cryptography import x509
    from cryptography.hazmat.primitives.hashes import SHA256

    key = _load(key_pem)
    builder = (
        _builder(name, _called(name), key, now_us, days)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_usage(signs=True), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )
    return _pem(builder.sign(key, SHA256()))


def platform_certificate(
    unit: str,
    key_pem: bytes,
    authority_key_pem: bytes,
    authority_pem: bytes,
    now_us: int,
    *,
    hosts: tuple[str, ...] = ("127.0.0.1", "localhost"),
    days: float = 365,
    number: int = 0,
) -> bytes:
    """The certificate (PEM) of a platform, its `number`-th new one; `hosts` are where it listens.

    Raises:
        NameRefused: `unit` cannot name a platform.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives.hashes import SHA256
    from cryptography.x509.oid import ExtendedKeyUsageOID as Use

    key, authority = _load(key_pem), x509.load_pem_x509_certificate(authority_pem)
    authority_key = _load(authority_key_pem)
    signed_by = x509.AuthorityKeyIdentifier.from_issuer_public_key(authority_key.public_key())
    builder = (
        _builder(common_name(keys.unit(unit), number), authority.subject, key, now_us, days)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_usage(signs=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage([Use.SERVER_AUTH, Use.CLIENT_AUTH]), critical=False)
        .add_extension(x509.SubjectAlternativeName([_host(host) for host in hosts]), critical=False)
        .add_extension(signed_by, critical=False)
    )
    return _pem(builder.sign(authority_key, SHA256()))


def hosts_of(certificate: bytes) -> tuple[str, ...]:
    """The addresses and names that a certificate, PEM or DER, is for."""
    from cryptography import x509

    read = x509.load_pem_x509_certificate if certificate.startswith(b"-----") else x509.load_der_x509_certificate
    try:
        named = read(certificate).extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        return ()
    return tuple(str(each.value) for each in named)


def named_until(certificate_pem: bytes) -> tuple[str, int]:
    """The common name of a certificate, and when it ends (wall clock, microseconds)."""
    from cryptography import x509
    from cryptography.x509.oid import NameOID

    read = x509.load_pem_x509_certificate(certificate_pem)
    [named] = read.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(named.value), int(read.not_valid_after_utc.timestamp()) * US_PER_S


def _load(key_pem: bytes) -> "EllipticCurvePrivateKey":
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    key = load_pem_private_key(key_pem, None)
    if not isinstance(key, EllipticCurvePrivateKey):
        raise ValueError("a P-256 private key is needed")  # noqa: TRY004 - the file is wrong, not the caller's types
    return key


def _called(common_name: str) -> "x509.Name":
    from cryptography import x509
    from cryptography.x509.oid import NameOID

    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _builder(
    name: str, issuer: "x509.Name", key: "EllipticCurvePrivateKey", now_us: int, days: float
) -> "x509.CertificateBuilder":
    """The serial number follows from the certified data, so that the same call gives the same number."""
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

    now = datetime.fromtimestamp(now_us // US_PER_S, UTC)
    public = key.public_key().public_bytes(Encoding.DER, PublicFormat.SubjectPublicKeyInfo)
    serial = int.from_bytes(sha256(f"{name} {now_us} ".encode() + public).digest()[:19], "big") + 1
    return (
        x509.CertificateBuilder(serial_number=serial)
        .subject_name(_called(name))
        .issuer_name(issuer)
        .public_key(key.public_key())
        .not_valid_before(now - timedelta(minutes=5))
        .not_valid_after(now + timedelta(days=days))
    )


def _usage(*, signs: bool) -> "x509.KeyUsage":
    from cryptography import x509

    return x509.KeyUsage(
        digital_signature=True,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=not signs,
        key_cert_sign=signs,
        crl_sign=signs,
        encipher_only=False,
        decipher_only=False,
    )


def _host(host: str) -> "x509.GeneralName":
    from cryptography import x509

    try:
        return x509.IPAddress(ip_address(host))
    except ValueError:
        return x509.DNSName(host)


def _pem(certificate: "x509.Certificate") -> bytes:
    from cryptography.hazmat.primitives.serialization import Encoding

    return certificate.public_bytes(Encoding.PEM)
