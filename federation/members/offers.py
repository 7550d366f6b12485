"""Offers of platforms in the directory, their visibility, and how new and withdrawn offers are found (thesis 9.3.2)."""

from collections.abc import Iterator, Mapping
from enum import StrEnum
from typing import NamedTuple, TypeAlias

from dyknow.federation.messages.descriptions import LabelEntry
from dyknow.model.semantic_labels import SemanticLabel


class Visibility(StrEnum):
    """How agents of other platforms reach a service: directly, or through the Interface Agent only."""

    PUBLIC = "public"
    PROTECTED = "protected"


class Service(NamedTuple):
    """A service as the directory lists it; other platforms reach a protected one at their `interface` agent."""

    service: str
    agent: str
    visibility: Visibility = Visibility.PROTECTED
    version: int = 1


class ServiceAppeared(NamedTuple):
    unit: str
    service: Service


class ServiceGone(NamedTuple):
    unit: str
    service: Service


class LabelAppeared(NamedTuple):
    unit: str
    label: LabelEntry


class LabelGone(NamedTuple):
    unit: str
    label: LabelEntry


class DefinitionsChanged(NamedTuple):
    """A platform changed the definition of a label."""

    unit: str


OfferEvent: TypeAlias = ServiceAppeared | ServiceGone | LabelAppeared | LabelGone | DefinitionsChanged


class Offers(NamedTuple):
    """The services and semantic labels of one platform, and the definitions of its own labels, by name."""

    services: Mapping[str, Service]
    labels: Mapping[str, LabelEntry]
    definitions: Mapping[str, SemanticLabel]


NO_OFFERS = Offers({}, {}, {})


def changes(unit: str, before: Offers, after: Offers) -> Iterator[OfferEvent]:
    """The events of withdrawn offers, then those of new ones; a changed offer has both."""
    if before.definitions != after.definitions:
        yield DefinitionsChanged(unit)
    for name, label in before.labels.items():
        if after.labels.get(name) != label:
            yield LabelGone(unit, label)
    for name, service in before.services.items():
        if after.services.get(name) != service:
            yield ServiceGone(unit, service)
    for name, service in after.services.items():
        if before.services.get(name) != service:
            yield ServiceAppeared(unit, service)
    for name, label in after.labels.items():
        if before.labels.get(name) != label:
            yield LabelAppeared(unit, label)
