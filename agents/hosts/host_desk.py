"""Where knowledge process hosts of this machine register with the instance, and time out (thesis 5.3, 5.4.1).

The prototypes of a host are available to the instance while the host is there; when it ends or times out its streams
end, their clients are notified, and they are served again when it or another of its kind is back.
"""

from collections.abc import Callable
from typing import Final

from dyknow.agents.effects import DropHost, HostCame, HostEffect, HostEvent, HostLeft, HostMessage, TakeHost, TellHost
from dyknow.agents.hosts.hosted import Host
from dyknow.federation.hosts.codec import decode_from_host, encode
from dyknow.federation.hosts.messages import Beat, FromHost, HostFault, HostOutput, Refuse, Register, Welcome
from dyknow.federation.members.clock import FederationClock
from dyknow.kpl import Instance
from dyknow.kpl.running.compiling import check_offer
from dyknow.model.errors import DecodeError, DyknowError, LabelAlreadyExists, PrototypeExists, Refused

MAX_HOSTS: Final = 32
SILENT_US: Final = 2_000_000
"""After this time without a message a host is taken for frozen; it beats four times a second."""
LATE_US: Final = 500_000
"""A platform that looks later than this stood still itself, and listens a while before it judges."""
MAX_NOTE: Final = 200


class HostDesk:
    """The hosts of one platform.

    Args:
        instance: where their prototypes are offered.
        clock: of the federation; steps are in node time.
        note: takes notes for the user.
        offset_us: the node clock minus the monotonic clock of this machine, which its processes share.
    """

    def __init__(
        self, instance: Instance, clock: FederationClock, note: Callable[[str], None], offset_us: int = 0
    ) -> None:
        self._instance, self._clock, self._note, self._offset_us = instance, clock, note, offset_us
        self._heard_us: dict[int, int] = {}
        self._hosts: dict[int, Host] = {}
        self._out: list[HostEffect] = []
        self.malformed = 0

    @property
    def hosts(self) -> tuple[Host, ...]:
        """The registered hosts, silent ones included."""
        return tuple(self._hosts.values())

    def on_event(self, event: HostEvent, now_us: int) -> None:
        """Take the coming, a message or the leaving of a host; `flush` returns the effects."""
        match event:
            case HostCame(at_us, number):
                self._heard_us[number] = at_us
                if len(self._heard_us) > MAX_HOSTS:
                    self._refuse(number, f"this platform takes at most {MAX_HOSTS} hosts")
            case HostMessage(at_us, number, payload):
                self._out.append(TakeHost(number))
                if number in self._heard_us:
                    self._heard_us[number] = at_us
                    self._take(number, payload, self._clock.federation_us(now_us))
            case HostLeft(_, number):
                host = self._hosts.get(number)
                if host is not None:
                    self._note(f"{host.name} is gone{'; its streams wait for it' if host.present else ''}")
                self._forget(number, self._clock.federation_us(now_us))

    def on_time(self, now_us: int) -> None:
        """Withdraw those that have been silent for too long."""
        for number, heard_us in tuple(self._heard_us.items()):
            due_us = self._due_us(number, heard_us)
            if due_us is None or now_us < due_us:
                continue
            host = self._hosts.get(number)
            if now_us - due_us > LATE_US:
                self._heard_us[number] = now_us - SILENT_US + LATE_US
            elif host is None:
                self._drop(number)
            else:
                self._note(f"{host.name} is silent; its streams wait for it")
                self._withdraw(host, self._clock.federation_us(now_us))

    @property
    def deadline_us(self) -> int | None:
        """When `on_time` has work next (node clock)."""
        if not self._heard_us:
            return None
        dues = [due_us for each in self._heard_us.items() if (due_us := self._due_us(*each)) is not None]
        return min(dues, default=None)

    @property
    def is_owing(self) -> bool:
        """Whether `flush` has something."""
        return bool(self._out) or (bool(self._hosts) and any(host.is_owing for host in self._hosts.values()))

    def flush(self) -> list[HostEffect]:
        """Return the pending effects; called at the end of a step, so that samples of one step travel together."""
        for number, host in self._hosts.items():
            if host.is_owing:
                self._out.append(TellHost(number, tuple(host.flush())))
        out, self._out = self._out, []
        return out

    def _due_us(self, number: int, heard_us: int) -> int | None:
        """When a connection will have been silent for too long; None: its host has timed out already."""
        host = self._hosts.get(number)
        return heard_us + SILENT_US if host is None or host.present else None

    def _take(self, number: int, payload: bytes, federation_us: int) -> None:
        host = self._hosts.get(number)
        self._instance.network.now_us = max(self._instance.network.now_us, federation_us)
        try:
            message = decode_from_host(payload)
            if host is None:
                self._register(number, message, federation_us)
            elif host.present or self._offer(host, federation_us):
                self._on_message(host, message, federation_us)
        except DecodeError as wrong:
            self.malformed += 1
            self._note(
                f"{'a host' if host is None else host.name} sent an invalid message ({wrong}); it is disconnected"
            )
            self._drop(number)
            self._forget(number, federation_us)

    def _on_message(self, host: Host, message: FromHost, federation_us: int) -> None:
        match message:
            case HostOutput():
                host.on_made(message, federation_us)
            case HostFault(number, text):
                process = host.processes.get(number)
                if process is not None:
                    process.fault(text)
            case Beat(dropped):
                host.dropped_there = dropped
            case Register():
                raise DecodeError("registered twice")

    def _register(self, number: int, message: FromHost, federation_us: int) -> None:
        if not isinstance(message, Register):
            raise DecodeError("not registered")
        host = self._hosts[number] = Host(number, message, self._instance.unit)
        if self._offer(host, federation_us):
            names = [*(each.name for each in message.units), *(each.name for each in message.sources)]
            self._note(f"{host.name} offers {', '.join(names)[:MAX_NOTE]}")

    def _offer(self, host: Host, federation_us: int) -> bool:
        """Offer all that the host has, or nothing if something of it is taken; then it is refused and disconnected."""
        instance, labels = self._instance, tuple(map(str, host.own))
        try:
            self._admit(host)
            host.present = True
            host.say(Welcome(instance.unit, labels, self._clock.epoch_us, self._clock.speed, self._offset_us))
            instance.offer(host.prototypes, federation_us)
            for label, prototype in host.own.items():
                assert prototype.elsewhere is not None  # noqa: S101  (made so by `Host`)
                sort = next(iter(prototype.checked_sorts), None) or instance.sort(prototype.sort)
                instance.network.add_process(label, sort, prototype.elsewhere())
        except DyknowError as wrong:
            self._withdraw(host, federation_us)
            host.out.clear()
            del self._hosts[host.number]
            self._note(f"{host.name} is refused: {wrong}")
            self._refuse(host.number, str(wrong))
            return False
        return True

    def _admit(self, host: Host) -> None:
        """Check that all prototypes of a host can be taken; raises the error of the first that cannot."""
        instance = self._instance
        for other in self._hosts.values():
            names = {each.name for each in other.prototypes} if other.present else set()
            taken = next((each.name for each in host.prototypes if each.name in names), None)
            if taken is not None:
                raise Refused(f"{taken!r} is offered by {other.name} already", "taken")
        for prototype in host.prototypes:
            if instance.prototypes.find(prototype.name) is not None:
                raise PrototypeExists(prototype.name)
            check_offer(prototype, instance.current_symbols())
        for label in host.own:
            if instance.network.has(label):
                raise LabelAlreadyExists(str(label))

    def _withdraw(self, host: Host, federation_us: int) -> None:
        """Take back what was offered for a host, and nothing else."""
        host.present = False
        instance = self._instance
        for prototype in host.prototypes:
            if instance.prototypes.find(prototype.name) is prototype:
                instance.withdraw([prototype.name], federation_us)
        for label, prototype in host.own.items():
            process = instance.network.process(label)
            if getattr(process, "prototype", None) is prototype:
                instance.network.remove(label)

    def _refuse(self, number: int, why: str) -> None:
        self._out.append(TellHost(number, (encode(Refuse(why)),)))
        self._drop(number)

    def _drop(self, number: int) -> None:
        self._heard_us.pop(number, None)
        self._out.append(DropHost(number))

    def _forget(self, number: int, federation_us: int) -> None:
        self._heard_us.pop(number, None)
        host = self._hosts.pop(number, None)
        if host is not None and host.present:
            self._withdraw(host, federation_us)
