"""The platforms of a federation that run on this machine already, so that `dyknow up` starts the missing ones."""

from collections.abc import Sequence
from pathlib import Path

from dyknow.console.processes.supervision import Fleet
from dyknow.runtime.configuration import run_directory
from dyknow.runtime.configuration.config import NodeConfig
from dyknow.runtime.configuration.local_endpoints import noted_local
from dyknow.runtime.configuration.run_directory import ProcessState, Running


def running_units(directory: Path) -> set[str]:
    """The platforms that `up` and `join` started here and that still run."""
    noted = (run_directory.read_state(directory), *run_directory.joined_states(directory).values())
    return {found.unit for state in noted for found in state.running if found.unit and found.process() is not None}


def started_units(directory: Path) -> list[str]:
    """Those of them that `up` started."""
    return [found.unit for found in run_directory.read_state(directory).running if found.unit]


def missing(directory: Path, configs: Sequence[NodeConfig]) -> list[NodeConfig]:
    """Those of these platforms that do not run here, as they join what runs: its clock, and its endpoints.

    A platform that was started here before, and has died, is started with its old configuration, whatever the options
    are now.
    """
    running = running_units(directory)
    absent = [config for config in configs if config.unit not in running]
    if not running:
        return absent
    noted = run_directory.noted_state(directory)
    before = {found.unit for found in noted.running}
    clock = next((found.clock for unit in sorted(running) if (found := _noted_config(directory, unit))), None)
    return [
        (config.unit in before and _noted_config(directory, config.unit))
        or _joining(config, clock, noted.dialled(noted.endpoints))
        for config in absent
    ]


def _noted_config(directory: Path, unit: str) -> NodeConfig | None:
    try:
        return NodeConfig.model_validate_json((directory / "units" / f"{unit}.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def _joining(config: NodeConfig, clock: object, endpoints: tuple[str, ...]) -> NodeConfig:
    """A newcomer to what runs; without multicast it dials the endpoints that are there."""
    wire = config.wire
    if endpoints and wire.listen:
        wire = wire.model_copy(update={"connect": endpoints})
    return config.model_copy(update={"wire": wire} if clock is None else {"wire": wire, "clock": clock})


def note_state(fleet: Fleet, configs: Sequence[NodeConfig], *, stays: bool) -> None:
    """Note for other commands which processes run and where, those that ran before included.

    A supervisor that `stays` is ended first.
    """
    before = run_directory.noted_state(fleet.directory)
    if not any(found.unit and found.process() is not None for found in before.running):
        before = ProcessState()
    kept = [found for found in before.running if not found.unit or found.unit not in fleet.running]
    own: list[Running] = [*fleet.running.values()]
    if stays:
        own.append(run_directory.this_process())
    listen = [endpoint for config in configs for endpoint in config.wire.listen]
    endpoints = dict.fromkeys([*before.endpoints, *listen])
    local = dict((*before.local, *noted_local(config.wire for config in configs)))
    run_directory.write_state(fleet.directory, ProcessState((*kept, *own), tuple(endpoints), tuple(local.items())))


def forget(fleet: Fleet) -> None:
    """Its processes have ended: those of others stay noted."""
    state = run_directory.read_state(fleet.directory)
    mine = {*fleet.running.values(), run_directory.this_process()}
    others = tuple(found for found in state.running if found not in mine)
    if any(found.unit for found in others):
        run_directory.write_state(fleet.directory, ProcessState(others, state.endpoints, state.local))
    else:
        (fleet.directory / run_directory.STATE_FILE).unlink(missing_ok=True)
