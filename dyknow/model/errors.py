"""Everything this project raises on purpose; a message says place, cause and remedy.

* DyknowError
  + PolicyError         constraints that cannot hold together
  + UnknownLabel        no stream generator carries the label
  + LabelAlreadyExists  a stream generator carries the label already
  + PrototypeExists     a prototype has the name already
  + UnknownPrototype    no prototype has the name
  + WrongNumberOfInputs a unit takes another number of streams
  + PolicyNotSupported  a process cannot provide its output so
  + ValueNotAvailable   a generator has no sample that answers the question
    + TooEarly          a stream cannot begin so far in the past
  + SortError           a value is not of the sort its stream declares
  + UnitError           a computational unit or source that is not found, or does not load
  + TextError           a text of ours (formula, policy, label, duration, act) does not parse or check
    + TextErrors        several of them in one text
  + ChronicleError      a chronicle that no events could satisfy, or that cannot be recognised as it is written
  + RoadsError          a road network that cannot be read as it is written
  + NameRefused         a unit, semantic label or conversation id that must not become part of a key
  + DecodeError         bytes from outside that are malformed, oversized or mistyped
  + ContentError        an act whose content this agent does not understand
  + Refused             a request that is understood and declined; `reason` goes to the requester
  + SpecificationFailed a platform's specification or feed cannot be read, or is wrong
  + SessionFailed       the session with other platforms does not open
  + EndpointFailed      the endpoint at which a vehicle is to be heard does not open
  + RosterError         a roster that does not load, or a key that is not in it
  + WrongCall           an option or argument that its caller can correct
  + NothingFound        the answer is no: no such platform or label, or no platform answered
  + FederationFailed    a platform or the federation did not do what it should have
"""

from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any, Protocol, Self


class DyknowError(Exception):
    """Catch this to catch them all; never raise it directly."""


class PolicyError(DyknowError):
    """A policy asks for something no stream could satisfy; `repair` is what could be written instead."""

    def __init__(self, message: str, repair: str = "") -> None:
        self.repair = repair
        super().__init__(message)


class UnknownLabel(DyknowError):
    """`label` has no producer here; `known` is what a refusal can offer instead."""

    def __init__(self, label: str, known: tuple[str, ...]) -> None:
        self.label, self.known = label, known
        super().__init__(f"no stream generator for {label!r}; this node has {', '.join(known) or 'none'}")


class LabelAlreadyExists(DyknowError):
    """A second generator for `label` was refused: labels are unique within an instance (thesis 9.3)."""

    def __init__(self, label: str) -> None:
        self.label = label
        super().__init__(f"a stream generator for {label!r} exists already; remove it first")


class PrototypeExists(DyknowError):
    """A second prototype under one name was refused (thesis 5.4.1)."""

    def __init__(self, name: str) -> None:
        self.name = name
        super().__init__(f"a prototype called {name!r} exists already; remove it first")


class UnknownPrototype(DyknowError):
    """Nothing can be made from `name` (thesis 5.4.1)."""

    def __init__(self, name: str, known: tuple[str, ...]) -> None:
        self.name, self.known = name, known
        super().__init__(f"no prototype is called {name!r}; there are {', '.join(known) or 'none'}")


class WrongNumberOfInputs(DyknowError):
    """The number of streams is not the arity of the prototype (thesis 5.3.1)."""

    def __init__(self, name: str, arity: int, given: int) -> None:
        self.arity, self.given = arity, given
        super().__init__(f"{name} takes {arity} streams, not {given}")


class PolicyNotSupported(DyknowError):
    """A process cannot provide its output under this policy (thesis 5.3.1)."""


class ValueNotAvailable(DyknowError):
    """The stream holds no sample that answers (thesis 5.3.2)."""


