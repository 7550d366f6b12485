"""A member stepped by a thread of its own, so that it stays in the federation whatever the program does meanwhile."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Generic, TypeVar

from dyknow.federation.members.command_centre import CommandCentre
from dyknow.model.errors import SessionFailed
from dyknow.runtime.client import Client, ClientPorts, Job, Wait
from dyknow.runtime.configuration.settings import Settings, load

T = TypeVar("T")
_CLOSE_S = 5.0


def settings_of(federation: str | Path, **options: Any) -> Settings:
    """The options as the command finds them: these arguments, then `DYKNOW_*` variables, then the federation's file.

    Raises:
        WrongCall: an option or file that is not right, with the remedy.
    """
    given = {name: value for name, value in options.items() if value is not None}
    flags = {
        name: (value,) if name in {"listen", "connect", "extensions"} and isinstance(value, str) else value
        for name, value in given.items()
    }
    if str(federation):
        flags["federation"] = str(federation)
    return load(flags, None)


class _RunningJob(Generic[T]):
    def __init__(self, job: Job[T]) -> None:
        self.job, self.result = job, Future[T]()
        self.wait = Wait(lambda: True, 0.0)
        self.until_us = 0
        self.is_begun = False


class MemberThread:
    """A command centre in a federation, from `start` to `close`. Jobs are posted from any thread.

    Args:
        ports: clock and wire; its mailbox is not used.
        make_centre: given the identity of the session and the time.
        federation: its name.
        extensions: modules that bring further tasks and semantic labels.
        ontology: file of semantic labels.

    Raises:
        SessionFailed: the session does not open.
    """

    def __init__(
        self,
        ports: ClientPorts,
        make_centre: Callable[[str, int], CommandCentre],
        federation: str,
        extensions: tuple[str, ...] = (),
        ontology: Path | None = None,
    ) -> None:
        self._mailbox: SimpleQueue[Any] = SimpleQueue()
        self._jobs: list[_RunningJob[Any]] = []
        self._is_open = True
        self.client = Client(ports._replace(mailbox=self._mailbox), make_centre, federation, extensions, ontology)
        self._thread = threading.Thread(target=self._run, name=f"dyknow {self.client.centre.unit}", daemon=True)
        self._thread.start()

    def post(self, job: Job[T]) -> "Future[T]":
        """Have a job done; its result, or its error.

        Raises:
            SessionFailed: the connection is closed.
        """
        if not self._is_open:
            raise SessionFailed("the connection is closed; open another one with dyknow.connect")
        running = _RunningJob(job)
        self._mailbox.put(running)
        return running.result

    def close(self) -> None:
        """End the jobs and leave the federation."""
        if self._is_open:
            self._is_open = False
            self._mailbox.put(None)
            self._thread.join(_CLOSE_S)

    def _run(self) -> None:
        try:
            with self.client:
                while self._step():
                    self._advance()
                self._end(SessionFailed("the connection was closed"))
        except Exception as error:  # noqa: BLE001  (who waits for a result must learn of it)
            self._is_open = False
            self._end(error)

    def _step(self) -> bool:
        """Take the next thing of the mailbox, or let time pass; whether to continue."""
        try:
            item = self._mailbox.get(timeout=min(self.client.due_s, self._due_s()))
        except Empty:
            pass
        else:
            if item is None:
                return False
            if isinstance(item, _RunningJob):
                self._jobs.append(item)
            else:
                self.client.take(item)
        self.client.pass_time()
        return True

    def _due_s(self) -> float:
        now_us = self.client.now_us()
        return min([max(0, running.until_us - now_us) / 1e6 for running in self._jobs], default=1.0)

    def _advance(self) -> None:
        for running in self._jobs[:]:
            while running in self._jobs and (
                (holds := running.wait.condition()) or self.client.now_us() >= running.until_us
            ):
                self._resume(running, holds=holds)

    def _resume(self, running: _RunningJob[Any], *, holds: bool) -> None:
        if not (running.is_begun or running.result.set_running_or_notify_cancel()):
            self._jobs.remove(running)
            return
        try:
            running.wait = running.job.send(holds) if running.is_begun else next(running.job)
        except StopIteration as done:
            self._jobs.remove(running)
            running.result.set_result(done.value)
        except Exception as error:  # noqa: BLE001  (it is the caller's)
            self._jobs.remove(running)
            running.result.set_exception(error)
        else:
            running.is_begun = True
            running.until_us = self.client.now_us() + round(running.wait.within_s * 1e6)

    def _end(self, error: Exception) -> None:
        for running in self._jobs:
            with suppress(Exception):  # the wire may be closed already
                running.job.close()
            if not running.result.cancelled():
                running.result.set_exception(error)
        self._jobs.clear()
