"""`dyknow.join`: a platform of one's own in a federation, with streams, declarations and monitors, and no vehicle."""

import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from dyknow import SURE, Quality, Value
from dyknow.agents.effects import Fed, Specify
from dyknow.agents.specification.options import RunOptions
from dyknow.agents.specification.specification_part import read
from dyknow.federation.keys import unit as unit_name
from dyknow.model.errors import FederationFailed, SpecificationFailed, WrongCall
from dyknow.model.labels import Label
from dyknow.runtime.configuration.config import NodeConfig, NoVehicle
from dyknow.runtime.configuration.reach import client_wire, trust_files
from dyknow.runtime.library.feed import Feed
from dyknow.runtime.library.member_thread import settings_of
from dyknow.runtime.library.pushed_samples import pushed
from dyknow.runtime.process import PlatformProcess
from dyknow.runtime.vehicles import Vehicle

_ANSWER_S = 10.0


class StreamAlarm(NamedTuple):
    """An alarm of a monitor of one's own: it `opened`, `closed`, or `ended` since its monitor was removed.

    Attributes:
        event: `opened`, `closed` or `ended`.
        monitor: its name.
        units: which platforms it is about; empty for a formula over streams of one's own.
        valid_us: the state that shows it, federation time; `detected_us` is when it was found.
        values: the compared values, by label.
    """

    event: str
    monitor: str
    units: tuple[str, ...]
    valid_us: int
    detected_us: int
    values: Mapping[str, Any]


def join(
    unit: str | int,
    *,
    federation: str | Path = "",
    listen: str | tuple[str, ...] | None = None,
    connect: str | tuple[str, ...] | None = None,
    interface: str | None = None,
    roster: str | Path | None = None,
    key: str | Path | None = None,
    units: str | tuple[str, ...] = (),
    extensions: str | tuple[str, ...] | None = None,
    ontology: str | Path | None = None,
) -> "OwnPlatform":
    """A platform of one's own, to be entered: `with dyknow.join("7") as me` runs it in the background.

    Args:
        unit: its name in the federation; no other platform may have it.
        federation: as for `connect`, and so are `listen`, `connect`, `interface` and `roster`.
        listen: Zenoh endpoints.
        connect: Zenoh endpoints.
        interface: network interface of multicast.
        roster: public keys of all members.
        key: file with its private key; `keys/UNIT.key` in the roster's folder (`roster.d`) unless set.
        units: modules with computational units for its declarations.
        extensions: modules that bring it further parts and semantic labels.
        ontology: file of semantic labels that not every platform has.

    Raises:
        WrongCall: an option that is not right.
        NameRefused: a name that cannot be a unit.
        RosterError: the roster or the key does not load, or the federation is open and reaches beyond this machine.
        SessionFailed: on entering: the session does not open.
    """
    name = unit_name(str(unit))
    settings = settings_of(
        federation,
        listen=listen,
        connect=connect,
        interface=interface,
        roster=roster,
        extensions=extensions,
        ontology=ontology,
    )
    config = NodeConfig(
        unit=name,
        wire=client_wire(settings, name),
        trust=trust_files(settings, name, None if key is None else Path(key)),
        vehicle=NoVehicle(),
        extensions=settings.extensions,
        ontology=settings.ontology,
    )
    return OwnPlatform(config.having(RunOptions(modules=_modules(units))))


def _modules(units: object) -> tuple[str, ...]:
    """Names of modules: one, or several."""
    several = (units,) if isinstance(units, str | Path) else units
    if isinstance(several, tuple | list) and all(isinstance(each, str | Path) for each in several):
        return tuple(map(str, several))
    raise WrongCall(f"join: units are modules, by name or path, such as units=('gas.py',); got {units!r}")


