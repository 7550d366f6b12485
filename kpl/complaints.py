"""How what is wrong with declarations is told: at their place in the text, or of the running instance; with a repair."""

from collections.abc import Iterable
from difflib import get_close_matches

from dyknow.errors import TextError, Unmade
from kpl.listing import print_declaration
from kpl.specification import Declaration
from reasoning.formulas import Node

LONGEST_GUESS = 64
LONGEST_SAID = 300
MOST_GUESSES = 50


class Complaints:
    """Collects what is wrong with one text.

    Attributes:
        errors: so far.
        of: the declaration that is looked at; None: the text as a whole.
        is_old: whether it runs already, so that it is not in the text.
    """

    def __init__(self, text: str, file: str) -> None:
        self.errors: list[TextError] = []
        self.of: Declaration | None = None
        self.is_old = False
        self._text, self._file = text, file

    def wrong(self, message: str, node: Node, repair: str = "") -> None:
        self.errors.append(self.said(message, node, repair))

    def unmade(self, message: str, node: Node, label: object, meant: str, repair: str = "") -> None:
        """Something is missing that nothing there is meant by: it may yet come."""
        told = self.said(message, node, meant or repair or f"strmgen {label} = ..., before it")
        self.errors.append(told if meant else Unmade(told, str(label)))

    def closest(self, name: str, names: Iterable[object]) -> str:
        """What may have been meant; looked for while there are few errors, since it takes its time."""
        if len(name) > LONGEST_GUESS or len(self.errors) >= MOST_GUESSES:
            return ""
        every = list(map(str, names))
        feature = name.partition("[")[0]
        same = [each for each in every if each.partition("[")[0] == feature]
        return next(iter(get_close_matches(name, same, n=1, cutoff=0) or get_close_matches(name, every, n=1)), "")

    def said(self, message: str, node: Node, repair: str) -> TextError:
        message, repair = shortened(message), repair if len(repair) <= LONGEST_SAID else ""
        if self.is_old and self.of is not None:  # it is not in the text: what runs needs what is taken from it
            running = print_declaration(self.of)
            return TextError(
                f"{message}, which the running instance needs", text=running, width=len(running), repair=repair
            )
        return TextError.at(node.place, message, text=self._text, repair=repair, file=self._file)


def shortened(message: str) -> str:
    """A message without the middle of a name that is too long to be read."""
    return message if len(message) <= LONGEST_SAID else f"{message[: LONGEST_SAID - 100]}...{message[-90:]}"
