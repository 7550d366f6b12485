"""A command centre in a process of its own, so that it can stand in any network namespace and be stepped all the time.

It is told what to do by JSON lines on standard input and ends with it:
`{"id": 1, "units": [...], "performative": "query-ref", "say": "(monitors)", "within_s": 2.0, "lasting": false}`.
For every unit a line comes back as soon as the conversation is over (`lasting`: as soon as it is agreed to), and one
with `end` after the last. `{"id": 2, "cancel": conversation, "units": [unit]}` ends a lasting one. Whom it sees it says
by itself, whenever that changes.
"""

import json
import sys
import threading
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Any

from dyknow.federation.members.command_centre import CommandCentre
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import read
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.federation.transport import WireEvent
from dyknow.proxies.zenoh.configuration import ZenohOptions
from dyknow.proxies.zenoh.edge import ZenohEdge
from dyknow.runtime.client import Client, ClientPorts
from dyknow.runtime.clock import NodeClock
from tests.federation.expressions import parse_expr

STEP_S = 0.02


@dataclass
class Open:
    """A conversation whose outcome is to be told."""

    number: int
    dialogue: Dialogue
    lasting: bool

    @property
    def over(self) -> bool:
        return self.dialogue.over or (self.lasting and self.dialogue.agreed)


class Observer:
    def __init__(self, client: Client, commands: "SimpleQueue[dict[str, Any] | None]") -> None:
        self._client, self._commands = client, commands
        self._open: list[Open] = []
        self._seen: list[list[str]] | None = None

    def run(self) -> None:
        while self._take():
            self._client.step(STEP_S)
            self._tell()

    def _take(self) -> bool:
        try:
            command = self._commands.get_nowait()
        except Empty:
            return True
        if command is None:
            return False
        for unit in command["units"]:
            if "cancel" in command:
                dialogue = self._client.cancel(unit, command["cancel"])
            else:
                content = read(parse_expr(command["say"]))
                dialogue = self._client.say(
                    unit,
                    Performative(command["performative"]),
                    content,
                    within_s=command["within_s"],
                    standing=command["lasting"],
                )
            self._open.append(Open(command["id"], dialogue, command.get("lasting", False)))
        return True

    def _tell(self) -> None:
        seen = [[there.unit, there.state] for there in self._client.centre.platforms()]
        if seen != self._seen:
            self._seen = seen
            self._say({"event": "platforms", "units": seen})
        for one in [one for one in self._open if one.over]:
            self._open.remove(one)
            said = [[act.performative.value, str(act.content)] for act, _ in one.dialogue.said]
            self._say(
                {
                    "id": one.number,
                    "unit": one.dialogue.unit,
                    "conversation": one.dialogue.conversation,
                    "said": said,
                    "trouble": one.dialogue.trouble,
                    "end": not any(other.number == one.number for other in self._open),
                }
            )

    def _say(self, line: dict[str, Any]) -> None:
        sys.stdout.write(json.dumps({**line, "at_us": self._client.now_us()}) + "\n")
        sys.stdout.flush()


def main() -> None:
    given = json.loads(sys.argv[1])
    commands: SimpleQueue[dict[str, Any] | None] = SimpleQueue()
    options = ZenohOptions(given["federation"], tuple(given["listen"]), tuple(given["connect"]))

    def opened(post: Any, now_us: Any) -> ZenohEdge:
        edge = ZenohEdge(options, post, now_us)
        edge.open()
        return edge

    def listen() -> None:
        for line in sys.stdin:
            commands.put(json.loads(line))
        commands.put(None)

    threading.Thread(target=listen, daemon=True).start()
    inbox: SimpleQueue[WireEvent] = SimpleQueue()
    around = ClientPorts(inbox, NodeClock().now_us, opened)
    with Client(around, lambda zid, now_us: CommandCentre(given["unit"], now_us, zid=zid)) as client:
        Observer(client, commands).run()


if __name__ == "__main__":
    main()
