"""A capability of a UAV: a folder in `agents/capabilities` whose `capability.py` makes one `Capability`.

That module imports no parts: they are imported by the platforms that have them. Its options are in its `options.py`
(`dyknow.agents.options`), from where each command lists them. The folder is all that a new one needs, besides its
contents (`dyknow.federation.messages.contents`) and its command.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

from dyknow.agents.actions import Action
from dyknow.agents.tasks.requests import TYPED
from dyknow.model.errors import UnitError

if TYPE_CHECKING:
    from dyknow.agents.config import PlatformConfig
    from dyknow.agents.part import Part

PartClasses: TypeAlias = "Sequence[type[Part]]"
PACKAGE: Final = "dyknow.agents.capabilities"


class Stage(Enum):
    """When parts are stepped, among those of the platform: within one instant the order of the stages is kept."""

    SENSING = auto()
    """They make samples of the vehicle's reports, each of its own: the part that flies takes the others."""
    FLYING = auto()
    """They fly the vehicle, or pursue goals: before the local instance."""
    CONVERSING = auto()
    """They keep conversations: after samples were sent and taken, before requests are admitted."""
    REACTING = auto()
    """They react to peers, alarms and streams of the specification: after all other parts but the directory."""


class Group(NamedTuple):
    """Parts that a platform has together.

    Attributes:
        stage: when they are stepped.
        is_wanted: whether a platform has them.
        load: imports and returns their classes, in the order in which they are stepped.
    """

    stage: Stage
    is_wanted: "Callable[[PlatformConfig], bool]"
    load: Callable[[], PartClasses]


@dataclass(frozen=True, slots=True)
class Capability:
    """One capability.

    Attributes:
        groups: its parts.
        requests: the requests to it that a person can type, as `dyknow.agents.actions.Action` of its parts.
        after: the capabilities whose parts are stepped before its own, at the same stage.
    """

    groups: tuple[Group, ...]
    requests: tuple[Action, ...] = ()
    after: tuple[str, ...] = ()


def always(_config: "PlatformConfig") -> bool:
    """Each platform has it."""
    return True


def has_vehicle(config: "PlatformConfig") -> bool:
    """Platforms with a vehicle have it."""
    return config.vehicle


def has_no_vehicle(config: "PlatformConfig") -> bool:
    """Platforms without a vehicle have it."""
    return not config.vehicle


def has_cameras(config: "PlatformConfig") -> bool:
    """Platforms with cameras have it."""
    return config.cameras is not None


def attends(config: "PlatformConfig") -> bool:
    """Platforms whose vehicle carries cameras have it."""
    return config.vehicle and config.cameras is not None


def is_simulated(config: "PlatformConfig") -> bool:
    """Platforms whose vehicle is simulated have it."""
    return config.simulated


@cache
def found() -> dict[str, Capability]:
    """The capabilities that are there, by name, each behind those it is after.

    Raises:
        UnitError: a folder of `agents/capabilities` has no capability, or two are after each other.
    """
    read = {each.name: _read(each.name) for each in iter_modules(import_module(PACKAGE).__path__) if each.ispkg}
    ordered: dict[str, Capability] = {}

    def put(name: str, above: tuple[str, ...]) -> None:
        if name in above or name not in read:
            raise UnitError(f"the capability {above[-1]} is after {name}, which is after it as well, or is not there")
        if name not in ordered:
            for before in read[name].after:
                put(before, (*above, name))
            ordered[name] = read[name]

    for name in sorted(read):
        put(name, ())
    return ordered


def _read(name: str) -> Capability:
    made = getattr(import_module(f"{PACKAGE}.{name}.capability"), "CAPABILITY", None)
    if not isinstance(made, Capability):
        raise UnitError(
            f"agents/capabilities/{name}/capability.py has no CAPABILITY; write CAPABILITY = Capability(...)"
        )
    return made


def parts_of(stage: Stage, config: "PlatformConfig") -> "list[type[Part]]":
    """The parts that a platform has at that stage, in their order."""
    groups = (group for capability in found().values() for group in capability.groups)
    return [part for group in groups if group.stage is stage and group.is_wanted(config) for part in group.load()]


def all_parts() -> "Iterable[type[Part]]":
    """The parts of all capabilities, whichever platforms have them."""
    return (part for capability in found().values() for group in capability.groups for part in group.load())


def typed_requests() -> Mapping[str, Action]:
    """The requests that a person can type, by head: those to the platform itself, and those to its capabilities."""
    requests = (*TYPED, *(each for capability in found().values() for each in capability.requests))
    return {action.head: action for action in requests}
