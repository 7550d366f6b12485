"""The command `dyknow`. A command is registered in `COMMANDS` and declared on its function, imported when it is called."""

import contextlib
import os
import sys
from collections.abc import Sequence
from typing import Annotated, Any

import typer

from dyknow.console.command import USAGE, CommandGroup, CommandTable

_FLEET, _MEMBERS, _MISSIONS, _OBJECTS, _OUTWARD, _RECORDINGS, _TEXTS = (
    f"dyknow.console.commands.{each}"
    for each in ("fleet", "members", "missions", "objects", "outward", "recordings", "texts")
)

COMMANDS: CommandTable = {
    "up": (f"{_FLEET}.up:up", "Start simulated UAVs, one process each, and wait until they have found each other."),
    "join": (
        f"{_FLEET}.join:join",
        "One platform on any MAVLink vehicle, a recorded flight, or a specification alone.",
    ),
    "host": (f"{_FLEET}.host:host", "Offer sources and units to a platform from a process of their own."),
    "down": (f"{_FLEET}.up:down", "End the platforms that up and join started on this machine."),
    "ls": (f"{_MEMBERS}.ls:ls", "The platforms, a line each: state, battery, altitude, age of the oldest data."),
    "top": (
        "dyknow.console.top.top:top",
        "Platforms, streams, monitors, alarms and acts in the terminal, kept up to date.",
    ),
    "web": (
        f"{_OUTWARD}.web:web",
        "The operator's page in a browser: map, alarms, monitors, tasks, speech acts, streams; of now or a recording.",
    ),
    "query": (f"{_MEMBERS}.query:query", "The latest value of a label, its value at a time, or all between two times."),
    "watch": (f"{_MEMBERS}.watch:watch", "A federated stream under a policy, sample by sample."),
    "call": (f"{_MEMBERS}.call:call", "A stream that platforms offer at a cost, of the cheapest that is good enough."),
    "bands": (
        f"{_MEMBERS}.bands:bands",
        "When a vehicle loses well clear of others, and the tracks, speeds and altitudes that would.",
    ),
    "hz": (f"{_MEMBERS}.hz:hz", "Rate, loss and latency of a label, platform by platform."),
    "imports": (f"{_MEMBERS}.imports:imports", "The streams that platforms receive from each other, and their gaps."),
    "check": (f"{_TEXTS}.check:check", "A formula over a recorded trace, or over a platform's live states."),
    "chronicle": (f"{_TEXTS}.chronicle:chronicle", "Chronicles in recorded events, or over a platform's live streams."),
    "link": (f"{_OBJECTS}.link:link", "Which percepts of a recording are the same objects, through gaps and clutter."),
    "world": (
        f"{_OBJECTS}.world:world",
        "Existing objects, their types and places, with degrees of belief, from recorded observations.",
    ),
    "match": (f"{_OBJECTS}.match:match", "Which percepts match a description: the anchoring case, and the recovery."),
    "objects": (f"{_OBJECTS}.objects:objects", "The objects that platforms see, each with its newest state."),
    "saliency": (f"{_OBJECTS}.saliency:saliency", "The persons that platforms have found, on one map."),
    "explain": (
        f"{_OBJECTS}.events:explain",
        "Why an object has its symbol: its links, and the conditions that made and ended them.",
    ),
    "events": (f"{_OBJECTS}.events:events", "The events of objects: links made and ended, recognised chronicles."),
    "delegate": (f"{_MEMBERS}.delegate:delegate", "A task for a platform, as a speech act to its interface agent."),
    "tasks": (f"{_MEMBERS}.delegate:tasks", "Delegated tasks of all platforms."),
    "cancel": (f"{_MEMBERS}.delegate:cancel", "End a task, and take down all it set up."),
    "alarms": (f"{_MEMBERS}.alarms:alarms", "Alarms raised by monitors of all platforms."),
    "monitors": (f"{_MEMBERS}.monitors:monitors", "All monitors, their states, and whether their inputs are fresh."),
    "acts": (
        f"{_MEMBERS}.acts:acts",
        "The message log: speech acts of the interface agents, and the outcome of each.",
    ),
    "record": (f"{_RECORDINGS}.record:record", "Record the federation as an MCAP file that Foxglove opens."),
    "replay": (
        f"{_RECORDINGS}.replay:replay",
        "Bring a recorded federation back, at any speed: its platforms, their streams and alarms.",
    ),
    "info": (f"{_RECORDINGS}.info:info", "The contents of a recording: platforms, streams, gaps, alarms, acts."),
    "plot": (f"{_RECORDINGS}.plot:plot", "Values of streams over time as a picture, from platforms or a recording."),
    "foxglove": (f"{_OUTWARD}.foxglove:foxglove", "Serve the federation to Foxglove, live, on this machine."),
    "cot": (f"{_OUTWARD}.cot:cot", "Send Cursor on Target events about platforms, objects and alarms."),
    "remote-id": (f"{_OUTWARD}.remote_id:remote_id", "Send Remote ID messages about platforms."),
    "fault": (f"{_MEMBERS}.delegate:fault", "A fault in a simulated UAV."),
    "demo": (f"{_FLEET}.demo:demo", "The main job end to end, in under a minute; exit 0 only if every step happened."),
    "doctor": (f"{_FLEET}.doctor:doctor", "Missing dependencies of this machine, and how to get them."),
    "plan": (f"{_TEXTS}.plan:plan", "A plan for a problem of a domain, with times; or the reason why there is none."),
    "recover": (f"{_OBJECTS}.recover:recover", "A plan that looks again from elsewhere until an object is identified."),
    "mission": ("", "Goals that platforms reach together, by plans that are flown and watched."),
    "mission start": (f"{_MISSIONS}.mission:start", "Have platforms reach the goals of a problem."),
    "mission status": (
        f"{_MISSIONS}.mission:status",
        "The missions that platforms lead, how far each is, and its question.",
    ),
    "mission answer": (f"{_MISSIONS}.mission:answer", "The answer to the question of a mission."),
    "mission suspend": (f"{_MISSIONS}.mission:suspend", "Have a mission wait."),
    "mission resume": (f"{_MISSIONS}.mission:resume", "Have a mission continue that was suspended."),
    "mission abort": (f"{_MISSIONS}.mission:abort", "End a mission: its vehicles hold."),
    "kpl": ("", "Specifications of knowledge processing, in KPL."),
    "kpl check": (f"{_TEXTS}.specifications:check", "Every error of a specification with its place and repair."),
    "kpl show": (f"{_TEXTS}.specifications:show", "A specification as it is understood, one declaration a line."),
    "kpl run": (
        f"{_TEXTS}.specification_runs:run",
        "Run a specification in an instance of its own; show its streams and alarms.",
    ),
    "kpl graph": (f"{_TEXTS}.specifications:graph", "The network of a specification, or of a running platform."),
    "kpl add": (f"{_TEXTS}.specification_changes:add", "Have running platforms declare more."),
    "kpl remove": (f"{_TEXTS}.specification_changes:remove", "Have running platforms declare something no more."),
    "kpl load": (f"{_TEXTS}.specification_changes:load", "Have running platforms hold another specification."),
    "kpl verify": (f"{_TEXTS}.verification:verify", "Whether a recorded run satisfies its specification."),
    "ontology": ("", "Semantic labels: their meanings, in a file or to the platforms that run."),
    "ontology show": (f"{_TEXTS}.ontologies:show", "The meaning of each semantic label, by platform."),
    "ontology check": (f"{_TEXTS}.ontologies:check", "Every error of a file of labels with its place and repair."),
    "roads": ("", "Road networks, on which objects are."),
    "roads check": (f"{_OBJECTS}.roads:check", "The contents of a road network, and every problem of its file."),
    "roster": ("", "The file of platforms and keys with which acts are signed."),
    "roster init": (f"{_FLEET}.roster:init", "A new roster, with keys and certificates."),
    "roster add": (f"{_FLEET}.roster:add", "One more platform, with a new key and certificate."),
    "roster revoke": (f"{_FLEET}.roster:revoke", "Mark a platform as no longer trusted."),
    "roster show": (f"{_FLEET}.roster:show", "The members of a roster."),
}
"""Every command: its name, `module:function`, and one sentence for the list in the help."""


