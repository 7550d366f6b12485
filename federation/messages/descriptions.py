"""A platform's description, as pydantic models: descriptions are rare, and are validated with these."""

from typing import Annotated, Any, Final, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from dyknow.federation import keys
from dyknow.federation.messages.sexpr import MAX_COUNT
from dyknow.model.errors import NameRefused
from dyknow.model.instants import LATEST_US
from dyknow.model.semantic_labels import MAX_FIELDS, MAX_MEANING, definition_errors
from dyknow.model.semantic_labels import SemanticLabel as Definition
from dyknow.model.values import Field as SortField
from dyknow.model.values import Sort

MAX_DEFINITIONS: Final = 128
MAX_CONDITIONS: Final = 16
"""Semantic labels of its own that a platform may have."""


def _checked(check: Any) -> AfterValidator:
    def named(value: str) -> str:
        try:
            found: str = check(value)
        except NameRefused as refused:
            raise ValueError(str(refused)) from None
        return found

    return AfterValidator(named)


def in_one_line(text: str) -> str:
    """The text with blanks for its line breaks: texts of others make no line of ours."""
    return text if text.isprintable() else " ".join(text.splitlines())


Unit = Annotated[str, _checked(keys.unit)]
AgentWord = Annotated[str, _checked(keys.agent)]
SemanticLabel = Annotated[str, _checked(keys.label)]
Hash = Annotated[str, Field(pattern=r"^[0-9a-f]{8}$")]
Count = Annotated[int, Field(ge=0, le=MAX_COUNT)]
Stamp = Annotated[int, Field(ge=0, le=LATEST_US)]
"""An instant after 1970, in microseconds."""
FieldText = Annotated[str, Field(max_length=64)]
Cost = Annotated[float, Field(ge=0, le=1e12)]
"""The cost of a stream for its producer, in a measure that the federation agrees on."""


class DescriptionModel(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class ServiceEntry(DescriptionModel):
    """A service and the agent that provides it."""

    agent: AgentWord
    service: AgentWord
    visibility: Literal["public", "protected"]
    version: Count = 1


class LabelEntry(DescriptionModel):
    """A semantic label and the stream behind it; `period_us` is 0 for one without a period.

    `receivers` are the only platforms that may ask for it; empty: no others are excluded. With a `cost` it is offered:
    not produced yet, and to be called for.
    """

    label: SemanticLabel
    sort: AgentWord
    type_hash: Hash
    period_us: Stamp = 0
    receivers: Annotated[tuple[Unit, ...], Field(max_length=64)] = ()
    cost: Cost | None = None

    @model_serializer(mode="wrap")
    def _without_empty(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        fields = _without(dump(self), "receivers")
        if self.cost is None:
            del fields["cost"]
        return fields


class DefinitionEntry(DescriptionModel):
    """A platform's definition of a semantic label; labels that every platform has are left out."""

    label: SemanticLabel
    sort: AgentWord
    unit: Annotated[str, Field(max_length=24)] = ""
    fields: Annotated[tuple[tuple[FieldText, FieldText], ...], Field(max_length=MAX_FIELDS)] = ()
    meaning: Annotated[str, Field(max_length=MAX_MEANING)]

    @model_validator(mode="after")
    def _is_definition(self) -> Self:
        for message, _ in definition_errors(self.definition):
            raise ValueError(message)
        return self

    @property
    def definition(self) -> Definition:
        """The same as a value."""
        fields = tuple(SortField(name, unit) for name, unit in self.fields)
        return Definition(self.label, Sort(self.sort, fields, unit=self.unit), self.meaning)

    @staticmethod
    def of(label: Definition) -> "DefinitionEntry":
        sort = label.sort
        fields = tuple((part.name, part.unit) for part in sort.fields)
        return DefinitionEntry(label=label.name, sort=sort.name, unit=sort.unit, fields=fields, meaning=label.meaning)


class ConditionEntry(DescriptionModel):
    """A condition of a platform's state that users should know, in words, and since when by its node clock."""

    text: Annotated[str, Field(min_length=1, max_length=200), AfterValidator(in_one_line)]
    since_us: Stamp


class Description(DescriptionModel):
    """Answer of a platform to the question what it offers.

    Attributes:
        unit: its name.
        boot: which life of the platform.
        version: greater after each change; announced in heartbeats.
        kind: its kind.
        clock_epoch_us: epoch of the federation's clock, a UTC instant.
        clock_speed: its speed.
        roster: fingerprint of the roster it goes by, or None in an open federation.
        services: public and protected ones.
        labels: the semantic labels it can export.
        definitions: the meanings of its own semantic labels, exported or not.
        conditions: the conditions of its state.
    """

    unit: Unit
    boot: Count
    version: Count
    kind: Literal["uav", "command-centre"]
    clock_epoch_us: Stamp = 0
    clock_speed: Annotated[float, Field(gt=0, le=1e6)] = 1.0
    roster: Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")] | None = None
    services: Annotated[tuple[ServiceEntry, ...], Field(max_length=256)] = ()
    labels: Annotated[tuple[LabelEntry, ...], Field(max_length=256)] = ()
    conditions: Annotated[tuple[ConditionEntry, ...], Field(max_length=MAX_CONDITIONS)] = ()
    definitions: Annotated[tuple[DefinitionEntry, ...], Field(max_length=MAX_DEFINITIONS)] = ()

    @model_validator(mode="after")
    def _defines_once(self) -> Self:
        if len({each.label for each in self.definitions}) < len(self.definitions):
            raise ValueError("two definitions of one label")
        return self

    @model_serializer(mode="wrap")
    def _without_empty(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Empty fields are left out that members of earlier versions do not have."""
        return _without(dump(self), "conditions", "definitions")


def _without(fields: dict[str, Any], *names: str) -> dict[str, Any]:
    return {name: value for name, value in fields.items() if value or name not in names}
