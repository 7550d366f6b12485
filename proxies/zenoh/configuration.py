"""How a session of a federation is configured: options become Zenoh's own configuration. Pure.

Two topologies, never both at once, since sides that both dial and scout leave pairs deaf to each other now and then:

* multicast (default): peers meet by scouting on one interface, loopback unless configured otherwise. The group's port follows
  from the federation's name, so federations on one machine do not even meet; the namespace keeps their keys apart.
* endpoints: with `connect` there is no scouting; the dialling side keeps trying for ever, every 0.25 to 1 s. Where every pair
  has one side that dials, `gossip` should be off; with one meeting point for all it lets the others find each other.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal
from zlib import crc32

from dyknow.federation.keys import namespace
from dyknow.federation.messages.unpacking import MAX_BYTES

MULTICAST_GROUP = "224.0.0.224"
LOOPBACK = "lo"
_FIRST_PORT, _PORTS = 20_000, 12_000  # below the range from which systems take ports for outgoing connections
_SCOUTING_MS = 50  # how long an opening session waits for others when it is alone
_MAX_MESSAGE = 1_048_576


@dataclass(frozen=True, slots=True)
class ZenohOptions:
    """How processes of one federation find each other.

    Attributes:
        federation: its name; sessions of different names never hear each other.
        listen: Zenoh endpoints (`tcp/127.0.0.1:7447`); none: a free port of the interface's address.
        connect: Zenoh endpoints to dial; scouting is off then.
        discover: `multicast`, or `none` when only endpoints are to be used.
        interface: the network interface for scouting and listening.
        lease_ms: after this long without a sign a peer's link is closed; 10 000 where more than 5 % of frames are lost.
        gossip: peers tell each other of third ones; without scouting the side with the greater identity then dials.
        roster: file of the roster, which is read again whenever it changes; certificates that it does not admit get no link.
        local: a further endpoint on loopback, with a backlog of its own: connections to the others do not delay it.
        security: merged over the rest: mutual TLS and access control, as `dyknow.federation.security.tls` makes it.
    """

    federation: str = "default"
    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    discover: Literal["multicast", "none"] = "multicast"
    interface: str = LOOPBACK
    lease_ms: int = 2000
    gossip: bool = True
    security: Mapping[str, Any] | None = None
    roster: Path | None = None
    local: str | None = None


def multicast_port(federation: str) -> int:
    return _FIRST_PORT + crc32(federation.encode()) % _PORTS


def zenoh_config(options: ZenohOptions, address_of: Callable[[str], str]) -> dict[str, Any]:
    """The configuration as Zenoh reads it.

    Args:
        options: the user's choice.
        address_of: the address of a network interface; called only where no endpoint to listen on is given.

    Raises:
        NameRefused: the federation's name cannot be part of a key.
    """
    scouting = options.discover == "multicast" and not options.connect
    config = {
        "mode": "peer",
        "namespace": namespace(options.federation),
        "listen": {"endpoints": _listens(options, address_of)},
        "connect": {
            "endpoints": list(options.connect),
            "timeout_ms": -1,  # keep trying; 0 would be one attempt, and silence after it
            "exit_on_failure": False,
            "retry": {"period_init_ms": 250, "period_max_ms": 1000, "period_increase_factor": 2},
        },
        "scouting": {
            "delay": _SCOUTING_MS,
            "multicast": {
                "enabled": scouting,
                "interface": options.interface,
                "address": f"{MULTICAST_GROUP}:{multicast_port(options.federation)}",
            },
            "gossip": {
                "enabled": options.gossip,
                "autoconnect_strategy": {
                    "peer": {"to_router": "always", "to_peer": "always" if scouting else "greater-zid"}
                },
            },
        },
        "timestamping": {"enabled": False},
        "transport": {
            "unicast": {"open_timeout": 2000, "accept_timeout": 2000},
            "link": {"tx": {"lease": options.lease_ms, "keep_alive": 4}, "rx": {"max_message_size": _MAX_MESSAGE}},
            "shared_memory": {"enabled": False},  # our messages are small, and implicit replies get lost under load
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
    }
    return merged(config, options.security or {})


def merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with the settings of `over`: mappings are merged, everything else is replaced."""
    both = dict(base)
    for name, value in over.items():
        old = both.get(name)
        both[name] = merged(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return both


def _listens(options: ZenohOptions, address_of: Callable[[str], str]) -> list[str]:
    listen = list(options.listen) or [_endpoint(options, address_of)]
    return listen if options.local is None else [*listen, options.local]


def _endpoint(options: ZenohOptions, address_of: Callable[[str], str]) -> str:
    protocol = "tls" if "tls" in _protocols(options.security or {}) else "tcp"
    address = "127.0.0.1" if options.interface == LOOPBACK else address_of(options.interface)
    return f"{protocol}/{address}:0"


def _protocols(security: Mapping[str, Any]) -> list[str]:
    found: list[str] = security.get("transport", {}).get("link", {}).get("protocols", [])
    return found
