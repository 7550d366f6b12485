"""`dyknow.connect`: ask a federation, watch its streams and alarms, and delegate tasks to its platforms."""

import asyncio
import os
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dyknow.federation.members.command_centre import PlatformView
from dyknow.federation.messages.contents import ActLog, MonitorEntry, TaskEntry
from dyknow.runtime.client import client_ports, command_centre
from dyknow.runtime.configuration.reach import client_wire, speaks_as
from dyknow.runtime.library import jobs, listings
from dyknow.runtime.library.async_federation import AsyncFederationClient
from dyknow.runtime.library.calls import CallItem
from dyknow.runtime.library.connection_face import ConnectionFace, DelegatedTask, Time, name_of
from dyknow.runtime.library.feed import Feed
from dyknow.runtime.library.member_thread import MemberThread, settings_of
from dyknow.runtime.library.missions import AbortedMission, abort_mission, mission_of
from dyknow.runtime.library.pictures.saliency import FoundPerson, saliency_map
from dyknow.runtime.library.questions import Which
from dyknow.runtime.library.results import QueryResult, UnitSample

if TYPE_CHECKING:
    from dyknow.runtime.library.pictures.bands import BandsPicture  # numpy takes a tenth of a second

_CONNECTIONS = count()


def connect(
    federation: str | Path = "",
    *,
    listen: str | tuple[str, ...] | None = None,
    connect: str | tuple[str, ...] | None = None,
    interface: str | None = None,
    roster: str | Path | None = None,
    key: str | Path | None = None,
    extensions: str | tuple[str, ...] | None = None,
    ontology: str | Path | None = None,
) -> "Connection":
    """A connection to a federation, to be entered by `with ... as fed`, or by `async with ... as fed`.

    Args:
        federation: its name, or the path of its TOML file; empty: DYKNOW_FEDERATION, or `default`.
        listen: Zenoh endpoints to listen on, e.g. `tcp/127.0.0.1:7447`.
        connect: Zenoh endpoints to connect to; no multicast then.
        interface: network interface of multicast; `lo` (nothing leaves the machine) unless set.
        roster: file with the public keys of all members, if the federation has one.
        key: file with the private key; `keys/cc.key` in the roster's folder (`roster.d`) unless set.
        extensions: modules that bring further tasks and semantic labels.
        ontology: file of semantic labels that not every platform has; without it their meaning is learned.

    Other options are taken from `DYKNOW_*` variables and the federation's file, as `dyknow` does.

    Raises:
        WrongCall: on entering: an option that is not right.
        RosterError: on entering: the roster or the key does not load.
        SessionFailed: on entering: the session does not open.
        UnitError: when it is first needed: an extension does not load.
    """
    options = {
        "listen": listen, "connect": connect, "interface": interface, "roster": roster, "extensions": extensions,
        "ontology": ontology,
    }  # fmt: skip
    return Connection(federation, options, None if key is None else Path(key))


class Connection:
    """A connection to be entered: `with` gives a `FederationClient`, `async with` an `AsyncFederationClient`."""

    def __init__(self, federation: str | Path, options: dict[str, Any], key: Path | None) -> None:
        self._federation, self._options, self._key = federation, options, key
        self._thread: MemberThread | None = None

    def open(self) -> "FederationClient":
        """The same for a notebook, where no block ends: `fed = dyknow.connect().open()`; `fed.close()` ends it."""
        return FederationClient(self._open())

    def _open(self) -> MemberThread:
        settings = settings_of(self._federation, **self._options)
        speaker = speaks_as(settings, self._key)
        number = next(_CONNECTIONS)
        unit = speaker.named(f"{number}{os.getpid():08}" if number else os.getpid())
        wire, named = client_ports(client_wire(settings, speaker.unit)), settings.federation
        centre = command_centre(settings, unit, self._key)
        self._thread = MemberThread(wire, centre, named, settings.extensions, settings.ontology)
        return self._thread

    def _close(self) -> None:
        if self._thread is not None:
            self._thread.close()

    def __enter__(self) -> "FederationClient":
        return FederationClient(self._open())

    def __exit__(self, *_raised: object) -> None:
        self._close()

    async def __aenter__(self) -> "AsyncFederationClient":
        return AsyncFederationClient(await asyncio.to_thread(self._open))

    async def __aexit__(self, *_raised: object) -> None:
        await asyncio.to_thread(self._close)


