"""A simulated autopilot that speaks MAVLink 2 with several peers: bytes and time in, bytes out. No socket, no clock.

Time is what the caller says, UTC microseconds. Telemetry goes out on its 100 ms grid and is measured exactly there;
physics runs in 20 ms steps of its own grid. `time_boot_ms` counts from the whole second in which the vehicle started.
Faults change what it reports, hears and says, not how it flies: it
keeps knowing where it is.
"""

import struct

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from dyknow.model.instants import US_PER_S
from dyknow.sim_uavs.autopilot.commands import Commands, read_order
from dyknow.sim_uavs.autopilot.heard import broadcasts
from dyknow.sim_uavs.autopilot.link import Decoder, Links, MavlinkLink, Message
from dyknow.sim_uavs.autopilot.mission_protocol import Missions, Requester
from dyknow.sim_uavs.autopilot.parameters import Parameters
from dyknow.sim_uavs.autopilot.personas import PERSONAS
from dyknow.sim_uavs.autopilot.telemetry import BUILDERS, STREAM_GROUPS, Snapshot, default_ticks
from dyknow.sim_uavs.dynamics.flight import Event, Mode, StatusText
from dyknow.sim_uavs.dynamics.sensors import ImuReading, draw_bias, read_imu
from dyknow.sim_uavs.dynamics.settings import Peer, VehicleConfig
from dyknow.sim_uavs.dynamics.vehicles import SensedFlight

TICK_US = 100_000
_COMPONENTS = frozenset({0, mavlink.MAV_COMP_ID_AUTOPILOT1})
_MAVLINK_2_ID = 256
_FTP_NAK, _FTP_UNKNOWN_COMMAND = 129, 7

Sent = list[tuple[Peer, bytes]]


