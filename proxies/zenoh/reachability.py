"""Why nothing comes from an endpoint: nothing listens there, it does not answer, or it speaks another protocol."""

import socket
import ssl
from collections.abc import Sequence

_WITHIN_S = 0.3


def unreachable(endpoints: Sequence[str]) -> list[str]:
    """A phrase for each endpoint of TCP or TLS that cannot be spoken to, e.g. `connection refused by tcp/127.0.0.1:1`."""
    return [why for endpoint in endpoints if (why := _trouble(endpoint))]


def _trouble(endpoint: str) -> str:
    protocol, _, place = endpoint.partition("/")
    host, _, port = place.partition("?")[0].partition("#")[0].rpartition(":")
    host = host.strip("[]")
    if protocol not in {"tcp", "tls"}:
        return ""
    try:
        with socket.create_connection((host, int(port)), _WITHIN_S) as link:
            certificate = _certificate(link)
    except ConnectionRefusedError:
        return f"connection refused by {endpoint}: nothing listens there"
    except TimeoutError:
        return f"no answer from {endpoint}"
    except (OSError, OverflowError) as error:
        return f"{endpoint} cannot be reached ({getattr(error, 'strerror', None) or error})"
    speaks_tls = certificate is not None
    if speaks_tls is (protocol == "tls"):
        return _mismatch(endpoint, host, certificate) if certificate else ""
    other = f"{'tls' if speaks_tls else 'tcp'}/{place}"
    return f"{endpoint} does not speak {protocol}: write {other}{' and give --roster' if speaks_tls else ''}"


def _mismatch(endpoint: str, host: str, certificate: bytes) -> str:
    from dyknow.federation.security.tls import hosts_of

    hosts = hosts_of(certificate)
    return "" if host in hosts else f"the certificate at {endpoint} is for {', '.join(hosts)}: dyknow roster add --host"


def _certificate(link: socket.socket) -> bytes | None:
    """The certificate of a TLS handshake, DER, of any member, empty if refused; None from a peer without TLS."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    link.settimeout(_WITHIN_S)
    try:
        with context.wrap_socket(link) as wrapped:
            return wrapped.getpeercert(binary_form=True)
    except ssl.SSLEOFError:
        return None
    except ssl.SSLError as refused:
        return b"" if "ALERT" in (refused.reason or "") else None
    except OSError:
        return None
