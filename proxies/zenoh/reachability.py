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
    if protocol not in {"tcp", "tls"}:
        return ""
    try:
        with socket.create_connection((host.strip("[]"), int(port)), _WITHIN_S) as link:
            speaks_tls = _speaks_tls(link)
    except ConnectionRefusedError:
        return f"connection refused by {endpoint}: nothing listens there"
    except TimeoutError:
        return f"no answer from {endpoint}"
    except (OSError, OverflowError) as error:
        return f"{endpoint} cannot be reached ({getattr(error, 'strerror', None) or error})"
    if speaks_tls is (protocol == "tls"):
        return ""
    other = f"{'tls' if speaks_tls else 'tcp'}/{place}"
    return f"{endpoint} does not speak {protocol}: write {other}{' and give --roster' if speaks_tls else ''}"


def _speaks_tls(link: socket.socket) -> bool:
    """Whether a TLS handshake gets an answer; whose certificate it is does not matter, nothing is sent after it."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    link.settimeout(_WITHIN_S)
    try:
        context.wrap_socket(link).close()
    except ssl.SSLEOFError:
        return False
    except ssl.SSLError as refused:
        return "ALERT" in (refused.reason or "")
    except OSError:
        return False
    return True
