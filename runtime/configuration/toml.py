"""TOML files that users write: unknown and mistyped keys are errors with file, line and remedy."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, TypeVar

from pydantic import BaseModel, ValidationError

from dyknow.documents.documents import toml_document
from dyknow.documents.places import toml_lines
from dyknow.model.errors import TextErrors, WrongCall, did_you_mean
from dyknow.proxies.files.named_files import bounded_text

M = TypeVar("M", bound=BaseModel)
MOST_MISTAKES: Final = 50
"""Mistakes of a file that are told."""


def read_toml(path: Path) -> dict[str, Any]:
    """The file as a dictionary; raises WrongCall with place and remedy if it is missing or malformed."""
    try:
        text = bounded_text(path)
    except OSError as error:
        raise WrongCall(f"{path}: cannot be read ({error.strerror}); it is a TOML file.") from None
    try:
        return toml_document(text, str(path), 'key = "value", one a line').entries
    except TextErrors as error:
        raise WrongCall(str(error)) from None


def read_model(path: Path, model: type[M], context: Mapping[str, Any] | None = None) -> M:
    """The file as a `model`, validated in a context; every wrong key is reported, not the first."""
    found = read_toml(path)
    try:
        return model.model_validate(found, context=context)
    except ValidationError as error:
        raise WrongCall("\n".join(explained(error, str(path), bounded_text(path), model))) from None


def explained(error: ValidationError, place: str, text: str, model: type[BaseModel]) -> list[str]:
    """One sentence a mistake: place, what is wrong, what to write instead."""
    sentences, mistakes = [], error.errors()[:MOST_MISTAKES]
    lines = toml_lines(text, [mistake["loc"] for mistake in mistakes])
    for mistake, number in zip(mistakes, lines, strict=True):
        path = [str(part) for part in mistake["loc"]]
        name = ".".join(path)
        where = f"{place}:{number}" if text else place
        if mistake["type"] == "extra_forbidden":
            known = _keys_at(model, path[:-1])
            sentences.append(f"{where}: unknown key {name!r}.{did_you_mean(path[-1], known)}")
        else:
            sentences.append(f"{where}: {name}: {mistake['msg']} (got {mistake['input']!r}).")
    return sentences


def wrong_values(error: ValidationError) -> str:
    """The mistakes of options that stand in no file, a line each."""
    return "\n".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']} (got {e['input']!r})." for e in error.errors())


def _keys_at(model: type[BaseModel], path: list[str]) -> list[str]:
    """The keys a table of the file may have: the fields of the model that `path` leads to."""
    found: type[BaseModel] | None = model
    for part in path:
        fields = found.model_fields.items() if found else ()
        # A part that is no field is a key of a dictionary of models: the model stays the same.
        annotation = next((field.annotation for name, field in fields if part in {name, field.alias}), found)
        found = _model_in(annotation)
    return [field.alias or name for name, field in found.model_fields.items()] if found else []


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The model inside an annotation such as `dict[str, UnitFile]`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((model for part in getattr(annotation, "__args__", ()) if (model := _model_in(part)) is not None), None)
