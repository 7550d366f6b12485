"""A ground station without a socket: asks an autopilot, steps its time, keeps what it says."""

from pymavlink.dialects.v20 import all as mavlink

from dyknow.sim_uavs.autopilot.autopilot import Autopilot
from dyknow.sim_uavs.dynamics.faults import parse_fault
from dyknow.sim_uavs.dynamics.settings import HomePlace, VehicleConfig
from tests.sim_uavs.truth import true_motion

START_US = 1_700_000_000_000_000
HOME = HomePlace(55.7240, 13.4600, 20.0)
NAN = float("nan")
ME = ("127.0.0.1", 14550)


def decoded(data: bytes):
    return mavlink.MAVLink(None).decode(bytearray(data))


class Station:
    """`heard` is every message it was sent; `now_us` moves by `run` only."""

    def __init__(self, persona="ardupilot", system=255, component=190, peer=ME, vehicle=None, **config) -> None:
        config.setdefault("peers", (peer,))
        self.vehicle = vehicle or Autopilot(VehicleConfig(1, HOME, persona, **config), START_US)
        self.now_us, self.peer, self.persona = START_US, peer, persona
        self.system, self.component = system, component
        self._mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        self.heard = []
        self._keep(self.vehicle.on_time(self.now_us))

    def send(self, message) -> list:
        """What the vehicle answers at once to this station."""
        data = message.pack(self._mav)
        self._mav.seq = (self._mav.seq + 1) % 256
        return self._keep(self.vehicle.on_bytes(data, self.peer, self.now_us))

    def _keep(self, sent) -> list:
        mine = [decoded(data) for peer, data in sent if peer == self.peer]
        self.heard += mine
        return mine

    def command(self, command, *params, answer=True):
        """A COMMAND_LONG; the result of its one acknowledgement."""
        full = [*params, *[0.0] * (7 - len(params))]
        return self._result(mavlink.MAVLink_command_long_message(1, 1, command, 0, *full), command)

    def command_int(self, command, frame, params, x, y, z):
        message = mavlink.MAVLink_command_int_message(1, 1, frame, command, 0, 0, *params, x, y, z)
        return self._result(message, command)

    def _result(self, message, command):
        acks = [m for m in self.send(message) if m.get_type() == "COMMAND_ACK"]
        is_twice = self.persona == "px4" and command == mavlink.MAV_CMD_DO_SET_MODE
        assert len(acks) == (2 if is_twice else 1), acks
        assert len({ack.result for ack in acks}) == 1
        assert acks[0].command == command
        assert (acks[0].target_system, acks[0].target_component) == (self.system, self.component)
        return acks[0].result

    def run(self, seconds) -> list:
        """Step to every deadline for so long; what was heard meanwhile."""
        end_us, before = self.now_us + round(seconds * 1e6), len(self.heard)
        while self.vehicle.deadline_us <= end_us:
            self.now_us = max(self.now_us, self.vehicle.deadline_us)
            self._keep(self.vehicle.on_time(self.now_us))
        self.now_us = end_us
        return self.heard[before:]

    def run_until(self, holds, at_most=120.0) -> None:
        end_us = self.now_us + round(at_most * 1e6)
        while not holds():
            assert self.now_us < end_us, f"did not happen within {at_most} s: {self.truth}"
            self.run(0.1)

    def of_type(self, name) -> list:
        return [message for message in self.heard if message.get_type() == name]

    def last(self, name):
        return self.of_type(name)[-1]

    def inject(self, text, seconds=None) -> None:
        until_us = None if seconds is None else self.now_us + round(seconds * 1e6)
        self.vehicle.inject(parse_fault(text), self.now_us, until_us)

    @property
    def truth(self):
        return true_motion(self.vehicle)

    @property
    def height_m(self) -> float:
        return self.truth.place.altitude_m - HOME.altitude_m

    def set_mode(self, name) -> int:
        numbers = {
            "ardupilot": {"GUIDED": (4, 0), "AUTO": (3, 0), "LOITER": (5, 0), "STABILIZE": (0, 0)},
            "px4": {"GUIDED": (4, 3), "AUTO": (4, 4), "LOITER": (3, 0), "STABILIZE": (7, 0), "OFFBOARD": (6, 0)},
        }
        return self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, *numbers[self.persona][name])

    def take_off(self, height_m=20.0) -> None:
        """Arm, take off to a height above home and wait until it is there."""
        assert self.set_mode("GUIDED") == 0
        assert self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0
        altitude_m = height_m if self.persona == "ardupilot" else height_m + HOME.altitude_m
        assert self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, NAN, NAN, altitude_m) == 0
        self.run_until(lambda: abs(self.height_m - height_m) < 0.5)
