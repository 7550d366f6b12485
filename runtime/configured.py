"""What a configuration comes to, with the files it names read: session, platform, trust."""

import json

from agents.config import PlatformConfig
from agents.interface import Trust
from compunits import catalogue
from dyknow.errors import RosterError
from federation.clock import FederationClock
from federation.ontology import Translation, default_ontology
from federation.trust import Roster, Signer, Verifier
from proxies.zenoh_config import LOOPBACK, ZenohOptions
from reasoning import builtin_profiles, parse_profiles
from runtime.config import NodeConfig, WireConfig


def reaches_beyond(wire: WireConfig) -> str:
    """The first endpoint or interface that is not loopback; empty if there is none."""
    for endpoint in (*wire.listen, *wire.connect):
        host = endpoint.partition("/")[2].rpartition(":")[0].strip("[]")
        if host not in {"localhost", "::1"} and not host.startswith("127."):
            return endpoint
    meets = not wire.listen or (wire.discover == "multicast" and not wire.connect)
    return wire.interface if meets and wire.interface != LOOPBACK else ""


def wire_options(config: NodeConfig) -> ZenohOptions:
    """The session's options; the security file is read here.

    Raises:
        RosterError: it is not the JSON that `dyknow roster` writes.
    """
    wire = config.wire
    security = None
    if wire.security is not None:
        try:
            security = json.loads(wire.security.read_text(encoding="utf-8"))
        except (OSError, ValueError) as wrong:
            raise RosterError(f"{wire.security}: {wrong}; make it anew with `dyknow roster`") from None
    return ZenohOptions(
        federation=wire.federation,
        listen=wire.listen,
        connect=wire.connect,
        discover=wire.discover,
        interface=wire.interface,
        lease_ms=wire.lease_ms,
        security=security,
    )


def platform_config(config: NodeConfig, clock: FederationClock, started_us: int, zid: str) -> PlatformConfig:
    """What the platform is to know, files read.

    Raises:
        TextError, RosterError: a file is wrong, and where.
    """
    ontology = default_ontology()
    translation = None
    if config.translation is not None:
        translation = Translation.parse(ontology, config.translation.read_text("utf-8"), str(config.translation))
    profiles = dict(builtin_profiles())
    if config.profiles is not None:
        profiles |= parse_profiles(config.profiles.read_text("utf-8"), str(config.profiles))
    return PlatformConfig(
        unit=config.unit,
        boot=started_us // 1000,
        zid=zid,
        clock=clock,
        vehicle=config.vehicle.kind != "none",
        avoidance=config.avoidance,
        period_us=config.period_ms * 1000,
        ontology=ontology,
        translation=translation,
        profiles=profiles,
        trust=trust_of(config, started_us),
        catalogue=catalogue(config.units).offered,
        admission=config.admit,
        govern_us=None if config.govern_ms is None else round(config.govern_ms * 1000),
    )


def trust_of(config: NodeConfig, started_us: int) -> Trust | None:
    """The roster and this platform's key, if the federation has them.

    Raises:
        RosterError: one is there without the other, or does not read.
    """
    if config.trust.roster is None:
        return None
    if config.trust.key is None:
        raise RosterError(f"{config.trust.roster} is a roster, but this platform was given no key: set trust.key")
    try:
        roster = Roster.parse(config.trust.roster.read_text("utf-8"))
        seed = bytes.fromhex(config.trust.key.read_text("ascii").strip())
    except (OSError, ValueError) as wrong:
        raise RosterError(f"{config.trust.key}: {wrong}") from None
    federation = config.wire.federation
    return Trust(roster, Signer(seed, federation), Verifier(roster, federation, started_us))
