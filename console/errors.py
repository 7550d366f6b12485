"""How a command fails: what to say, and with which code to exit.

* DyknowError
  + WrongCall         the call is wrong: exit 2
  + NothingFound      the answer is no: exit 1
  + FederationFailed  the federation or a platform failed: exit 3
"""

from difflib import get_close_matches

from dyknow.errors import (
    ChronicleError,
    ContentError,
    DyknowError,
    NameRefused,
    PolicyError,
    RosterError,
    TextError,
    UnitError,
    UnknownLabel,
)

DONE, NO, WRONG, FAILED, INTERRUPTED = 0, 1, 2, 3, 130


class WrongCall(DyknowError):
    """An option, argument or file that the person can mend; the message says where and how."""


class NothingFound(DyknowError):
    """The command worked and the answer is no: nothing found, nobody answered."""


class FederationFailed(DyknowError):
    """A platform or the federation did not do what it should have."""


_CODES: tuple[tuple[type[DyknowError], int], ...] = (
    (NothingFound, NO),
    (UnknownLabel, NO),
    (WrongCall, WRONG),
    (TextError, WRONG),
    (ChronicleError, WRONG),
    (UnitError, WRONG),
    (NameRefused, WRONG),
    (PolicyError, WRONG),
    (ContentError, WRONG),
    (RosterError, WRONG),
)


def exit_code(error: DyknowError) -> int:
    """The code a command exits with when it ends by `error`; whatever is not the caller's fault is a failure."""
    return next((code for kind, code in _CODES if isinstance(error, kind)), FAILED)


def did_you_mean(given: str, known: tuple[str, ...] | list[str]) -> str:
    """A remedy for an unknown name: the closest known one, else all of them; begins with a blank where not empty."""
    if not known:
        return ""
    close = get_close_matches(given, known, n=1, cutoff=0.6)
    return f" Did you mean {close[0]!r}?" if close else f" Known: {', '.join(sorted(known))}."