class FederationClient(ConnectionFace):
    """A federation, for a program that waits for its answers. `with dyknow.connect() as fed` gives one.

    Platforms are named by text (`"0"`) or number, labels and times by text as on the command line.
    """

    def query(
        self,
        label: str,
        *,
        unit: str | int | None = None,
        at: Time | None = None,
        between: tuple[Time, Time] | None = None,
        last: int | None = None,
        nth: int | None = None,
        slice: tuple[int, int] | None = None,  # noqa: A002  (as the option of the command)
        within: str = "2s",
    ) -> QueryResult:
        """The newest sample of a label of each platform, its value at an instant, all between two, or by number.

        Args:
            label: a semantic label, e.g. `heli-position`.
            unit: one platform; None: all.
            at: an instant of federation time.
            between: two instants, both included.
            last: the number of samples that came last.
            nth: the n-th sample before the one that came last; 0: that one.
            slice: numbers of the first and last sample, both included; the oldest that a platform holds is number 0.
            within: how long to wait for answers.

        Returns:
            The samples; its `.missing` says of each platform that is not among them why.

        Raises:
            NothingFound: no platform is there, or none has such a label.
            WrongCall: an argument that is not right.
            NameRefused: a text that cannot be a label.
        """
        return self._do(self._query(label, unit, Which(at, between, last, nth, slice), within))

    def watch(
        self, label: str, *, unit: str | int | None = None, every: str = "200ms", max_delay: str = "1s"
    ) -> Feed[UnitSample]:
        """Samples of a label as they come, until the feed or the connection is closed.

        Args:
            label: a semantic label.
            unit: one platform; None: all of them.
            every: the period; samples are valid at its multiples.
            max_delay: a sample later than this after its valid time is dropped.

        Raises:
            NothingFound: no platform is there, or none has such a label.
            Refused: the platform does not export it.
            WrongCall: an argument that is not right.
        """
        return self._do(self._watch(label, unit, every, max_delay))

    def call(
        self, label: str, *, every: str = "200ms", max_delay: str = "1s", min_certainty: float = 0.0
    ) -> Feed[CallItem]:
        """Samples of a label that platforms offer at a cost: of the cheapest that is good enough, and then of the next.

        Among the samples is what happens in the call: a `CallNews` with `.event` (`called`, `proposed`, `refused`, `taken`,
        `failed`, or `open` while no platform has a proposal that would do), `.unit` and `.text`.

        Args:
            label: a semantic label that is offered (`offer` in KPL).
            every: the period.
            max_delay: how old a sample may be when it comes.
            min_certainty: how sure each sample must be, at least; between 0 and 1.

        Raises:
            NothingFound: no platform is there.
            WrongCall, NameRefused: an argument that is not right.
        """
        return self._do(self._call(label, every, max_delay, min_certainty))

    def delegate(
        self,
        task: str,
        *,
        to: str | int | None = None,
        within: str = "3s",
        when: tuple[str, str] | None = None,
        **content: Any,
    ) -> DelegatedTask:
        """Ask a platform for a task, as `dyknow delegate` does; returns once it is agreed to.

        Args:
            task: `monitor-proximity`, `goto`, `hold`, `land`, `check-formula`, ...
            to: the platform; may be left out where any will do, or only one is there.
            within: how long to wait for an answer.
            when: a formula and a time, `("gas[self] > 40", "10min")`: do it once that is true, if it is in this time.
            content: the task's parameters, e.g. `profile="proximity"`, `sample_period="1s"`.

        Raises:
            Refused: the platform declines; `.code` says why, for programs.
            WrongCall: an unknown task or key, or a value that does not fit.
            NothingFound: the platform is not there.
            FederationFailed: no answer came, or the task failed.
        """
        return DelegatedTask(self, *self._do(self._delegate(task, to, content, within, when)))

    def mission(self, domain: str, problem: str, *, to: str | int | None = None, **given: Any) -> DelegatedTask:
        """Have platforms reach the goals of a problem, as `dyknow mission start` does; texts, and fields of `MissionRequest`."""
        return DelegatedTask(self, *self._do(self._begun(mission_of(self._client, domain, problem, to, given))))

    def abort_mission(self, name: str | None = None) -> AbortedMission:
        """End a mission at each platform, as `dyknow mission abort` does; `.unsure` says where it may continue, and why.

        Raises:
            NothingFound: there is none of that name.
            WrongCall: several run, and none is named.
        """
        return self._do(abort_mission(self._client, name))

    def saliency(self, unit: str | int | None = None) -> list[FoundPerson]:
        """The persons that platforms have found, on the map of one platform or of all; `.name`, `.x_m`, `.y_m`, `.by`, ..."""
        return list(self._do(saliency_map(self._client, name_of(unit))).persons)

    def bands(self, unit: str | int, *, profile: str = "well-clear", lookahead_s: float = 30.0) -> "BandsPicture":
        """When a vehicle loses well clear, as `dyknow bands` has it: `.others`, `.tracks`, `.speeds`, `.altitudes`, `.why`.

        Raises:
            NothingFound: no platform is there, or not this one.
            WrongCall: the profile has no thresholds of well clear.
        """
        return self._do(self._bands(unit, profile, lookahead_s))

    def monitors(self, *, explain: bool = False) -> list[MonitorEntry]:
        """The monitors of all platforms: `.by`, `.name`, `.units`, `.verdict`, `.inputs`, `.shows`, `.since_us`.

        With `explain`, those in alarm say in `.because` which parts of their formulas do not hold, by which samples.

        Raises:
            NothingFound: no platform is there.
        """
        return self._do(jobs.monitors(self._client, explain=explain))

    def ls(self) -> list[PlatformView]:
        """The platforms: `.unit`, `.state` (`alive`, `suspect`, `gone`, `refused`), `.labels`, `.services`.

        A platform that is gone without a good-bye stays, with `.gone_us` (when it was last heard), until it returns.
        """
        return self._do(jobs.all_platforms(self._client))

    def tasks(self) -> list[TaskEntry]:
        """The delegated tasks of all platforms: `.conversation`, `.task`, `.unit`, `.state`, `.delegator`, `.since_us`.

        One with `.ended_by` is over: that platform ended it without a request of its delegator.

        Raises:
            NothingFound: no platform is there.
        """
        return self._do(listings.tasks(self._client))

    def cancel(self, conversation: str) -> None:
        """End a task, by its conversation or the beginning of it, and all that it set up.

        Raises:
            NothingFound: no platform has it.
            WrongCall: several begin so.
            Refused: another member delegated it.
            FederationFailed: it is over already, or the platform does not answer.
        """
        self._do(listings.cancel(self._client, conversation))

    def objects(self, type: str | None = None, *, unit: str | int | None = None) -> list[listings.ListedObject]:  # noqa: A002
        """The objects that platforms see: `.by`, `.symbol`, `.type`, `.stream`, `.valid_us`, `.attributes`.

        Args:
            type: of one type, or of one stream, only.
            unit: of one platform only.

        Raises:
            NothingFound: no platform is there, or not that one.
        """
        return self._do(listings.objects(self._client, name_of(unit), type))

    def acts(self, unit: str | int | None = None) -> list[ActLog]:
        """The speech acts that platforms remember, by time: `.at_us`, `.direction`, `.peer`, `.outcome`, `.act` (its text).

        Raises:
            NothingFound: no platform is there, or not that one.
        """
        return self._do(listings.acts(self._client, name_of(unit)))

    def close(self) -> None:
        """End the connection; delegated tasks continue."""
        self._thread.close()
