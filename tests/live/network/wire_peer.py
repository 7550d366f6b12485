"""A process with nothing but an edge: it beats 20 times a second and prints what it hears, one JSON line each."""

import json
import sys
from queue import Empty

from dyknow.federation import keys
from dyknow.federation.transport import Arrived, DeclareToken, Put, Subscribe, TokenChanged, Urgency, WatchTokens
from dyknow.proxies.zenoh.configuration import ZenohOptions
from dyknow.proxies.zenoh.edge import ZenohEdge
from dyknow.runtime.clock import NodeClock
from dyknow.runtime.mailbox import Mailbox

PERIOD_US = 50_000


def say(line: dict[str, object]) -> None:
    sys.stdout.write(json.dumps(line) + "\n")
    sys.stdout.flush()


def main(unit: str, options: str) -> None:
    clock = NodeClock()
    mailbox = Mailbox(clock.now_us)
    chosen = {name: tuple(value) if isinstance(value, list) else value for name, value in json.loads(options).items()}
    edge = ZenohEdge(ZenohOptions(**chosen), mailbox.post, clock.now_us)
    edge.open()
    for effect in (
        WatchTokens(keys.TOKENS),
        Subscribe(keys.HEARTBEATS),
        DeclareToken(keys.token_platform(edge.zid, unit, "uav", 1)),
    ):
        edge.perform(effect)
    due_us, number = clock.now_us(), 0
    while True:
        try:
            event = mailbox.get(max(0, due_us - clock.now_us()) / 1e6)
        except Empty:
            number, due_us = number + 1, due_us + PERIOD_US
            edge.perform(Put(keys.heartbeat(unit), b"%d" % number, Urgency.CONTROL))
            continue
        if isinstance(event, TokenChanged):
            say({"token": event.key.split("/")[3], "alive": event.alive})
        elif isinstance(event, Arrived):
            say({"beat": event.key.removeprefix("hb/"), "number": int(event.payload)})


if __name__ == "__main__":
    main(*sys.argv[1:])
