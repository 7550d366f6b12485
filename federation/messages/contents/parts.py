"""Contents of acts: one strict model for each head an expression may have. `read` understands, `expr()` says.

A content is validated whole when it is read: each field is of one of the sorts below, which say in which range a number
is that later arithmetic bears, and how long, and how deeply nested, a text is. A handler needs no such check. Periods
and delays are seconds (`_s`), as the thesis prints them; instants are microseconds since the epoch (`_us`). Names print
with hyphens, but for those that name a quantity (`altitude_m`).
"""

import re
from collections.abc import Callable
from functools import cache
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from dyknow.federation import keys
from dyknow.federation.messages.acts import AgentName
from dyknow.federation.messages.descriptions import SemanticLabel, in_one_line
from dyknow.federation.messages.descriptions import Unit as UnitName
from dyknow.federation.messages.sexpr import MAX_INTEGER, MIN_INTEGER, Expr, ExprValue, QuotedText
from dyknow.model.errors import ContentError, NameRefused
from dyknow.model.instants import LATEST_US
from dyknow.model.values import LARGEST, NoValue

MAX_LIST = 512
LONGEST_TEXT = 8192
"""Characters of a formula or a specification in an act."""
DEEPEST = 64
"""Brackets within brackets, in a text that is to be parsed here."""
LONGEST_S = 86_400.0
LEAST_PERIOD_S = 0.001
LAST_GENERATION = 2**31


def _unit(value: Any) -> Any:
    """The thesis writes units as numbers: `(sequence 0)`."""
    return str(value) if type(value) is int else value


def _unit_said(name: str) -> ExprValue:
    return int(name) if name.isdigit() and len(name) < 19 else name


def _truth(value: Any) -> Any:
    return str(value).lower() if type(value) is bool else value


def _truth_said(word: str) -> ExprValue:
    return {"true": True, "false": False}.get(word, word)


def _speaker(value: str) -> str:
    try:
        return str(AgentName.parse(value))
    except NameRefused as refused:
        raise ValueError(str(refused)) from None


def _conversation(value: str) -> str:
    try:
        return keys.conversation(value)
    except NameRefused as refused:
        raise ValueError(str(refused)) from None


def _shown(value: str) -> str:
    if not value.isprintable():
        raise ValueError("a character that is not printed")
    return value


_CONTROLS = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
"""Characters that command a terminal, or turn the order of characters; tabs and ends of lines are part of a text."""


def uncontrolled(text: str) -> str:
    """The text of others without control characters, as a `Formula` may hold it."""
    return _CONTROLS.sub("?", text)


def no_control(value: str) -> str:
    """The same text; raises ValueError if it would command a terminal."""
    if _CONTROLS.search(value):
        raise ValueError("a control character")
    return value


_BRACKETS = re.compile(r"[()\[\]{}]")


def _to_parse(value: str) -> QuotedText:
    """The same text; raises ValueError if it would command a terminal, or if its brackets are nested too deep."""
    depth = 0
    for bracket in _BRACKETS.finditer(value):
        depth = depth + 1 if bracket[0] in "([{" else max(0, depth - 1)
        if depth > DEEPEST:
            raise ValueError(f"brackets are nested deeper than {DEEPEST}, from character {bracket.start() + 1} on")
    return QuotedText(no_control(value))


TO_PARSE = AfterValidator(_to_parse)
"""Of a text that is parsed here; next to it stands how many characters it may have."""


def next_generation(generation: int) -> int:
    """The number of the next coordinator, or division, of a task; that of the last is kept."""
    return min(generation + 1, LAST_GENERATION)


Unit = Annotated[UnitName, BeforeValidator(_unit)]
Units = Annotated[tuple[Unit, ...], Field(max_length=MAX_LIST)]
SemanticLabels = Annotated[tuple[SemanticLabel, ...], Field(min_length=1, max_length=MAX_LIST)]
Word = Annotated[str, Field(min_length=1, max_length=64), AfterValidator(_shown)]
Text = Annotated[str, Field(max_length=1024)]
Line = Annotated[str, Field(max_length=1024), AfterValidator(in_one_line)]
Prose = Annotated[str, Field(max_length=4096), AfterValidator(QuotedText)]
Printed = Annotated[str, Field(max_length=LONGEST_TEXT), AfterValidator(no_control), AfterValidator(QuotedText)]
"""A text that is shown, and not parsed."""
Formula = Annotated[str, Field(max_length=LONGEST_TEXT), TO_PARSE]
Conversation = Annotated[str, AfterValidator(_conversation)]
Agent = Annotated[str, AfterValidator(_speaker)]
Truth = Annotated[Literal["true", "false", "undecided"], BeforeValidator(_truth)]
Period = Annotated[float, Field(ge=LEAST_PERIOD_S, le=LONGEST_S)]
"""Between samples, in seconds."""
Timeout = Annotated[float, Field(ge=LEAST_PERIOD_S, le=LONGEST_S)]
Seconds = Annotated[float, Field(ge=0, le=LONGEST_S)]
Instant = Annotated[int, Field(ge=-LATEST_US, le=LATEST_US)]
Generation = Annotated[int, Field(ge=0, le=LAST_GENERATION)]
Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Integer = Annotated[int, Field(ge=MIN_INTEGER, le=MAX_INTEGER)]
Share = Annotated[float, Field(ge=0, le=1)]
LatitudeDeg = Annotated[float, Field(ge=-90, le=90)]
LongitudeDeg = Annotated[float, Field(ge=-180, le=180)]
AltitudeM = Annotated[float, Field(ge=-1000, le=100_000)]
Metres = Annotated[float, Field(ge=-100_000, le=1_000_000)]
SquareMetres = Annotated[float, Field(ge=0, le=1e12)]
Scalar: TypeAlias = bool | Integer | Number | Text | NoValue
FieldName = Annotated[str, Field(min_length=1, max_length=256)]
Values = Annotated[dict[FieldName, Scalar], Field(max_length=256)]
Variances = Annotated[dict[FieldName, Annotated[float, Field(ge=0, le=LARGEST)]], Field(max_length=256)]


