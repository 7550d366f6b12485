"""Options: each is one field of one model, which stands with the part that takes it.

From that field follow its key in a federation's file (`[unit.U]`), its flag and its help, its variable, its field in the
configuration of a process, and the value that the part gets: `ports.config.options[SheddingOptions].shedding`. Texts are
read once, where they enter: durations become microseconds, paths absolute. A folder of parts, such as that of a capability,
has its models in `OPTIONS` of its `options.py`, which imports no parts, so that each command can list them.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from pkgutil import ModuleInfo, iter_modules
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Final, Self, TypeAlias, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
    ValidationInfo,
    create_model,
)
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.model.instants import print_span

M = TypeVar("M", bound=BaseModel)
ROOMS: Final = ("dyknow.agents", "dyknow.agents.capabilities")
"""Packages whose folders may have an `options.py`."""
BASE: Final = "base"
"""Key of the folder in the context of a validation, to which paths are relative; without it they stay as they are."""
FLAGS: Final = "flags"
"""Key of whether the values of a validation are those of flags, in the same context."""


class Strict(BaseModel):
    """Unknown keys are errors: a misspelt option must not be ignored."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True, defer_build=True)


class Options(Strict):
    """Options of one part. A field without a `Flag` is set in files only; the help of a flag is its description."""

    COMMANDS: ClassVar[tuple[str, ...]] = ("join", "up")
    """The commands that start platforms, and have its flags."""


@dataclass(frozen=True, slots=True)
class Flag:
    """The way in which a field is written on the command line.

    Attributes:
        name: the flag, unless it is the key after two dashes.
        metavar: the placeholder of its value.
        typed: the type of its value there, if another than that of the field.
    """

    name: str | None = None
    metavar: str | None = None
    typed: Any = None


@dataclass(frozen=True, slots=True)
class Everywhere:
    """An option that is also a key of the whole federation, and a variable: for each platform without its own."""


def _span_us(given: Any, info: ValidationInfo, least_us: int, most_us: int) -> Any:
    if given is None:
        return None
    if not isinstance(given, str):
        raise PydanticCustomError("string_type", "Input should be a valid string")
    option = ("--" if (info.context or {}).get(FLAGS) else "") + str(info.field_name).removesuffix("_us")
    found_us = duration_us(given, option=option, least_us=least_us)
    if found_us > most_us:
        raise PydanticCustomError("too_long", f"{given} is too long; write {print_span(most_us)} or less")
    return found_us


def read_duration(most_us: int, least_us: int = SHORTEST_US) -> BeforeValidator:
    """Read microseconds from a text as `200ms`; raises WrongCall."""
    return BeforeValidator(lambda given, info: _span_us(given, info, least_us, most_us))


DURATION_TEXT: Final = PlainSerializer(lambda given: f"{given}us", when_used="json-unless-none")
"""In JSON a duration is a text, as users write it."""


def _placed(path: Path, info: ValidationInfo) -> Path:
    base = (info.context or {}).get(BASE)
    return path if base is None else base / path


def _placed_modules(names: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
    return tuple(str(_placed(Path(name), info)) if name.endswith(".py") else name for name in names)


def _split(given: Any) -> Any:
    """A text, such as a variable, holds several items with commas between them."""
    return tuple(part.strip() for part in given.split(",") if part.strip()) if isinstance(given, str) else given


OptionPath: TypeAlias = Annotated[Path, AfterValidator(_placed)]
"""A file or folder, relative to the folder of the file that names it, or to the working directory."""
Items: TypeAlias = Annotated[tuple[str, ...], BeforeValidator(_split)]
Modules: TypeAlias = Annotated[Items, AfterValidator(_placed_modules)]
"""Modules by name, or files that end with .py: a platform finds them from any working directory."""


class Chosen:
    """Options by their models: `chosen[SheddingOptions]`; a model that was not given has its defaults."""

    def __init__(self, *given: Options) -> None:
        self._given: dict[type[BaseModel], BaseModel] = {type(each): each for each in given}

    def __getitem__(self, model: type[M]) -> M:
        return self._given.get(model) or model()  # type: ignore[return-value]


class OptionsTable(Strict):
    """A table whose keys are its own fields, and those of the models that it is `composed` of."""

    MODELS: ClassVar[tuple[type[Options], ...]] = ()

    def __getitem__(self, model: type[M]) -> M:
        """The options of one model."""
        values = {name: getattr(self, name) for name in model.model_fields}
        return model.model_construct(self.model_fields_set & values.keys(), **values)

    def having(self, *options: Options) -> Self:
        """The table with the values that are set in these options."""
        fields = {name: getattr(each, name) for each in options for name in each.model_fields_set}
        return self.model_copy(update=fields)

    def texts(self, models: Iterable[type[Options]]) -> dict[str, Any]:
        """The values that are set of the options of these models, as JSON has them."""
        fields = {name for model in models for name in model.model_fields}
        return self.model_dump(mode="json", exclude_unset=True, include=fields)

    def chosen(self) -> Chosen:
        """The options of all its models."""
        return Chosen(*(self[model] for model in self.MODELS))


def composed(*models: type[Options]) -> Callable[[type[M]], type[M]]:
    """Decorate a table that has the fields of the models as well as its own."""

    def add(table: type[M]) -> type[M]:
        made = _derived(table, (table, *reversed(models)))  # the fields of the last base come first
        made.MODELS = models
        return made  # type: ignore[no-any-return]

    return add


def with_everywhere(*models: type[Options]) -> Callable[[type[M]], type[M]]:
    """Decorate settings that have the options which are `Everywhere`, each None where it is not set."""
    own = {name: field for model in models for name, field in model.model_fields.items() if is_everywhere(field)}
    kinds: dict[str, Any] = {name: field.annotation for name, field in own.items()}
    fields = {
        name: (Annotated[(kinds[name] | None, *field.metadata)], Field(default=None, alias=field.alias))
        for name, field in own.items()
    }
    return lambda settings: _derived(settings, (settings,), fields)


def _derived(table: type[BaseModel], bases: Any, fields: Any = MappingProxyType({})) -> Any:
    return create_model(table.__name__, __base__=bases, __module__=table.__module__, __doc__=table.__doc__, **fields)


def is_everywhere(field: FieldInfo) -> bool:
    """Whether the option is also one of the whole federation."""
    return any(isinstance(each, Everywhere) for each in field.metadata)


def flags_of(model: type[BaseModel], command: str = "") -> Iterator[tuple[str, FieldInfo, Flag]]:
    """The fields of a model that have a flag; of a table those of the models that name the command."""
    models = [each for each in model.MODELS if command in each.COMMANDS] if issubclass(model, OptionsTable) else [model]
    for each in models:
        for name, field in each.model_fields.items():
            for flag in field.metadata:
                if isinstance(flag, Flag):
                    yield name, field, flag


@cache
def platform_options() -> tuple[type[Options], ...]:
    """The models of options of all parts of a platform and of its capabilities: `OPTIONS` of each `options.py`."""
    names = [f"{room}.{each.name}" for room in ROOMS for each in _modules_of(room) if each.ispkg]
    places = [f"{name}.options" for name in names if find_spec(f"{name}.options") is not None]
    return tuple(model for place in places for model in import_module(place).OPTIONS)


def _modules_of(package: str) -> list[ModuleInfo]:
    return sorted(iter_modules(import_module(package).__path__), key=lambda each: each.name)
