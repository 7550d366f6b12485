"""Events and effects of a platform that are neither the wire's nor the vehicle's alone."""

from collections.abc import Mapping
from typing import Any, NamedTuple, TypeAlias

from dyknow import SURE, Quality
from dyknow.federation.transport import WireEffect, WireEvent
from dyknow.navigation.vehicle import Command, Report
from dyknow.network.process import Outcome, Work


class Reported(NamedTuple):
    """A report of the vehicle; it came to this node at `at_us`, and is available once the node takes it (node clock)."""

    at_us: int
    report: Report


class LeaveRequested(NamedTuple):
    """The operator of this platform wants it out of the federation."""

    at_us: int


class Specify(NamedTuple):
    """The operator of this platform gives it a specification, in place of the one it has.

    `named` has the files that it names: path and text.
    """

    at_us: int
    text: str
    file: str
    named: tuple[tuple[str, str], ...] = ()


class Fed(NamedTuple):
    """A source that is fed from outside has a sample; valid in federation time."""

    at_us: int
    source: str
    valid_us: int
    value: Any
    quality: Quality = SURE


class FedTogether(NamedTuple):
    """Samples of several sources at one instant: they become available at once, as one element of every join (4.3.16)."""

    at_us: int
    samples: tuple[Fed, ...]


class Waited(NamedTuple):
    """How long this process has waited for something to do, all in all; for the governor, if there is one."""

    at_us: int
    waited_us: int


class Pressed(NamedTuple):
    """How much of its time, 0 to 1, the node thread has waited for a processor; reported while that is much, and once when it no longer is."""

    at_us: int
    part: float


class HostCame(NamedTuple):
    """An operating system process of this machine has opened the local channel; `host` counts connections."""

    at_us: int
    host: int


class HostMessage(NamedTuple):
    """One message of a host; `TakeHost` says that the next may come."""

    at_us: int
    host: int
    payload: bytes


class HostLeft(NamedTuple):
    """The connection is over."""

    at_us: int
    host: int


class Computed(NamedTuple):
    """A worker has done what `Compute` asked for; it took so long (node clock)."""

    at_us: int
    number: int
    outcome: Outcome
    took_us: int


class SearchNews(NamedTuple):
    """A search for a plan that `RunSearch` began has looked at this number of nodes."""

    at_us: int
    number: int
    nodes: int


class SearchOver(NamedTuple):
    """Result of a search: a plan as by `MissionPlan.as_record`, or None and a reason; duration by the node clock."""

    at_us: int
    number: int
    plan: Mapping[str, Any] | None
    reason: str
    is_certain: bool
    nodes: int
    took_us: int


class Impaired(NamedTuple):
    """A component of this process no longer works, such as its journal; the platform continues without it."""

    at_us: int
    text: str


HostEvent: TypeAlias = HostCame | HostMessage | HostLeft
Event: TypeAlias = (
    WireEvent
    | Reported
    | LeaveRequested
    | Specify
    | Fed
    | FedTogether
    | Waited
    | Pressed
    | Computed
    | SearchNews
    | SearchOver
    | Impaired
    | HostEvent
)


class Compute(NamedTuple):
    """Call a computational unit next to the thread of the platform; `Computed` says what came of it."""

    number: int
    work: Work


class RunSearch(NamedTuple):
    """Search for a plan in a process of its own, at most for `limit_us`; `SearchNews` and `SearchOver` report on it.

    `units`: the units that may act; None: all. `looking`: a problem of looking instead, in the format of
    `planning/contingent/sent_problems.py`; `reading`: texts to be read instead, as of `agents/capabilities/missions/mission_texts.py`.
    """

    number: int
    domain: str
    problem: str
    units: tuple[str, ...] | None
    limit_us: int
    looking: Mapping[str, Any] | None = None
    reading: Mapping[str, Any] | None = None


class EndSearch(NamedTuple):
    """A search is no longer wanted; nothing more is heard of it."""

    number: int


class InjectFault(NamedTuple):
    """Make the simulated vehicle of this process fail; `until_us` (federation time) None: until it is taken back."""

    kind: str
    value: bool | int | float | str | None
    until_us: int | None


class Note(NamedTuple):
    """A text for users, which goes to the log."""

    at_us: int
    text: str


class Tell(NamedTuple):
    """Output of the platform's specification: samples of its streams, their producers, alarms."""

    record: Mapping[str, Any]


class EncounterMessage(NamedTuple):
    """One message of a record, as a recording has it (`dyknow.runtime.recordings.recording_file`); federation time."""

    topic: str
    schema: str
    message: Mapping[str, Any]
    at_us: int
    valid_us: int


class KeepEncounter(NamedTuple):
    """Keep the record of an encounter with a unit that began at `since_us` (federation time)."""

    other: str
    since_us: int
    messages: tuple[EncounterMessage, ...]


class Keep(NamedTuple):
    """Keep what a stream has learnt, so that it is known after a restart."""

    stream: str
    text: str


class TellHost(NamedTuple):
    """Messages for a host, in order."""

    host: int
    payloads: tuple[bytes, ...]


class TakeHost(NamedTuple):
    """A message of a host has been dealt with."""

    host: int


class DropHost(NamedTuple):
    """End the connection, when everything has been sent."""

    host: int


HostEffect: TypeAlias = TellHost | TakeHost | DropHost


class Halt(NamedTuple):
    """End of the platform: the reason why it cannot continue in the federation."""

    reason: str


SearchEffect: TypeAlias = RunSearch | EndSearch
Effect: TypeAlias = (
    WireEffect | Command | Compute | SearchEffect | InjectFault | Note | Tell | Keep | KeepEncounter | Halt | HostEffect
)
