"""Two UAVs that pass each other, monitored and recorded.

`python -m tests.console.commands.recordings.encounter` writes the recording that the documentation uses.
"""

from pathlib import Path
from types import SimpleNamespace

from pytest import MonkeyPatch

from dyknow.agents.capabilities.flight.options import AvoidanceOptions
from dyknow.agents.options import Chosen
from dyknow.console.centre import client
from dyknow.console.command import Call
from dyknow.console.commands.recordings.record import record
from dyknow.console.output.output import Output
from dyknow.federation.messages.contents import MonitorProximity
from dyknow.runtime.configuration.settings import Settings
from tests.box import Box

EXAMPLE = Path(__file__).parents[4] / "examples" / "recordings" / "encounter.mcap"
LABELS = ["heli-position", "heli-altitude", "heli-velocity"]


def encounter() -> Box:
    """The world: they meet after 12.5 seconds, 3 m apart."""
    world = Box()
    world.fly("0", 0.0, 0.0, 4.0, options=Chosen(AvoidanceOptions(avoidance=False)))
    world.fly("1", 100.0, 3.0, -4.0, options=Chosen(AvoidanceOptions(avoidance=False)))
    world.run(2.0)
    world.centre("cc-1")
    world.run(1.0)
    world.asked("cc-1", "0", MonitorProximity())
    return world


def in_world(monkeypatch: MonkeyPatch, world: Box) -> None:
    """Have commands take part in this world."""
    monkeypatch.setattr(client, "_client_ports", lambda _call: world.client_ports())


def main() -> None:
    """Make the example."""
    with MonkeyPatch.context() as monkeypatch:
        world = encounter()
        in_world(monkeypatch, world)
        monkeypatch.setattr(client, "os", SimpleNamespace(getpid=lambda: 4711))
        world.at(world.now_us + 15_000_000, lambda: setattr(world.vehicle("1"), "is_silent", True))
        world.at(world.now_us + 17_000_000, lambda: setattr(world.vehicle("1"), "is_silent", False))
        EXAMPLE.unlink(missing_ok=True)
        EXAMPLE.parent.mkdir(exist_ok=True)
        record(Call(Settings(), Output(json_lines=False)), EXAMPLE, label=LABELS, every="200ms", duration="20s")


if __name__ == "__main__":
    main()
