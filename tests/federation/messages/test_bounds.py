"""No field of a content, nor of a description, is without a bound: what is added has to be of a sort that has one."""

from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import pytest
from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from dyknow.federation.messages import contents, descriptions
from dyknow.federation.messages.contents import parts
from dyknow.federation.messages.sexpr import Expr
from dyknow.model.errors import ContentError
from dyknow.model.values import NoValue
from tests.federation.expressions import parse_expr

MOST_CHARACTERS, MOST_ITEMS, LARGEST, LARGEST_WHOLE = 32_768, 512, 1e30, 2**63 - 1
TOO_LARGE = (1e303, -1e303, 1.1e30, float("inf"), float("-inf"), float("nan"))
ANYTHING = {"When.do"}
"""An expression, which is within the limits of an act, and is read as one when its time has come."""


def models() -> list[type[BaseModel]]:
    contents.prepare()
    found, waiting = list[type[BaseModel]](), [parts.ContentPart, descriptions.DescriptionModel]
    while waiting:
        kind = waiting.pop()
        waiting += kind.__subclasses__()
        if (
            kind not in {parts.ContentPart, parts.Content, descriptions.DescriptionModel}
            and kind.__module__.startswith("dyknow.")  # not of an extension that another test has loaded
        ):
            found.append(kind)
    return sorted(set(found), key=lambda each: each.__name__)


FIELDS = [
    pytest.param(field.annotation, tuple(field.metadata), id=f"{model.__name__}.{name}")
    for model in models()
    for name, field in model.model_fields.items()
    if f"{model.__name__}.{name}" not in ANYTHING
]


def flat(metadata: tuple[Any, ...]) -> tuple[Any, ...]:
    """What pydantic makes of annotations, in one row: a field within another one has some of its own."""
    return tuple(one for each in metadata for one in (each.metadata if isinstance(each, FieldInfo) else (each,)))