class TooEarly(ValueNotAvailable):
    """A stream cannot begin at `from_us`, but at `earliest_us` at the earliest.

    Attributes:
        what: the stream, and its producer if that is another process.
    """

    def __init__(self, label: object, from_us: int, earliest_us: int, made_by: str = "") -> None:
        self.from_us, self.earliest_us = from_us, earliest_us
        self.what = f"{label} is made by {made_by} and" if made_by else f"{label}"
        super().__init__(f"{self.what} cannot begin at {from_us} us: the earliest possible time is {earliest_us} us")


class SortError(DyknowError):
    """A value does not belong to the sort of its stream."""


class Spot(Protocol):
    """Where something stands in a text: line and column from 1, width in characters."""

    @property
    def line(self) -> int: ...
    @property
    def column(self) -> int: ...
    @property
    def width(self) -> int: ...


WIDEST = 66
"""Most characters of a line that are drawn."""


class UnitError(DyknowError):
    """No prototype, or more than one, has the requested name, or its module does not load."""


class SourceText(str):
    """A text that knows the file it is from; errors about it say so."""

    __slots__ = ("file",)
    file: str

    def __new__(cls, text: str, file: str = "") -> Self:
        made = super().__new__(cls, text)
        made.file = file
        return made


def file_of(text: str) -> str:
    """The file a text is from; empty if it is not known."""
    return text.file if isinstance(text, SourceText) else ""


class TextError(DyknowError):
    """A text of a user is wrong: where, what was expected, and the repair.

    Attributes:
        text: the whole text; line and column count from 1; `width` is how many characters the caret covers.
        file: if it is not given, that of the text.
    """

    def __init__(
        self,
        message: str,
        *,
        text: str = "",
        line: int = 1,
        column: int = 1,
        width: int = 1,
        repair: str = "",
        file: str = "",
    ) -> None:
        self.message, self.text, self.line, self.column = message, text, line, column
        self.width, self.repair, self.file = max(1, width), repair, file or file_of(text)
        super().__init__(self.drawn())

    @classmethod
    def at(cls, spot: Spot, message: str, *, text: str = "", repair: str = "", file: str = "") -> "TextError":
        """The error at a node of a syntax tree, or at whatever else knows where it stands."""
        line, column, width = spot.line, spot.column, spot.width
        return TextError(message, text=text, line=line, column=column, width=width, repair=repair, file=file)

    @classmethod
    def at_offset(
        cls, text: str, offset: int, message: str, *, width: int = 1, repair: str = "", file: str = ""
    ) -> "TextError":
        """The error at `offset` characters from the beginning of `text`."""
        line, column = text.count("\n", 0, offset) + 1, offset - text.rfind("\n", 0, offset)
        return TextError(message, text=text, line=line, column=column, width=width, repair=repair, file=file)

    @property
    def about(self) -> dict[str, Any]:
        """Everything but the message, as the constructor takes it."""
        return {name: getattr(self, name) for name in ("text", "line", "column", "width", "repair", "file")}

    def but(self, **changed: Any) -> "TextError":
        """The same error with other attributes."""
        return TextError(changed.pop("message", self.message), **{**self.about, **changed})

    def drawn(self) -> str:
        """The message with the line in question, a caret and the repair."""
        place = f"{self.file}:{self.line}:{self.column}: " if self.file else f"{self.line}:{self.column}: "
        parts = [f"{place}{self.message}"]
        lines = self.text.splitlines()
        if 1 <= self.line <= len(lines):
            parts += _pointed(lines[self.line - 1], self.column - 1, self.width)
        if self.repair:
            parts.append(f"    write: {self.repair}")
        return "\n".join(parts)


