"""A process of its own for one side of a measurement: an object here whose methods are called there.

with Worker("bench.wire.raw:Receiver", {"federation": "b01"}) as receiver:
    receiver.call("ready")
    receiver.begin("collect", count=1000)
    ...
    figures = receiver.end()
"""

import json
import subprocess
import sys
from importlib import import_module
from types import TracebackType
from typing import Any, Self

_PATIENCE_S = 10.0


class WorkerFailed(Exception):
    """The process ended, or its method raised."""


class Worker:
    def __init__(self, what: str, arguments: dict[str, Any]) -> None:
        self.what = what
        self.process = subprocess.Popen(
            [sys.executable, "-m", "bench.workers", what, json.dumps(arguments)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        try:
            self.process.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def begin(self, method: str, **arguments: Any) -> None:
        """Call without waiting for the result, which `end` gives."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps([method, arguments]) + "\n")
        self.process.stdin.flush()

    def end(self) -> Any:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise WorkerFailed(f"{self.what} ended with {self.process.wait()}")
        ok, result = json.loads(line)
        if not ok:
            raise WorkerFailed(f"{self.what}: {result}")
        return result

    def call(self, method: str, **arguments: Any) -> Any:
        self.begin(method, **arguments)
        return self.end()


def serve(what: str, arguments: dict[str, Any]) -> None:
    """Build the object and call what the lines of standard input say; ends with them. It may have a `close`."""
    module, _, name = what.partition(":")
    served = getattr(import_module(module), name)(**arguments)
    for line in sys.stdin:
        method, given = json.loads(line)
        try:
            answer = [True, getattr(served, method)(**given)]
        except Exception as failed:  # noqa: BLE001  the caller's process raises it
            answer = [False, repr(failed)]
        print(json.dumps(answer), flush=True)
    if hasattr(served, "close"):
        served.close()


if __name__ == "__main__":
    serve(sys.argv[1], json.loads(sys.argv[2]))