def _alias(name: str) -> str:
    stem = name.removesuffix("_us").removesuffix("_s") if name.endswith(("_us", "_s")) else name
    return stem.replace("_", "-")


class ContentPart(BaseModel):
    """An expression with a fixed head; `expr()` prints it, parameters left out that are as they would be without."""

    model_config = ConfigDict(
        strict=True,
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        arbitrary_types_allowed=True,
        alias_generator=_alias,
        validate_by_name=True,
        validate_by_alias=True,
        defer_build=True,
    )
    head: ClassVar[str]

    @classmethod
    def __pydantic_init_subclass__(cls, **_given: Any) -> None:
        if "head" not in cls.__dict__:
            cls.head = re.sub(r"(?<!^)(?=[A-Z])", "-", cls.__name__).lower()

    @model_validator(mode="before")
    @classmethod
    def _open(cls, found: Any) -> Any:
        """Parts of a content come as expressions."""
        if not isinstance(found, Expr):
            return found
        if found.head != cls.head:
            raise ValueError(f"({cls.head} ...) is expected, not ({found.head} ...)")
        return dict(found.arguments)

    def expr(self) -> Expr:
        """What to put into an act."""
        arguments: dict[str, ExprValue] = {}
        defaults = _defaults(type(self))
        for name, field in type(self).model_fields.items():
            value = getattr(self, name)
            if name not in defaults or value != defaults[name]:
                arguments[field.alias or name] = _said(value, _WORDS.get(name))
        return Expr(self.head, arguments)


@cache
def _defaults(kind: type[ContentPart]) -> dict[str, Any]:
    """The defaults of the parameters of a content, by field."""
    optional = {name: field for name, field in kind.model_fields.items() if not field.is_required()}
    return {name: field.get_default(call_default_factory=True) for name, field in optional.items()}


def _said(value: Any, word: Callable[[str], ExprValue] | None) -> ExprValue:
    if isinstance(value, ContentPart):
        return value.expr()
    if isinstance(value, tuple):
        return tuple([_said(member, word) for member in value])
    said: ExprValue = value if word is None else word(value)
    return said


class Content(ContentPart):
    """A part that can be the whole content of an act; the others only occur inside.

    Attributes:
        lasting: whether a request of it is agreed to and lives until it is cancelled.
    """

    lasting: ClassVar[bool] = False

    @classmethod
    def __pydantic_init_subclass__(cls, **given: Any) -> None:
        super().__pydantic_init_subclass__(**given)
        _CONTENTS[cls.head] = cls


_CONTENTS: dict[str, type[Content]] = {}
_UNIT_FIELDS = (
    "by",
    "climber",
    "coordinator",
    "delegate",
    "delegator",
    "ended_by",
    "leader",
    "missing_units",
    "owner",
    "to_units",
    "unit",
    "units",
    "unseen_by",
)
_WORDS: dict[str, Callable[[str], ExprValue]] = {**dict.fromkeys(_UNIT_FIELDS, _unit_said), "verdict": _truth_said}
"""Fields whose strings are printed as something else."""


def prepare() -> None:
    """Build all models now; else each is built when its head is first read, which takes a few milliseconds."""
    for kind in _CONTENTS.values():
        kind.model_rebuild()


def is_lasting(head: str) -> bool:
    """Whether requests that begin with `head` live until they are cancelled."""
    kind = _CONTENTS.get(head)
    return kind is not None and kind.lasting


def read(expr: Expr) -> Content:
    """The content of an expression.

    Raises:
        ContentError: its head or a parameter is unknown, missing, or not what it should be; the message names it.
    """
    kind = _CONTENTS.get(expr.head)
    if kind is None:
        raise ContentError(f"({expr.head} ...) is not understood here")
    try:
        return kind.model_validate(dict(expr.arguments))
    except ValidationError as wrong:
        raise ContentError(f"({expr.head} ...): {in_words(wrong)}"[:400]) from None


def in_words(wrong: ValidationError) -> str:
    """The error of a content, with the parameter."""
    first = wrong.errors(include_url=False, include_input=False)[0]
    place = ".".join(str(step) for step in first["loc"])
    message = first["msg"].removeprefix("Value error, ")
    more = f" (and {wrong.error_count() - 1} more)" if wrong.error_count() > 1 else ""
    return f"{f'{place}: ' if place else ''}{message}{more}"
