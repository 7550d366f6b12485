"""`dyknow replay`: a recorded federation, back again: its platforms, their streams and their alarms, at their times."""

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from dyknow.agents.capabilities.flight.options import AvoidanceOptions
from dyknow.console.arguments import Speed
from dyknow.console.command import Call, command
from dyknow.console.commands.fleet.join import fits_in
from dyknow.console.commands.fleet.up import READY_S, FleetStart
from dyknow.console.commands.recordings.info import Recording, tell_unread
from dyknow.console.errors import DONE, INTERRUPTED
from dyknow.console.output.output import counted, unit_json
from dyknow.console.output.shown import line, styled
from dyknow.console.processes.launch import platform_config
from dyknow.console.processes.supervision import Fleet, interruptible, outlasting, uninterrupted
from dyknow.documents.durations import duration_us
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.members.directory import unit_order
from dyknow.model.errors import FederationFailed, NothingFound, WrongCall
from dyknow.model.instants import print_span
from dyknow.runtime.configuration.config import ClockConfig, NodeConfig, RecordedVehicle
from dyknow.runtime.configuration.instants import clock_time
from dyknow.runtime.configuration.run_directory import JOINED, ProcessState, run_directory, this_process, write_state
from dyknow.runtime.configuration.settings import UnitFile
from dyknow.runtime.recordings.playback import shift_us
from dyknow.runtime.recordings.recorded import FederationRecording
from dyknow.runtime.recordings.summary import RecordingSummary, summary_of

MOST_UNITS = 64
_LEAD_US = 3_000_000
_LEAD_PER_UNIT_US = 200_000
_POLL_S = 0.1


@command(example="dyknow replay flight.mcap --speed 10 --from 2min")
def replay(
    call: Call,
    file: Recording,
    *,
    speed: Speed = 1.0,
    from_: Annotated[
        str, typer.Option("--from", metavar="TIME", help="Where in the recording to begin, after its first message.")
    ] = "0s",
    alarms: Annotated[
        bool, typer.Option("--alarms/--no-alarms", help="Whether the recorded alarms are raised again.")
    ] = True,
    stay: Annotated[bool, typer.Option("--stay", help="The platforms stay when all is played, until Ctrl-C.")] = False,
) -> int:
    """Bring a recorded federation back: platforms of the same names, with their streams and alarms."""
    from_us = duration_us(from_, option="--from")
    found = summary_of(FederationRecording(file))
    tell_unread(call, found.unread)
    units = _units(file, found)
    if from_us > found.last_us - found.first_us:
        raise WrongCall(f"--from: {file} is {print_span(found.last_us - found.first_us)} long; begin before that.")
    clock, begin_us = _beginning(speed or 1.0, len(units))
    recorded = RecordedVehicle(
        file=file.resolve(), first_us=found.first_us, from_us=from_us, begin_us=begin_us, alarms=alarms, stays=stay
    )
    own = UnitFile().having(AvoidanceOptions(avoidance=False))
    configs = [platform_config(call, unit, _of_unit(recorded, unit, found), clock, own) for unit in units]
    fits_in(call, configs)
    return _run(call, configs, found, recorded)


def _units(file: Path, found: RecordingSummary) -> list[str]:
    """The platforms of the recording that have a stream or an alarm."""
    units = {unit for unit, _ in found.streams} | {by for _, by, _ in found.alarms}
    if not units:
        raise NothingFound(f"{file} has no stream and no alarm of any platform.")
    if len(units) > MOST_UNITS:
        raise WrongCall(f"{file} has {len(units)} platforms; {MOST_UNITS} are played at most.")
    return sorted(units, key=unit_order)


def _of_unit(recorded: RecordedVehicle, unit: str, found: RecordingSummary) -> RecordedVehicle:
    return recorded.model_copy(update={"labels": tuple(label for of, label in found.streams if of == unit)})


def _beginning(speed: float, units: int) -> tuple[ClockConfig, int]:
    """The federation's clock, and when playing begins by it: as soon as all platforms can be expected to be there."""
    now_us = time.time_ns() // 1000
    clock = FederationClock(now_us, speed)
    begin_us = clock.federation_us(now_us + _LEAD_US + _LEAD_PER_UNIT_US * units)
    return ClockConfig(epoch_us=None if speed == 1.0 else now_us, speed=speed), begin_us


def _run(call: Call, configs: list[NodeConfig], found: RecordingSummary, recorded: RecordedVehicle) -> int:
    """Run the platforms, in one process, until all is played or they are interrupted."""
    units = [config.unit for config in configs]
    fleet = Fleet(run_directory(call.settings.federation), lifeline=True)
    gathering = FleetStart(units)
    noted: Path | None = None
    with interruptible():
        try:
            fleet.start_together({config.unit: config.model_dump_json() for config in configs})
            running = (*fleet.running.values(), this_process())
            noted = write_state(fleet.directory / JOINED, ProcessState(running), f"{units[0]}.json")
            with call.out.waiting(f"platforms {', '.join(units)} are looking for each other"):
                if not fleet.follow(gathering.all_found, gathering.on_heard, READY_S):
                    raise FederationFailed(
                        f"the platforms were not there in {READY_S:.0f} s.\n{fleet.last_words(units[0])}"
                    )
            outlasting(call.out)
            _say_begun(call, units, found, recorded)
            code = _until_played(call, fleet)
        except KeyboardInterrupt:
            return INTERRUPTED
        finally:
            with uninterrupted():
                fleet.end()
                if noted is not None:
                    noted.unlink(missing_ok=True)
    if code:
        raise FederationFailed(f"the platforms ended with code {code}.\n{fleet.last_words(units[0])}")
    call.out.say(line(styled("played", "green"), f": {recorded.file.name}"), event="played", file=str(recorded.file))
    return DONE


def _say_begun(call: Call, units: list[str], found: RecordingSummary, recorded: RecordedVehicle) -> None:
    moved_us = shift_us(found.first_us, recorded.from_us, recorded.begin_us)
    first_us, lasts_us = found.first_us + recorded.from_us, found.last_us - found.first_us - recorded.from_us
    call.out.say(
        line(
            styled("playing", "green"),
            f": {recorded.file.name} from {clock_time(first_us)}, {print_span(lasts_us)} of platforms {', '.join(units)}; "
            f"what was then is at {clock_time(first_us + moved_us)} now; Ctrl-C ends it",
        ),
        event="playing",
        file=str(recorded.file),
        units=[unit_json(unit) for unit in units],
        from_us=first_us,
        to_us=found.last_us,
        shift_us=moved_us,
        not_set_up={"tasks": len(found.tasks), "monitors": len(found.monitors)},
    )
    if found.tasks or found.monitors:
        call.out.note(
            f"{counted(len(found.tasks), 'task')} and {counted(len(found.monitors), 'monitor')} of the recording are not set up "
            "again: their alarms and the speech acts are played, marked as recorded; dyknow info lists them."
        )


def _until_played(call: Call, fleet: Fleet) -> int:
    """Show the notes of the platforms until they end; the exit code."""
    told: set[str] = set()
    while True:
        ended = fleet.ended()
        for unit, said in fleet.heard():
            _tell_note(call, unit, said, told)
        if ended:
            return max(ended.values())
        time.sleep(_POLL_S)


def _tell_note(call: Call, unit: str, said: dict[str, Any], told: set[str]) -> None:
    text = str(said.get("text", ""))
    if said.get("event") == "note" and text not in told:
        told.add(text)
        call.out.note(f"platform {unit}: {text}", style="dim")
