"""Two platforms whose vehicles fly towards each other, and what they have said, noted and ordered."""

from typing import Any

from dyknow.federation import keys
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import MonitorProximity, Reason, read
from dyknow.federation.messages.receipts import RECEIPT_AGENT
from dyknow.federation.transport import Put
from tests.box import Box, Vehicle

P = Performative


def meeting(
    wire: Box, zero: dict[str, Any] | None = None, one: dict[str, Any] | None = None, **vehicle_one: Any
) -> None:
    """Platforms 0 (102 m) and 1 (100 m) are to meet after 25 s, and monitor that; by name 1 is to yield.

    `zero` and `one` are the settings of the platforms, `vehicle_one` what is otherwise with the vehicle of 1.
    """
    wire.join("0", Vehicle(east_m=-100.0, east_m_s=4.0, altitude_m=102.0), **{"control": True, **(zero or {})})
    there = {"east_m": 100.0, "east_m_s": -4.0, **vehicle_one}
    wire.join("1", Vehicle(**there), **{"control": True, **(one or {})})
    wire.centre()
    wire.run(1.0)
    wire.question("cc", "0", MonitorProximity())
    wire.run(1.5)


def refusals(wire: Box, by: str) -> list[str]:
    """Why `by` refused proposals."""
    asked = {act.conversation_id for act in wire.acts(receiver=by, head="avoid")}
    return [reason_of(act) for act in wire.acts(by) if act.performative is P.REFUSE and act.conversation_id in asked]


def reason_of(act: Act) -> str:
    assert act.content is not None
    said = read(act.content)
    assert isinstance(said, Reason)
    return said.text


def orders(wire: Box, unit: str) -> list[object]:
    return [command.order for _, command in wire.vehicle(unit).commands]


def notes(wire: Box, unit: str) -> list[str]:
    """What the platform has noted for people."""
    return wire.nodes[unit].notes


def deaf_to_acts(*pairs: tuple[str, str], receipts: bool = False) -> Any:
    """No act crosses from the one to the other; streams and heartbeats do, and `receipts` where that is set."""

    def drop(sender: str, receiver: str, put: Put) -> bool:
        key = keys.parse_key(put.key)
        is_act = isinstance(key, keys.ActKey) and not (receipts and key.agent == RECEIPT_AGENT)
        return (sender, receiver) in pairs and is_act

    return drop
