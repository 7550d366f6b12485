"""Extensions: modules from outside that bring parts of platforms, semantic labels, or commands.

A module exposes `PARTS` (classes derived from `dyknow.agents.part.Part`, built of `dyknow.agents.ports`), `LABELS`
(TOML like federation/sharing/ontology.toml), `COMMANDS` (for the command line), or several of these.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.metadata import entry_points
from types import ModuleType
from typing import Final

from dyknow.agents.actions import Action
from dyknow.agents.capabilities.capability import Stage, all_parts
from dyknow.agents.part import Part
from dyknow.agents.parts import PLATFORM
from dyknow.compunits import load_module
from dyknow.federation.sharing.ontology import Ontology, default_ontology
from dyknow.model.errors import UnitError

GROUP: Final = "dyknow.extensions"
"""The entry points that name extensions of installed packages."""


@dataclass(frozen=True, slots=True)
class Extension:
    """One extension as it was loaded; `labels` is TOML, empty for none."""

    module: ModuleType
    parts: tuple[type[Part], ...]
    labels: str


def load_extension(name: str) -> Extension:
    """Import an extension by the name of its entry point, or of its module.

    Raises:
        UnitError: it does not import, or is no extension.
    """
    installed = entry_points(group=GROUP, name=name)
    module = load_module(next((each.value for each in installed), name), f"the extension {name!r}")
    if not any(hasattr(module, each) for each in ("PARTS", "LABELS", "COMMANDS")):
        raise UnitError(f"extension {name}: expected a module with PARTS, LABELS or COMMANDS")
    parts = tuple(getattr(module, "PARTS", ()))
    for part in parts:
        if not (isinstance(part, type) and issubclass(part, Part)):
            raise UnitError(
                f"extension {name}: PARTS: expected classes derived from dyknow.agents.part.Part, got {part!r}"
            )
    return Extension(module, parts, str(getattr(module, "LABELS", "")))


def own_parts() -> tuple[type[Part], ...]:
    """The classes of all parts there are besides those of extensions, whichever platform has them."""
    return (*(part for part in PLATFORM if not isinstance(part, Stage)), *all_parts())


def typed_actions(extensions: Iterable[str] = ()) -> Mapping[str, Action]:
    """Actions that a user can request by `dyknow delegate`, by head; actions of extensions come last.

    Raises:
        UnitError: an extension does not load.
    """
    parts = [*own_parts(), *(part for name in extensions for part in load_extension(name).parts)]
    actions = (action for part in parts for offer in part.offers for action in offer.actions)
    return {action.head: action for action in actions if action.typed}


def labels_of(extensions: Iterable[str] = ()) -> Ontology:
    """The semantic labels there are, with those that extensions bring.

    Raises:
        UnitError: an extension does not load.
        TextError: its labels are wrong, and where.
    """
    ontology = default_ontology()
    for extension in map(load_extension, extensions):
        ontology = ontology.extended(extension.labels, extension.module.__name__)
    return ontology
