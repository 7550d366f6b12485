"""The link between an autopilot and its platform, through a tap that notes orders, and loses, answers or cuts. Loopback only."""

import random
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

STATION = 255
"""The system id of the ground station, whose orders a platform may forward."""


class Sent(NamedTuple):
    """A message of the platform to its autopilot."""

    at_s: float
    message: Any


class Tap:
    """Passes messages between autopilot and platform, notes the orders, and may lose or answer some.

    Args:
        refuses: every order is answered DENIED and does not arrive.
        ack_loss: the part of acknowledgements that is lost.
        is_cut: nothing arrives, in either direction.
    """

    def __init__(self, random_: random.Random, platform_port: int) -> None:
        self.refuses, self.ack_loss, self.is_cut, self.orders = False, 0.0, False, []
        self._random = random_
        self._vehicle, self._platform = udp(), udp()
        self.vehicle_port: int = self._vehicle.getsockname()[1]
        self.platform_port = platform_port
        self._from: Any = None
        self._parsers = [mavlink.MAVLink(None), mavlink.MAVLink(None)]
        for parser in self._parsers:
            parser.robust_parsing = True
        self._reply = mavlink.MAVLink(None, srcComponent=1)
        self._going = True
        self._threads = [threading.Thread(target=each, daemon=True) for each in (self._down, self._up)]
        for thread in self._threads:
            thread.start()

    orders: list[Sent]

    def _down(self) -> None:
        """From the autopilot to the platform."""
        while (packet := received(self._vehicle, lambda: self._going)) is not None:
            payload, self._from = packet
            for message in self._parsers[0].parse_buffer(payload) or ():
                lost = message.get_type() == "COMMAND_ACK" and self._random.random() < self.ack_loss
                if not lost and not self.is_cut:
                    self._platform.sendto(bytes(message.get_msgbuf()), ("127.0.0.1", self.platform_port))

    def _up(self) -> None:
        """From the platform to the autopilot."""
        while (packet := received(self._platform, lambda: self._going)) is not None:
            for message in self._parsers[1].parse_buffer(packet[0]) or ():
                if self.is_cut:
                    continue
                is_order = _is_order(message)
                if is_order and message.get_srcSystem() != STATION:
                    self.orders.append(Sent(time.monotonic(), message))
                if is_order and self.refuses:
                    self._deny(message)
                elif self._from is not None:
                    self._vehicle.sendto(bytes(message.get_msgbuf()), self._from)

    def _deny(self, order: Any) -> None:
        command = getattr(order, "command", None)
        if command is not None:
            self._reply.srcSystem = order.target_system
            denied = mavlink.MAVLink_command_ack_message(
                command, mavlink.MAV_RESULT_DENIED, 0, 0, order.get_srcSystem(), order.get_srcComponent()
            )
            self._platform.sendto(denied.pack(self._reply), ("127.0.0.1", self.platform_port))

    def close(self) -> None:
        self._going = False
        for thread in self._threads:
            thread.join()
        self._vehicle.close()
        self._platform.close()


def _is_order(message: Any) -> bool:
    """What moves the vehicle or changes its mode."""
    kind = message.get_type()
    moving = {
        mavlink.MAV_CMD_DO_REPOSITION, mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_NAV_LAND,
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, mavlink.MAV_CMD_DO_SET_MISSION_CURRENT,
    }  # fmt: skip
    commands = kind in {"COMMAND_INT", "COMMAND_LONG"} and message.command in moving
    return commands or kind in {"SET_POSITION_TARGET_GLOBAL_INT", "SET_MODE", "MISSION_SET_CURRENT"}


def udp() -> socket.socket:
    found = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    found.bind(("127.0.0.1", 0))
    found.settimeout(0.2)
    return found


def received(here: socket.socket, going: Callable[[], bool]) -> tuple[bytes, Any] | None:
    """The next datagram; None when it is over."""
    while going():
        with suppress(TimeoutError, ConnectionRefusedError):
            return here.recvfrom(65_535)
    return None