class Autopilot(SensedFlight):
    """One vehicle. `on_bytes` and `on_time` return the datagrams to send; `deadline_us` says when to come back."""

    def __init__(self, config: VehicleConfig, now_us: int) -> None:
        self._persona = PERSONAS[config.persona]
        super().__init__(config, now_us, TICK_US, Mode.GUIDED if self._persona.names_take_off else None)
        self._now_us = now_us
        self._commands = Commands(
            self.flight, self._frame, self._persona, lambda: self._disobeys(self._now_us), self.aim, lambda: self.hoist
        )
        self._missions = Missions(self.flight, self._frame, self._persona, self.fence)
        self._parameters = Parameters(self._persona, self.flight.settings, config.system_id)
        version = 1 if self._persona.is_mavlink_1 else 2
        self._links, self._decoder = Links(config.system_id, config.peers, now_us, version), Decoder(version)
        self._delayed: list[tuple[int, Peer, Message]] = []
        self._default_ticks = default_ticks(self._persona)
        self._loss_rng = np.random.default_rng((config.seed, config.system_id, 3))
        self._bias = draw_bias(config.imu, self._rng)
        self._boot_us = now_us - now_us % US_PER_S
        self._tick = now_us // TICK_US
        self._imu: ImuReading = read_imu(self.flight.body, self._bias, config.imu, self._rng)
        self._measure(now_us)

    @property
    def deadline_us(self) -> int:
        due = [self._tick * TICK_US, self._missions.deadline_us, *(due_us for due_us, _, _ in self._delayed)]
        return min(due_us for due_us in due if due_us is not None)

    @property
    def dropped(self) -> int:
        """Frames that looked like ours and did not check out."""
        return self._decoder.dropped

    def on_time(self, now_us: int) -> Sent:
        """Fly, and send what is due. After a pause only the newest telemetry is sent, not what was due before."""
        sent: Sent = []
        tick = now_us // TICK_US
        if tick >= self._tick:
            self._tick = tick + 1
            self.flight.on_time(tick * TICK_US)
            self._measure(tick * TICK_US)
            sent += self._telemetry(tick)
        self.flight.on_time(now_us)
        self._now_us = now_us
        self._suffer(now_us)
        sent += self._delayed_answers(now_us)
        for requester, message in self._missions.on_time(now_us):
            sent += [(link.peer, link.packed(message)) for link in self._links if link.peer == requester.peer]
        return self._through_air(sent, now_us)

    def on_bytes(self, data: bytes, peer: Peer, now_us: int) -> Sent:
        """One datagram. A message that is malformed, foreign or meant for others is dropped."""
        sent = self.on_time(now_us)
        if not self._through_air([(peer, data)], now_us):
            return sent
        answers: Sent = []
        for message in self._decoder.read(data):
            if message.get_srcSystem() == self.config.system_id:
                continue
            link = self._links.heard(peer, now_us)
            if link is not None and self._is_for_us(message):
                for answer in self._answers(message, link, now_us):
                    answers += self._answered(answer, link, now_us)
        return sent + self._through_air(answers, now_us)

    def _answered(self, answer: Message, link: MavlinkLink, now_us: int) -> Sent:
        """An answer as it leaves: acknowledgements may be lost or late."""
        if answer.get_type() == "COMMAND_ACK":
            delay_us = self._ack_delay_us(now_us)
            if self._loses_ack(now_us):
                return []
            if delay_us:
                self._delayed.append((now_us + delay_us, link.peer, answer))
                return []
        return [(link.peer, link.packed(answer))]

    def _delayed_answers(self, now_us: int) -> Sent:
        due = [each for each in self._delayed if each[0] <= now_us]
        self._delayed = [each for each in self._delayed if each[0] > now_us]
        links = {link.peer: link for link in self._links}
        return [(peer, links[peer].packed(answer)) for _, peer, answer in due if peer in links]

    def _is_for_us(self, message: Message) -> bool:
        system = getattr(message, "target_system", 0)
        return system in {0, self.config.system_id} and getattr(message, "target_component", 0) in _COMPONENTS

    def _through_air(self, datagrams: Sent, now_us: int) -> Sent:
        """The datagrams that a silent or lossy radio lets pass, either way."""
        if not datagrams or self._faults.holds("silence", now_us):
            return []
        loss = self._faults.amount("packet-loss", now_us)
        if loss is None:
            return datagrams
        return [datagram for datagram in datagrams if self._loss_rng.random() * 100.0 >= loss]

    def _measure(self, now_us: int) -> None:
        super()._measure(now_us)
        self._imu = read_imu(self.flight.body, self._bias, self.config.imu, self._rng)

    def _snapshot(self, now_us: int) -> Snapshot:
        vehicle_us = now_us + self._faults.drift_us(now_us)
        self.level_pose(now_us)
        return Snapshot(
            (vehicle_us - self._boot_us) // 1000 % 2**32,
            vehicle_us + self._faults.step_us(now_us),
            self.flight,
            self._frame,
            self._persona,
            self._gps,
            self._imu,
            self._missions.count,
            None if self.mount is None else self.mount.reported(),
            self.working_hoist,
        )

    def _telemetry(self, tick: int) -> Sent:
        self._links.forget(tick * TICK_US)
        snapshot = self._snapshot(tick * TICK_US)
        built: dict[int, Message | None] = {}
        sent: Sent = []
        said = [_spoken(event) for event in self.flight.take_events()]
        others = [message for one in self._heard(tick * TICK_US) for message in broadcasts(self._frame, one)]
        heard = [each for each in others if each.id < _MAVLINK_2_ID or not self._persona.is_mavlink_1]
        for link in self._links:
            for kind, every in (self._default_ticks | link.ticks).items():
                if every <= 0 or (link.met and tick % every) or kind in self._persona.never_sent:
                    continue
                if kind not in built:
                    built[kind] = BUILDERS[kind](snapshot)
                if built[kind] is not None:
                    sent.append((link.peer, link.packed(built[kind])))
            sent += [(link.peer, link.packed(message)) for message in (*said, *heard)]
            link.met = True
        return sent

    def _answers(self, message: Message, link: MavlinkLink, now_us: int) -> list[Message]:
        requester = Requester(link.peer, message.get_srcSystem(), message.get_srcComponent())
        match message.get_msgId():
            case mavlink.MAVLINK_MSG_ID_COMMAND_LONG | mavlink.MAVLINK_MSG_ID_COMMAND_INT:
                return self._on_command(message, requester, link, now_us)
            case mavlink.MAVLINK_MSG_ID_SET_MODE:
                result = self._commands.set_custom_mode(message.custom_mode)
                return [_ack(mavlink.MAVLINK_MSG_ID_SET_MODE, result, requester)]
            case mavlink.MAVLINK_MSG_ID_REQUEST_DATA_STREAM if self._persona.on_request:
                hertz = message.req_message_rate if message.start_stop else 0
                for kind in STREAM_GROUPS.get(message.req_stream_id, ()):
                    link.ticks[kind] = max(1, round(1e6 / TICK_US / hertz)) if hertz else 0
            case mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST:
                return self._parameters.all()
            case mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ:
                return self._parameters.read(message.param_id, message.param_index)
            case mavlink.MAVLINK_MSG_ID_PARAM_SET:
                return self._parameters.write(message.param_id, message.param_value)
            case mavlink.MAVLINK_MSG_ID_HEARTBEAT:
                is_station = message.type == mavlink.MAV_TYPE_GCS
                self._failsafe.on_heartbeat(message.get_srcSystem(), now_us, is_station=is_station)
            case mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT:
                self._failsafe.on_setpoint(now_us)
                self._commands.set_global_target(message)
            case mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED:
                self._failsafe.on_setpoint(now_us)
                self._commands.set_local_target(message)
            case mavlink.MAVLINK_MSG_ID_TIMESYNC if message.tc1 == 0:
                return [mavlink.MAVLink_timesync_message(self._snapshot(now_us).boot_ms * 1_000_000, message.ts1)]
            case mavlink.MAVLINK_MSG_ID_PING if message.target_system == 0:
                return [
                    mavlink.MAVLink_ping_message(message.time_usec, message.seq, requester.system, requester.component)
                ]
            case mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL:
                return [_no_files(message, requester)]
            case _:
                return self._on_mission(message, requester, now_us)
        return []

    def _on_mission(self, message: Message, requester: Requester, now_us: int) -> list[Message]:
        missions = self._missions
        match message.get_msgId():
            case mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST:
                return missions.on_list(requester, message)
            case mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT | mavlink.MAVLINK_MSG_ID_MISSION_REQUEST:
                return missions.on_request(requester, message)
            case mavlink.MAVLINK_MSG_ID_MISSION_COUNT:
                return missions.on_count(requester, message, now_us)
            case mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL:
                return missions.on_clear(requester, message)
            case mavlink.MAVLINK_MSG_ID_MISSION_SET_CURRENT:
                self.flight.set_item(message.seq)
                return [BUILDERS[mavlink.MAVLINK_MSG_ID_MISSION_CURRENT](self._snapshot(now_us))]
            case mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT if message.current in {2, 3}:
                result = self._commands.go_to_item(message)
                return [mavlink.MAVLink_mission_ack_message(requester.system, requester.component, result, 0)]
            case mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT:
                return missions.on_item(requester, message, now_us)
        return []

    def _on_command(self, message: Message, requester: Requester, link: MavlinkLink, now_us: int) -> list[Message]:
        """Its acknowledgement, to the requester; the requested messages come after it."""
        order = read_order(message)
        told: list[Message] = []
        by_int = message.get_msgId() == mavlink.MAVLINK_MSG_ID_COMMAND_INT
        if order.command in self._persona.not_understood or (by_int and not self._persona.takes_command_int):
            return [_ack(order.command, int(mavlink.MAV_RESULT_UNSUPPORTED), requester)]
        match order.command:
            case mavlink.MAV_CMD_REQUEST_MESSAGE:
                told = self._requested(*order.params[:2], now_us)
                result = mavlink.MAV_RESULT_ACCEPTED if told else mavlink.MAV_RESULT_UNSUPPORTED
            case mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES:
                told, result = [self._version()], mavlink.MAV_RESULT_ACCEPTED
            case mavlink.MAV_CMD_GET_HOME_POSITION:
                told = self._requested(mavlink.MAVLINK_MSG_ID_HOME_POSITION, 0, now_us)
                result = mavlink.MAV_RESULT_ACCEPTED
            case mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
                result = self._set_interval(link, *order.params[:2])
            case mavlink.MAV_CMD_GET_MESSAGE_INTERVAL:
                told = self._interval(link, order.params[0])
                result = mavlink.MAV_RESULT_ACCEPTED
            case _:
                result = self._commands.obey(order)
        is_twice = order.command == mavlink.MAV_CMD_DO_SET_MODE and self._persona.acknowledges_modes_twice
        return [_ack(order.command, result, requester)] * (2 if is_twice else 1) + told

    def _requested(self, kind: float, index: float, now_us: int) -> list[Message]:
        """The message with this id, now. Of AVAILABLE_MODES one, or all when `index` is 0."""
        if kind == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            return [self._version()]
        if kind == mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES:
            modes = self._modes()
            return modes if index == 0 else [mode for mode in modes if mode.mode_index == index]
        build = BUILDERS.get(int(kind)) if kind == kind // 1 else None
        message = build(self._snapshot(now_us)) if build else None
        return [] if message is None else [message]

    def _modes(self) -> list[Message]:
        modes, standard = self._persona.modes, self._persona.standard
        return [
            mavlink.MAVLink_available_modes_message(
                len(modes), index, standard.get(mode, 0), number, 0, self._persona.name(mode).encode()
            )
            for index, (mode, number) in enumerate(modes.items(), start=1)
        ]

    def _version(self) -> Message:
        encoding = "BYTEWISE" if self._persona.bytewise else "C_CAST"
        capabilities = (
            mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
            | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
            | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
            | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
            | getattr(mavlink, f"MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_{encoding}")
        )
        version = int.from_bytes(bytes(self._persona.version), "big")
        uid = self.config.system_id
        return mavlink.MAVLink_autopilot_version_message(
            capabilities, version, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, uid
        )

    def _set_interval(self, link: MavlinkLink, kind: float, interval_us: float) -> int:
        """Per peer: 0 restores the default, -1 stops, else the nearest number of ticks. Nothing faster than a tick."""
        if kind not in BUILDERS:
            return int(mavlink.MAV_RESULT_UNSUPPORTED)
        if kind in self._persona.unscheduled:
            return int(mavlink.MAV_RESULT_FAILED)
        if interval_us == 0:
            link.ticks.pop(int(kind), None)
        elif interval_us == -1:
            link.ticks[int(kind)] = 0
        elif TICK_US <= interval_us <= 3600 * US_PER_S:
            link.ticks[int(kind)] = round(interval_us / TICK_US)
        else:
            return int(mavlink.MAV_RESULT_DENIED)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _interval(self, link: MavlinkLink, kind: float) -> list[Message]:
        ticks = (self._default_ticks | link.ticks).get(int(kind)) if kind in BUILDERS else None
        interval_us = 0 if ticks is None else ticks * TICK_US or -1
        return [mavlink.MAVLink_message_interval_message(int(kind) % 65536 if kind in BUILDERS else 0, interval_us)]


def _ack(command: int, result: int, requester: Requester) -> Message:
    return mavlink.MAVLink_command_ack_message(command, result, 0, 0, requester.system, requester.component)


def _spoken(event: Event) -> Message:
    if isinstance(event, StatusText):
        return mavlink.MAVLink_statustext_message(event.severity, event.text.encode()[:50])
    return mavlink.MAVLink_mission_item_reached_message(event.item)


def _no_files(message: Message, requester: Requester) -> Message:
    """This vehicle has no files: every request is refused, so that no station waits."""
    seq, session, opcode = struct.unpack_from("<HBB", bytes(message.payload))
    refusal = struct.pack("<HBBBBBxIB", (seq + 1) % 65536, session, _FTP_NAK, 1, opcode, 0, 0, _FTP_UNKNOWN_COMMAND)
    return mavlink.MAVLink_file_transfer_protocol_message(
        0, requester.system, requester.component, list(refusal.ljust(251, b"\0"))
    )
