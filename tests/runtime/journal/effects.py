"""A journal's replayed effects in a form that outlives the code: decoded, without class names and without prose."""

import json
import re
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

from dyknow.agents.effects import InjectFault, Tell
from dyknow.agents.places import FlightLimits, FlightPlan, Waypoint
from dyknow.agents.platform import Platform
from dyknow.federation import keys
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.messages.codec import decode_act, decode_description, decode_heartbeat, decode_samples
from dyknow.federation.transport import Answer, Ask, Put
from dyknow.model.sample import SURE
from dyknow.navigation.vehicle import Command
from dyknow.proxies.recordings.journal_file import CLOCK_EPOCH, CLOCK_SPEED, read_about, read_journal
from dyknow.runtime.configuration.config import NodeConfig
from dyknow.runtime.configuration.resolved import platform_config
from dyknow.runtime.journal.journal import replayed

_FRACTION = re.compile(r"-?\d+\.\d+(?:e[+-]?\d+)?")
PROSE = {"text", "reason"}
"""Fields that hold sentences: a sentence may be worded better without being another effect."""


def replayed_effects(path: Path) -> dict[str, list[Any]]:
    """What a fresh platform does with the events of a journal, by kind of effect, in order; times in microseconds.

    Beyond what every journal says of its node this one names `started_us`, `zid` and the flight `plan`.
    """
    about = read_about(path)
    started_us, plan = int(about["started_us"]), json.loads(about["plan"])
    config = replace(
        platform_config(
            NodeConfig.model_validate_json(about["config"]),
            FederationClock(int(about[CLOCK_EPOCH]), float(about[CLOCK_SPEED])),
            started_us,
            about["zid"],
        ),
        control=True,
        simulated=True,
        limits=FlightLimits(10.0, 120.0),
        plan=FlightPlan(
            tuple(Waypoint(*waypoint) for waypoint in plan["waypoints"]),
            plan["speed_m_s"],
            plan["start_us"],
            plan["loop"],
        ),
    )
    platform = Platform(config, started_us)
    platform.start(started_us)
    effects: dict[str, list[Any]] = defaultdict(list)
    for now_us, step in replayed(read_journal(path), platform):
        for effect in step:
            for kind, content in _plain(effect):
                effects[kind].append([now_us - started_us, *content])
    return json.loads(json.dumps(effects), parse_float=lambda text: float(f"{float(text):.9g}"))


def _in_digits(content: str) -> str:
    """Numbers within the text of an act, in nine digits as everywhere here."""
    return _FRACTION.sub(lambda found: f"{float(found[0]):.9g}", content)


def _plain(effect: Any) -> list[tuple[str, list[Any]]]:
    match effect:
        case Put(key, payload):
            parsed = keys.parse_key(key)
            return (
                _samples(key, parsed, payload) if isinstance(parsed, keys.StreamKey) else [_put(key, parsed, payload)]
            )
        case Command(number, order):
            return [("commands", [number, type(order).__name__.removesuffix("Order").lower(), *order])]
        case Tell(record):
            return [("told", [{name: value for name, value in record.items() if name not in PROSE}])]
        case Ask(_, key, _, timeout_us):
            return [("questions", [key, timeout_us])]
        case Answer(_, key, payload):
            return [("answers", [key, len(payload)])]
        case InjectFault():
            return [("faults", list(effect))]
        case _:
            return []


def _samples(key: str, parsed: keys.StreamKey, payload: bytes) -> list[tuple[str, list[Any]]]:
    """One entry a stream, whichever travel together."""
    boot, samples, riders, _ = decode_samples(payload)
    streams = [(key, samples), *((keys.stream(parsed.owner, *rider[:2]), rider.samples) for rider in riders)]
    return [
        ("samples", [name, boot, [[*entry, *(() if quality is SURE else quality[:2])] for *entry, quality in each]])
        for name, each in streams
    ]


def _put(key: str, parsed: Any, payload: bytes) -> tuple[str, list[Any]]:
    match parsed:
        case keys.HeartbeatKey():
            return "heartbeats", list(decode_heartbeat(payload))
        case keys.AnnouncementKey():
            return "descriptions", [key, decode_description(payload).model_dump(mode="json")]
        case keys.ActKey(agent="receipt"):
            return "receipts", [key]
        case keys.ActKey():
            act = decode_act(payload)[0]
            return "acts", [
                act.performative,
                str(act.sender),
                str(act.receiver),
                None if act.content is None else _in_digits(str(act.content)),
                act.conversation_id,
                act.reply_by_us,
                act.boot,
                act.seq,
                act.created_us,
                act.acks,
            ]
        case _:
            raise AssertionError(f"nothing is put on {key}")
