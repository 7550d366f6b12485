"""Errors and warnings about declarations: at their place in the text, or in the running instance; with a repair."""

from collections.abc import Iterable

from dyknow.kpl.diagnostics.collector import ErrorCollector, nearest
from dyknow.kpl.syntax.listing import print_declaration
from dyknow.kpl.syntax.specification import Declaration
from dyknow.model.errors import TextError, Unmade
from dyknow.reasoning.formulas.tree import Node

LONGEST_NAME = 64
LONGEST_MESSAGE = 300
MOST_SUGGESTIONS = 50


class DeclarationErrors(ErrorCollector):
    """The errors of one specification.

    Attributes:
        of: the declaration that is checked; None: the text as a whole.
        is_old: whether it runs already, so that it is not in the text.
    """

    of: Declaration | None = None
    is_old = False

    def wrong(self, message: str, node: Node, repair: str = "") -> None:
        self.errors.append(self.located(message, node, repair))

    def unmade(self, message: str, node: Node, label: object, meant: str, repair: str = "") -> None:
        """Something is missing that nothing there is meant by: it may yet come."""
        error = self.located(message, node, meant or repair or f"strmgen {label} = ..., before it")
        self.errors.append(error if meant else Unmade(error, str(label)))

    def closest(self, name: str, names: Iterable[object]) -> str:
        """The nearest of `names`, as a suggestion; empty after many errors, since the comparison is slow."""
        if len(name) > LONGEST_NAME or len(self.errors) >= MOST_SUGGESTIONS:
            return ""
        every = list(map(str, names))
        feature = name.partition("[")[0]
        same = [each for each in every if each.partition("[")[0] == feature]
        return nearest(name, same, cutoff=0) or nearest(name, every)

    def located(self, message: str, node: Node, repair: str) -> TextError:
        message, repair = shortened(message), repair if len(repair) <= LONGEST_MESSAGE else ""
        if self.is_old and self.of is not None:  # not in this text: a running declaration that needs a removed one
            running = print_declaration(self.of)
            return TextError(
                f"{message}, which the running instance needs", text=running, width=len(running), repair=repair
            )
        return TextError.at(node.place, message, text=self.text, repair=repair)


def shortened(message: str) -> str:
    """A message without the middle of a name that is too long to be read."""
    return message if len(message) <= LONGEST_MESSAGE else f"{message[: LONGEST_MESSAGE - 100]}...{message[-90:]}"