def unbounded(kind: Any, metadata: tuple[Any, ...] = ()) -> str:
    """What in a type has no bound; empty: nothing."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return unbounded(arguments[0], (*flat(arguments[1:]), *metadata))
    if origin in {Union, UnionType}:
        return next(filter(None, (unbounded(each, metadata) for each in arguments)), "")
    if origin is Literal or kind in {bool, NoneType, NoValue}:
        return ""
    if origin is tuple:
        is_fixed = arguments[-1] is not Ellipsis
        if not is_fixed and _most(metadata) > MOST_ITEMS:
            return "a list"
        return next(filter(None, map(unbounded, arguments if is_fixed else arguments[:1])), "")
    if origin is dict:
        return "a record" if _most(metadata) > MOST_ITEMS else unbounded(arguments[0]) or unbounded(arguments[1])
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return ""  # its fields are looked at by themselves
    tried = {str: ("a" * (MOST_CHARACTERS + 1), "1" * (MOST_CHARACTERS + 1), " " * (MOST_CHARACTERS + 1)),
             float: TOO_LARGE, int: (LARGEST_WHOLE + 1, -LARGEST_WHOLE - 2)}  # fmt: skip
    takes = TypeAdapter(Annotated[kind, *metadata] if metadata else kind)  # type: ignore[valid-type]
    return next((f"{value!r:.20} of {kind}" for value in tried.get(kind, ("?",)) if _is_taken(takes, value)), "")


def _most(metadata: tuple[Any, ...]) -> int:
    return min((each.max_length for each in metadata if getattr(each, "max_length", None) is not None), default=2**63)


def _is_taken(takes: TypeAdapter[Any], value: Any) -> bool:
    try:
        takes.validate_python(value)
    except ValidationError:
        return False
    return True


@pytest.mark.parametrize(("kind", "metadata"), FIELDS)
def test_every_field_is_bounded(kind: Any, metadata: tuple[Any, ...]) -> None:
    assert not unbounded(kind, metadata)


@pytest.mark.parametrize(
    "kind", [str, int, float, tuple[int, ...], dict[str, int], Annotated[float, "of no limit"], Any]
)
def test_what_has_no_bound_is_noticed(kind: Any) -> None:
    assert unbounded(kind)


def test_every_content_is_looked_at() -> None:
    names = {each.id.split(".")[0] for each in FIELDS if each.id}
    ours = [kind for kind in parts._CONTENTS.values() if kind.__module__.startswith("dyknow.")]
    assert {kind.__name__ for kind in ours if kind.model_fields} - names == set()
    assert {"Fence", "Reading", "LabelEntry", "Description"} <= names


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ('(check-formula text: "{}")', "text"),
        ('(when do: (hold) condition: "{}")', "condition"),
        ('(query-stream stream: "{}")', "stream"),
        ('(recognise text: "{}")', "text"),
        ('(add-declarations text: "{}")', "text"),
        ('(load-specification text: "a" files: (sequence (named-text path: a text: "{}")))', "files.0.text"),
        ('(want symbol: a type: b description: "{}")', "description"),
        ('(fly-mission mission: m1 domain: "{}" problem: "")', "domain"),
    ],
)  # fmt: skip
def test_a_text_that_would_be_parsed_is_refused_beyond_its_budget(text: str, named: str) -> None:
    for nested in ("(" * 64 + ")" * 64, "[(" * 32 + ")]" * 32, "(a) " * 100, ") " * 100 + "(" * 60):
        contents.read(parse_expr(text.format(nested)))
    for nested in ("(" * 65, "(" * 900, "{(" * 33, "a(" * 65 + ")" * 65):
        with pytest.raises(ContentError, match=f"{named}: brackets are nested deeper than 64, from character"):
            contents.read(_said(text, nested))
    with pytest.raises(ContentError, match=f"{named}: .* at most"):
        contents.read(_said(text, "a" * (MOST_CHARACTERS + 1)))


def _said(text: str, inserted: str) -> Expr:
    """The expression with the text where the braces are; `{` in it is not a form."""
    return _with(parse_expr(text.replace("{}", "@")), inserted)


def _with(value: Any, inserted: str) -> Any:
    if isinstance(value, Expr):
        return Expr(value.head, {name: _with(each, inserted) for name, each in value.arguments.items()})
    if isinstance(value, tuple):
        return tuple(_with(each, inserted) for each in value)
    return inserted if value == "@" else value


@pytest.mark.parametrize(
    "text",
    [
        "(create-multicast semantic-labels: (sequence battery) sample-period: 0.0009 delay: 1.0 to-units: (sequence 0))",
        "(create-multicast semantic-labels: (sequence battery) sample-period: 1.0 delay: 1e303 to-units: (sequence 0))",
        "(create-multicast semantic-labels: (sequence battery) sample-period: 1.0 delay: 1.0 to-units: (sequence 0) from: 60000000000000001)",
        "(query semantic-label: battery op: at at: -60000000000000001)",
        '(stream owner: 1 semantic-labels: (sequence battery) policy: "sample every 1us" hash: ab12cd34)',
        '(stream owner: 1 semantic-labels: (sequence battery) policy: "sample never" hash: ab12cd34)',
        "(hand-over task: 1-2-3 coordinator: 0 boot: 17 generation: 2147483649)",
        "(perform-commands mission: m1 step: 2 action: a commands: (sequence (command-entry name: goto numbers: (sequence 1e7))))",
        "(samples unit: 1 semantic-label: battery samples: (sequence (reading valid: 1 available: 2 value: (record x: 1.1e30))))",
        "(samples unit: 1 semantic-label: battery samples: (sequence (reading valid: 1 available: 2 value: (record x: 1.0) variance: (record x: -1.0))))",
        '(assign-area task: a.1 generation: 1 rings: (sequence (area-ring corners: (sequence "58 15" "58 15.1" "58.2 15.1"))) middle: "58 15" whole: (sequence "58 15" "58 15.1" "58.1 15.1"))',
        '(assign-area task: a.1 generation: 1 whole: (sequence "58 15" "58.1 15.1" "58 15.1" "58.1 15"))',
        '(divide-area area: (sequence "58 15" "58.1 15.1" "58 15.1" "58.1 15"))',
        '(divide-area area: (sequence "58 15" "58 15" "58 15"))',
        '(divide-area area: (sequence "nan 15" "58 15.1" "58.1 15"))',
        '(mission-proposal cost: 2.5 duration: 86401.0 actions: (sequence "land(uav1)"))',
    ],
)  # fmt: skip
def test_numbers_that_later_arithmetic_would_not_bear_are_refused(text: str) -> None:
    with pytest.raises(ContentError):
        contents.read(parse_expr(text))
