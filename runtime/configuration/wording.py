"""From words on the command line to the content of an act: `create-multicast sample-period=1s to-units=0,1`."""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, get_args, get_origin

from pydantic import ValidationError

from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.federation.messages.contents import Content, When
from dyknow.model.errors import WrongCall, did_you_mean
from dyknow.runtime.configuration.areas import corners_of
from dyknow.runtime.configuration.instants import instant_us

if TYPE_CHECKING:
    from dyknow.agents.actions import Action

LONGEST_WAIT_S = 3600
_WORDS = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}


@cache
def typed(extensions: tuple[str, ...] = ()) -> "Mapping[str, Action]":
    """The tasks that can be delegated, by head: the `typed` actions of all parts of a platform, and of these extensions.

    Raises:
        UnitError: an extension does not load.
    """
    from dyknow.agents.capabilities.capability import typed_requests

    if not extensions:
        return typed_requests()
    from dyknow.agents.extensions import typed_actions  # loads all parts of a platform, which takes 0.4 s

    return {**typed_requests(), **typed_actions(extensions)}


def values_of(task: str, pairs: Sequence[str], extensions: tuple[str, ...] = ()) -> dict[str, str]:
    """The texts by key of `key=value` pairs; raises as `content_with`."""
    given = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not equals:
            raise WrongCall(f"{pair!r}: write key=value; {_keys(task, _fields(task, extensions))}")
        given[key] = text
    return given


def content_with(task: str, given: Mapping[str, Any], now_us: int, extensions: tuple[str, ...] = ()) -> Content:
    """The content that delegates `task` with these values by key.

    Texts are read as on the command line: durations take suffixes, times are instants, lists have commas.

    Raises:
        WrongCall: an unknown task or key, a value that does not fit; with the remedy.
        UnitError: an extension does not load.
    """
    names = _fields(task, extensions)
    kind = typed(extensions)[task].content
    values: dict[str, Any] = {}
    for written, value in given.items():
        key = written if written in names else written.replace("_", "-")
        if key not in names:
            raise WrongCall(
                f"{task} has no {written!r}.{did_you_mean(key, tuple(names)) if names else ' It takes nothing.'}"
            )
        is_text = isinstance(value, str)
        values[key] = (
            _value(key, names[key], kind.model_fields[names[key]].annotation, value, now_us) if is_text else value
        )
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        said = [_sentence(task, mistake["loc"], mistake["type"], mistake["msg"]) for mistake in error.errors()]
        raise WrongCall("\n".join([*said, _keys(task, names)])) from None


def content_when(content: Content, condition: str, waits: str) -> Content:
    """The content that asks for `content` once a formula is true, if it is within a time.

    Raises:
        TextError: the formula is wrong.
        WrongCall: the time is none, or too long.
    """
    from dyknow.kpl import parse_formula

    parse_formula(condition)
    waits_s = duration_us(waits, option="--for", least_us=SHORTEST_US) / 1e6
    if waits_s > LONGEST_WAIT_S:
        raise WrongCall(f"--for: a platform waits for a condition an hour at most, and {waits} is longer; write 1h.")
    return When(do=content.expr(), condition=condition, timeout_s=waits_s)


def _fields(task: str, extensions: tuple[str, ...]) -> dict[str, str]:
    """The fields of a task's content by the key they are typed as; raises WrongCall for an unknown task."""
    actions = typed(extensions)
    action = actions.get(task)
    if action is None:
        known = did_you_mean(task, tuple(actions)) or f" Tasks are {', '.join(actions)}."
        raise WrongCall(f"TASK: unknown task {task!r}.{known}")
    fields = action.content.model_fields.items()
    return {field.alias or name: name for name, field in fields if name not in action.inner}


def _keys(task: str, names: dict[str, str]) -> str:
    return f"{task} takes {', '.join(f'{key}=...' for key in names) or 'nothing'}"


def _sentence(task: str, place: Sequence[int | str], kind: str, message: str) -> str:
    key = ".".join(str(part) for part in place)
    return f"{task} needs {key}=..." if kind == "missing" else f"{key}: {message}"


_RATES = frozenset({"kbit_s"})
"""Names of fields that end as durations do and are none."""


def _value(key: str, name: str, annotation: Any, text: str, now_us: int) -> Any:
    """The value that a field of this type and name has; quantities end in `_s`, `_us` or their unit."""
    kinds = _kinds(annotation)
    if name == "area" and text.endswith(("json", "JSON")):
        return corners_of(text)
    if tuple in kinds:
        return tuple(part.strip() for part in text.split(",") if part.strip())
    if name.endswith("_us"):
        return instant_us(text, now_us, option=key)
    if name.endswith("_s") and name not in _RATES:
        return duration_us(text, option=key) / 1e6
    if bool in kinds:
        if text.lower() not in _WORDS:
            raise WrongCall(f"{key}: {text!r} is neither true nor false.")
        return _WORDS[text.lower()]
    if int in kinds or float in kinds:
        try:
            return int(text) if int in kinds else float(text)
        except ValueError:
            raise WrongCall(f"{key}: {text!r} is not a number.") from None
    return text


def _kinds(annotation: Any) -> set[Any]:
    """The plain types in an annotation such as `tuple[str, ...] | None`."""
    origin = get_origin(annotation)
    if origin is tuple:
        return {origin}
    parts = get_args(annotation)
    return {kind for part in parts for kind in _kinds(part)} if parts else {annotation}
