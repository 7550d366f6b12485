"""With which code a command exits that ends by an error: 2 the call is wrong, 1 the answer is no, 3 something failed."""

from dyknow.model import errors

DONE, NO, WRONG, FAILED, INTERRUPTED = 0, 1, 2, 3, 130

_NO = (errors.NothingFound, errors.UnknownLabel, errors.Refused)
_WRONG = (
    *(errors.WrongCall, errors.TextError, errors.ChronicleError, errors.UnitError, errors.NameRefused),
    *(errors.PolicyError, errors.ContentError, errors.RosterError, errors.RoadsError, errors.DecodeError),
)


def exit_code(error: errors.DyknowError) -> int:
    """The exit code of a command that ends by `error`; an error that is not the caller's counts as a failure."""
    return NO if isinstance(error, _NO) else WRONG if isinstance(error, _WRONG) else FAILED