class OwnPlatform:
    """A platform of one's own; `join` makes it. All methods may be called from any thread.

    It runs in the background inside `with`, or in a loop of one's own: `open()`, then `run()`, or `step()` again and
    again, and `close()` at the end.

    Attributes:
        alarms: alarms of its monitors, to be iterated.
        samples: (stream, valid time, value) of the streams that it declares with `stream`, to be iterated.
        notes: its notes for a log, to be iterated.
    """

    def __init__(self, config: NodeConfig) -> None:
        self.unit = config.unit
        self.alarms: Feed[StreamAlarm] = Feed()
        self.samples: Feed[tuple[str, int, Value]] = Feed()
        self.notes: Feed[str] = Feed()
        self._process = PlatformProcess(config, lambda _ports: Vehicle(), self._on_record)
        self._on_alarm: dict[str, Callable[[StreamAlarm], object]] = {}
        self._texts: list[str] = []
        self._answers: Feed[Mapping[str, Any]] = Feed()
        self._declaring = threading.Lock()
        self._thread: threading.Thread | None = None
        self._error: Exception | None = None

    # -- running -----------------------------------------------------------------------------------------------

    def __enter__(self) -> Self:
        self.open()
        self._thread = threading.Thread(target=self._run, name=f"platform {self.unit}", daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
        if kind is None and self._error is not None:
            raise self._error

    def open(self) -> None:
        """Join the federation, without a thread: for a loop of one's own.

        Raises:
            SessionFailed, RosterError: as `join`.
        """
        try:
            self._process.open()
        except BaseException:
            self._process.close()
            raise

    def step(self, timeout_s: float | None = None) -> bool:
        """Wait for the next event, at most `timeout_s` seconds, and act on it; whether the platform still runs."""
        if self._process.is_running:
            self._process.step(timeout_s)
        return self._process.is_running

    def run(self) -> None:
        """Run until `stop`, or until it must leave.

        Raises:
            FederationFailed: another platform has its name, or its clock does not fit the federation.
        """
        if self._thread is None:
            while self.step():
                pass
        else:
            self._thread.join()
        if self._error is not None:
            raise self._error

    def stop(self) -> None:
        """End `run`; from any thread, or a signal."""
        self._process.stop()

    def close(self) -> None:
        """Leave the federation."""
        self._process.stop()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        elif self._thread is None:
            self._leave()

    def _run(self) -> None:
        try:
            while self.step():
                pass
        except Exception as error:  # noqa: BLE001  (it is raised where the program waits)
            self._error = error
        finally:
            self._leave()

    def _leave(self) -> None:
        try:
            if self._error is None:
                self._process.leave()
        finally:
            self._process.close()
            for feed in (self.alarms, self.samples, self.notes, self._answers):
                feed.close(self._error)

    @property
    def now_us(self) -> int:
        """Federation time, in microseconds."""
        return self._process.federation_us()

    # -- streams and declarations ------------------------------------------------------------------------------

    def declare(self, text: str) -> None:
        """Add declarations in KPL (docs/kpl.md) to those that run.

        Raises:
            TextError: the text is wrong; the error says where, and what to write.
            FederationFailed: the platform does not run.
            SpecificationFailed: it cannot be added to what runs; the message shows the place.
        """
        read(text, "")
        if not self._process.is_open:
            raise FederationFailed(f"platform {self.unit} does not run: enter it with `with`, or call open() first")
        with self._declaring:
            texts = [*self._texts, text]
            self._process.mailbox.post(Specify(self._process.clock.now_us(), "\n".join(texts), ""))
            answer = self._answer()
            if answer["event"] != "specified":
                raise SpecificationFailed(str(answer["said"]))
            self._texts = texts

    def _answer(self) -> Mapping[str, Any]:
        """The answer to a specification: where no thread steps the platform, it is stepped here."""
        if self._thread is not None:
            answer = self._answers.get(_ANSWER_S)
        else:
            answer = self._answers.get(0)
            while answer is None and self.step(_ANSWER_S):
                answer = self._answers.get(0)
        if answer is None:
            raise FederationFailed(f"platform {self.unit} did not take the declarations within {_ANSWER_S:.0f} s")
        return answer

    def source(self, name: str, *, sort: str, label: str | None = None) -> None:
        """Declare a source that is fed by `push`, and the stream that it makes.

        Args:
            name: for `push`.
            sort: of its values, e.g. `position`; docs/python.md lists the fields of each.
            label: of its stream, e.g. `pos[7]`; None: its name.

        Raises:
            SpecificationFailed: the name or the label is taken.
        """
        self.declare(f"source {sort} {name}\nstrmgen {Label.parse(label or name)} = {name}")

    def push(self, source: str, valid_us: int | str, value: Any, quality: Quality = SURE) -> None:
        """A new sample of a source; where no stream takes the source, it is dropped.

        Args:
            source: its name.
            valid_us: when it holds, federation time: `now_us`, or "now", for a value of now.
            value: a number, a text, or a tuple in the order of the sort's fields; None: no value.
            quality: its certainty, and the covariance of its fields.

        Raises:
            WrongCall: an argument is something else.
        """
        sample = pushed(source, valid_us, value, quality, self.now_us)
        self._process.mailbox.post(Fed(self._process.clock.now_us(), *sample))

    def export(self, semantic: str, stream: str, *, every: str = "100ms") -> None:
        """Offer a stream to other platforms under a semantic label, a sample each `every`.

        Raises:
            SpecificationFailed: there is no such stream or semantic label, or its sort is another.
        """
        self.declare(f"export {semantic} = {Label.parse(stream)} with sample every {every}")

    def monitor(
        self, name: str, formula: str, *, on_alarm: Callable[[StreamAlarm], object] | None = None, options: str = ""
    ) -> None:
        """Watch a formula: an alarm opens while it is violated.

        Args:
            name: of the monitor.
            formula: as docs/formulas.md has it, e.g. `always speed[car1] < 14`.
            on_alarm: called by the platform's thread with each alarm that opens or closes; it must not wait.
            options: after `with`, e.g. `sample every 100ms, max delay 1s`.

        Raises:
            TextError: the formula is wrong, and where.
            SpecificationFailed: it names what is not there.
        """
        if on_alarm is not None:
            self._on_alarm[name] = on_alarm
        self.declare(f"monitor {name} = {formula}{f' with {options}' if options else ''}")

    # -- what the platform says --------------------------------------------------------------------------------

    def _on_record(self, record: Mapping[str, Any]) -> None:
        match record.get("event"):
            case "sample":
                self.samples.put((str(record["stream"]), int(record["valid_us"]), record["value"]))
            case "alarm-opened" | "alarm-closed" | "alarm-ended" as event:
                units, values = tuple(record["units"]), dict(record["values"])
                opened = str(event).removeprefix("alarm-")
                alarm = StreamAlarm(
                    opened, str(record["monitor"]), units, record["valid_us"], record["detected_us"], values
                )
                self.alarms.put(alarm)
                if (on_alarm := self._on_alarm.get(alarm.monitor)) is not None:
                    on_alarm(alarm)
            case "specified" | "not-specified":
                self._answers.put(record)
            case "halted":
                self._error = FederationFailed(str(record["reason"]))
            case "note":
                self.notes.put(str(record["text"]))
            case _:
                pass
