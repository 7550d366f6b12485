"""The parameters of a command: its own, and a flag for each field of the models of options that it takes."""

from collections.abc import Mapping, Sequence
from inspect import Parameter
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import typer
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from dyknow.agents.options import FLAGS, Flag, flags_of
from dyknow.model.errors import WrongCall
from dyknow.runtime.configuration.toml import wrong_values


class Declared:
    """The parameters of a command.

    A parameter that is a model of options stands for a flag for each field. If the command declares a parameter of the same
    name itself, that one stands in its place, and the field has its default.

    Attributes:
        own: the names of the parameters that are no models.
        parameters: own parameters and flags, in the order in which the help has them.
    """

    def __init__(self, declared: Sequence[Parameter], command: str) -> None:
        own = {each.name: each for each in declared if not _is_model(each.annotation)}
        self._models = {each.name: each.annotation for each in declared if each.name not in own}
        self._flags = {name: flags_in(model, command) for name, model in self._models.items()}
        placed = {flag.name for flags in self._flags.values() for flag in flags}
        shown = [self._flags.get(each.name, [each]) for each in declared if each.name not in placed]
        self.own = list(own)
        self.parameters = [own.get(each.name, each) for part in shown for each in part]

    def read(self, given: Mapping[str, Any]) -> dict[str, BaseModel]:
        """The models of the flags that were given, by parameter; raises WrongCall."""
        return {
            name: _validated(
                model,
                {each.name: given[each.name] for each in self._flags[name] if each.name in given.keys() - self.own},
            )
            for name, model in self._models.items()
        }


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _validated(model: type[BaseModel], given: Mapping[str, Any]) -> BaseModel:
    try:
        return model.model_validate(given, context={FLAGS: True})
    except ValidationError as error:
        raise WrongCall(wrong_values(error)) from None


def flags_in(model: type[BaseModel], command: str) -> list[Parameter]:
    """The flags of a model of options, as parameters of a command."""
    return [
        Parameter(
            name,
            Parameter.KEYWORD_ONLY,
            default=None if flag.typed or field.default == () else field.default,
            annotation=Annotated[flag.typed or _typed(field.annotation), _option(name, field, flag)],
        )
        for name, field, flag in flags_of(model, command)
    ]


def flag_of(model: type[BaseModel], field: str) -> Any:
    """The flag of one field of a model of options, for a command that has that one only."""
    return next(_option(*each) for each in flags_of(model) if each[0] == field)


def _option(name: str, field: FieldInfo, flag: Flag) -> Any:
    plain = flag.name or f"--{(field.alias or name).replace('_', '-')}"
    names = f"{plain}/--no-{plain.removeprefix('--')}" if field.default is True else plain
    bounds = {type(each).__name__: each for each in field.metadata}
    least, most = getattr(bounds.get("Ge"), "ge", None), getattr(bounds.get("Le"), "le", None)
    return typer.Option(names, metavar=flag.metavar, help=field.description, min=least, max=most)


def _typed(annotation: Any) -> Any:
    """The type of an option on the command line: without validators, several values as a list."""
    kind, parts = get_origin(annotation), get_args(annotation)
    if kind is Annotated:
        return _typed(parts[0])
    if kind is tuple:
        return list[parts[0]] | None  # type: ignore[valid-type]
    return Union[tuple(map(_typed, parts))] if kind in {Union, UnionType} else annotation  # noqa: UP007
