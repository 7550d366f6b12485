"""`python -m dyknow.runtime.node --config FILE`: the process of one platform, or of several that share an endpoint.

The vehicle of a platform is of a kind in `dyknow.runtime.vehicles`, or in a module that is named with `--vehicles`.
"""

import argparse
import contextlib
import os
import signal
import stat
import sys
import threading
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from pydantic import ValidationError

from dyknow.model.errors import DyknowError, UnitError, WrongCall
from dyknow.runtime.configuration.config import NodeConfig
from dyknow.runtime.process import FAILED, WRONG, PlatformProcess
from dyknow.runtime.records import Records
from dyknow.runtime.vehicles import SharedPorts, Vehicle, VehiclePorts, build_vehicle


def main() -> int:
    """Read the configuration and run."""
    parser = argparse.ArgumentParser(prog="python -m dyknow.runtime.node", description=__doc__)
    parser.add_argument(
        "--config", action="append", type=Path, required=True, help="JSON file with the configuration of a platform"
    )
    parser.add_argument("--vehicles", action="append", default=[], help="module that registers kinds of vehicles")
    parser.add_argument("--records", type=Path, help="file for what happens, bounded; without it: standard output")
    chosen = parser.parse_args()
    configs = []
    for path in chosen.config:
        try:
            configs.append(NodeConfig.model_validate_json(path.read_bytes()))
        except (OSError, ValidationError) as wrong:
            parser.error(f"{path}: {wrong}")
    return serve(configs, partial(build_vehicle, modules=chosen.vehicles, shared=SharedPorts()), chosen.records)


def serve(
    configs: Sequence[NodeConfig], make_vehicle: Callable[[VehiclePorts], Vehicle], records: Path | None = None
) -> int:
    """Run platforms until a signal, their duration, or the end of the process that started them; the exit code.

    Each has its own mailbox and thread. A platform that fails ends the others: their supervisor sees it. Events go to
    the file `records`, or to standard output.
    """

    def on_failed(why: str) -> None:
        for process in processes:
            process.impair(why)

    say = Records(records, on_failed)
    try:
        processes = [PlatformProcess(config, make_vehicle, say) for config in configs]
    except DyknowError as wrong:
        return _failed(configs[0].unit, wrong)

    def stop() -> None:
        for process in processes:
            process.stop()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _number, _frame: stop())
    if stat.S_ISFIFO(os.fstat(0).st_mode):
        threading.Thread(target=_lifeline, args=(stop,), daemon=True).start()
    codes: list[int] = []

    def run(process: PlatformProcess) -> None:
        code = FAILED
        try:
            code = process.run()
        except DyknowError as wrong:
            code = _failed(process.config.unit, wrong)
        finally:
            codes.append(code)
            if code:
                stop()

    threads = [threading.Thread(target=run, args=(process,), name=process.config.unit) for process in processes[1:]]
    for thread in threads:
        thread.start()
    run(processes[0])
    for thread in threads:
        thread.join()
    return max(codes)


def _failed(unit: str, wrong: DyknowError) -> int:
    """Write what went wrong with a platform; the exit code."""
    with contextlib.suppress(OSError):
        sys.stderr.write(f"platform {unit}: {wrong}\n")
    return WRONG if isinstance(wrong, UnitError | WrongCall) else FAILED


def _lifeline(stop: Callable[[], None]) -> None:
    """Standard input ends when the process that started us does."""
    while os.read(0, 4096):
        pass
    stop()


if __name__ == "__main__":
    code = main()
    with contextlib.suppress(OSError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)  # threads of Zenoh may still be closing links: an interpreter that ended under them would abort
