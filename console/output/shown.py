"""Text for a terminal: it is never markup, whatever its origin, and a style is given by `styled` alone.

No string is read as markup anywhere: no bracket, link or control character of another platform, a file or a log gets
to the terminal as a command.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.text import Text

Shown: TypeAlias = "str | Text"


def printable(text: str) -> str:
    r"""The text with every character that is not shown as `\x1b` or `\u202e`; tabs and ends of lines stay."""
    if text.isprintable():
        return text
    return "".join(char if char.isprintable() or char in "\n\t" else _escaped(char) for char in text)


def _escaped(char: str) -> str:
    code = ord(char)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


def styled(text: object, style: str) -> "Text":
    """The text in a style of ours, e.g. `bold red`."""
    from rich.text import Text

    return Text(printable(str(text)), style=style)


def line(*parts: Shown) -> "Text":
    """These parts, one after the other."""
    from rich.text import Text

    whole = Text()
    for part in parts:
        whole.append_text(as_text(part))
    return whole


def stacked(parts: Iterable[Shown]) -> "Text":
    """These parts, each in a line of its own."""
    from rich.text import Text

    return Text("\n").join(map(as_text, parts))


def as_text(shown: Shown) -> "Text":
    """The text as rich prints it."""
    from rich.text import Text

    return Text(printable(shown)) if isinstance(shown, str) else shown


def print_trimmed(console: "Console", shown: "RenderableType", **options: Any) -> None:
    """Print without the blanks with which lines are filled; on a terminal, where they are not seen, as it comes."""
    if console.is_terminal:
        console.print(shown, **options)
        return
    with console.capture() as captured:
        console.print(shown, **options)
    console.file.write("".join(f"{line.rstrip()}\n" for line in captured.get().splitlines()))
    console.file.flush()