def _pointed(line: str, at: int, width: int) -> list[str]:
    """A line and a caret under the place in question; of a long line the part around it."""
    if len(line) <= WIDEST:
        return [f"    {line}", " " * (4 + at) + "^" * width]
    start = max(0, min(at - WIDEST // 3, len(line) - WIDEST))
    shown = line[start : start + WIDEST]
    before, after = "..." if start else "", "..." if start + WIDEST < len(line) else ""
    room = max(1, start + WIDEST - at)
    return [f"    {before}{shown}{after}", " " * (4 + len(before) + at - start) + "^" * min(width, room)]


class Unmade(TextError):
    """Nothing makes a label that a text takes, and nothing that is made is called nearly so: it may yet come."""

    def __init__(self, told: TextError, label: str) -> None:
        self.label = label
        super().__init__(told.message, **told.about)


class TextErrors(TextError):
    """All errors of one text; the place is that of the first of `errors`."""

    def __init__(self, errors: tuple[TextError, ...]) -> None:
        self.errors = errors
        super().__init__(errors[0].message, **errors[0].about)

    def drawn(self) -> str:
        """Each of them drawn, in the order of the text."""
        return "\n".join(error.drawn() for error in self.errors)


class ChronicleError(DyknowError):
    """A chronicle whose times contradict each other, or that names what is not declared (thesis 8.3)."""


class RoadsError(DyknowError):
    """A road network that is wrong; each of `problems` names the feature, the cause and the remedy."""

    def __init__(self, problems: tuple[str, ...], file: str = "", left_out: int = 0) -> None:
        self.problems, self.file = problems, file
        place, more = f"{file}: " if file else "", len(problems) + left_out - 5
        lines = [f"{place}{each}" for each in problems[:5]] + [f"and {more} more"] * (more > 0)
        super().__init__("\n".join(lines))


class NameRefused(DyknowError):
    """A name that cannot be one chunk of a key."""


class DecodeError(DyknowError):
    """Bytes from outside that are not one of our messages; `reason` is a short word counted in the audit log."""

    def __init__(self, reason: str, detail: str = "") -> None:
        self.reason = reason
        super().__init__(f"{reason}: {detail}" if detail else reason)


class ContentError(DyknowError):
    """The content of an act is unknown or mistyped: answered with not-understood."""


class Refused(DyknowError):
    """A request that is understood and declined: answered with refuse.

    Attributes:
        reason: for users.
        code: for programs, e.g. `led-by`; docs/errors.md has all of them.
        leader, generation: of the task, with `led-by`.
    """

    def __init__(self, reason: str, code: str, *, leader: str | None = None, generation: int | None = None) -> None:
        self.reason, self.code, self.leader, self.generation = reason, code, leader, generation
        super().__init__(reason)


class RosterError(DyknowError):
    """A roster that does not load, or a platform or key it does not hold."""


class SpecificationFailed(DyknowError):
    """A platform's specification cannot be read, or is wrong."""


class SessionFailed(DyknowError):
    """The session with other platforms does not open, or is not open."""


class EndpointFailed(DyknowError):
    """The endpoint at which a vehicle is to be heard does not open."""


class WrongCall(DyknowError):
    """An option, argument or file that its caller can correct; the message says where and how."""


class NothingFound(DyknowError):
    """The question was understood and the answer is no: nothing found, or no platform answered."""


class FederationFailed(DyknowError):
    """A platform or the federation did not do what it should have."""


def did_you_mean(given: str, known: Sequence[str]) -> str:
    """A remedy for an unknown name: the closest known one, else all of them; begins with a blank where not empty."""
    if not known:
        return ""
    close = get_close_matches(given, known, n=1, cutoff=0.6)
    return f" Did you mean {close[0]!r}?" if close else f" Known: {', '.join(sorted(known))}."


def raised(name: str, wrong: Exception) -> str:
    """The exception of a user's code, with its line, as far as that is known."""
    trace = wrong.__traceback__
    while trace is not None and _is_ours(trace.tb_frame.f_globals.get("__name__", "")):
        trace = trace.tb_next
    where = "" if trace is None else f" at {trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}"
    return f"{name} raised {wrong!r}{where}"


def _is_ours(module: str) -> bool:
    room, _, of_units = module.partition(".")
    return room == "dyknow" and of_units.partition(".")[0] not in {"compunits", "sim_uavs"}
