"""Requests to a vehicle: messages at a rate, its home and the parameters of its fence once. No socket and no clock.

SET_MESSAGE_INTERVAL names each message. REQUEST_DATA_STREAM, which brings whole groups of them, is for autopilots that
do not understand the former, or do not answer.
"""

from collections.abc import Sequence
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.proxies.mavlink.ways import Target, long_command

_WANTED_HZ = {
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 10.0,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 5.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 10.0,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 2.0,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 1.0,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 2.0,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: 2.0,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
    mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS: 10.0,
    mavlink.MAVLINK_MSG_ID_WINCH_STATUS: 5.0,
    mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE: 10.0,
}
_STREAMS_HZ = {
    mavlink.MAV_DATA_STREAM_POSITION: 10,
    mavlink.MAV_DATA_STREAM_EXTRA1: 10,
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: 2,
}
_HOME = float(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
_HOME_COMMANDS: tuple[tuple[int, tuple[float, ...]], ...] = (
    (mavlink.MAV_CMD_REQUEST_MESSAGE, (_HOME,)),
    (mavlink.MAV_CMD_GET_HOME_POSITION, ()),
)
_PARAMETER_ROUNDS = 10
"""Rounds of requests: an autopilot does not answer for a parameter that it lacks, and reports changes unasked."""
_COMMANDS = {mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, *(command for command, _ in _HOME_COMMANDS)}


class Requests:
    """The requests to one vehicle, and how it took them.

    Attributes:
        rounds: how often they were sent.
        is_answered: whether it acknowledged any.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """The vehicle is met, or met again: nothing was sent yet."""
        self.rounds, self.is_answered = 0, False
        self._by_streams: bool | None = None
        self._is_streaming = False
        self._home_way = 0

    def on_ack(self, acknowledged: Any) -> bool:
        """COMMAND_ACK of a request or of anything else; whether to ask again at once, in another way."""
        is_unknown = acknowledged.result == mavlink.MAV_RESULT_UNSUPPORTED
        before = self._by_streams, self._home_way
        self.is_answered |= acknowledged.command in _COMMANDS
        if acknowledged.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            # One message that the autopilot does not have is refused; the first that it has settles it.
            self._by_streams = is_unknown and self._by_streams is not False
        elif is_unknown and self._home_way < len(_HOME_COMMANDS):
            self._home_way += acknowledged.command == _HOME_COMMANDS[self._home_way][0]
        return (self._by_streams, self._home_way) != before and is_unknown

    def messages(self, target: Target, *, is_positioned: bool, is_homed: bool, untold: Sequence[str] = ()) -> list[Any]:
        """The requests to send now: all at first, later only for missing messages; `untold` are names of parameters."""
        asked: list[Any] = []
        if not self._by_streams and (self.rounds == 0 or not is_positioned):
            asked += _intervals(target)
        is_unanswered = self._by_streams is None and self.rounds > 0
        is_streaming = is_positioned and (is_unanswered or self._is_streaming)
        if (self._by_streams or is_unanswered) and not is_streaming:
            asked += _streams(target)
            self._is_streaming = True
        if not is_homed and self._home_way < len(_HOME_COMMANDS):
            command, parameters = _HOME_COMMANDS[self._home_way]
            asked.append(long_command(target, command, *parameters))
        if self.rounds < _PARAMETER_ROUNDS:
            asked += [mavlink.MAVLink_param_request_read_message(*target, name.encode(), -1) for name in untold]
        self.rounds += 1
        return asked


def _intervals(target: Target) -> list[Any]:
    return [
        long_command(target, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, float(message_id), 1e6 / hertz)
        for message_id, hertz in _WANTED_HZ.items()
    ]


def _streams(target: Target) -> list[Any]:
    return [
        mavlink.MAVLink_request_data_stream_message(target.system, target.component, stream, hertz, 1)
        for stream, hertz in _STREAMS_HZ.items()
    ]