class _Dyknow(CommandGroup):
    """The command itself, with all of them."""

    def __init__(self, **options: Any) -> None:
        super().__init__(table=COMMANDS, **options)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The called command; an unknown one may be an extension's."""
        if args[0] not in self.table:
            self._extend(ctx, args)
        return super().resolve_command(ctx, args)

    def list_commands(self, ctx: Any) -> list[str]:
        """The commands in the help: extensions that a variable names have theirs there, too."""
        if os.environ.get("DYKNOW_EXTENSIONS"):
            self._extend(ctx, ())
        return super().list_commands(ctx)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Options of commands stand after the command."""
        try:
            return super().parse_args(ctx, args)
        except USAGE as error:
            if name := getattr(error, "option_name", None):
                error.message = f"No such option: {name}. Options stand after the command, as in: dyknow ls --json"
            raise

    def _extend(self, ctx: Any, args: Sequence[str]) -> None:
        from dyknow.console.extensions import extension_commands
        from dyknow.model.errors import DyknowError

        try:
            self.register(extension_commands(args))
        except DyknowError as error:
            ctx.fail(str(error))


app = typer.Typer(
    name="dyknow",
    cls=_Dyknow,
    epilog="Begin with: [cyan]dyknow demo[/cyan], then [cyan]dyknow up --detach[/cyan] and [cyan]dyknow ls[/cyan].",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(*, is_asked: bool) -> None:
    if is_asked:
        import dyknow

        typer.echo(f"dyknow {dyknow.__version__}")
        raise typer.Exit


@app.callback()
def _root(
    *,
    version: Annotated[
        bool, typer.Option("--version", callback=lambda asked: _version(is_asked=asked), is_eager=True, help="Which.")
    ] = False,
) -> None:
    """Several UAVs that know, together, what is going on."""


def main() -> None:
    """The entry point."""
    try:
        app(prog_name="dyknow")
    finally:
        _end(sys.exception())


def _end(how: BaseException | None) -> None:
    """End the process at once if it was in a federation.

    Threads of Zenoh may still be closing links, and an interpreter that ends under them aborts the process, which
    would be the exit code of a command that has done its work.
    """
    if "zenoh" in sys.modules and isinstance(how, SystemExit) and isinstance(how.code, int | None):
        with contextlib.suppress(OSError, ValueError):
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(how.code or 0)
