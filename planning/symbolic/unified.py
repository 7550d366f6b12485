"""unified-planning, imported when it is used: it takes a second, and is an optional extra."""

from typing import Any

from dyknow.model.errors import WrongCall


def unified() -> Any:
    """The names of `unified_planning.shortcuts`, its engines silent.

    Raises:
        WrongCall: it is not installed.
    """
    try:
        from unified_planning import shortcuts
    except ImportError:
        raise WrongCall(
            'PDDL is read and written by unified-planning, which is not installed; pip install "dyknow[planning]"'
        ) from None
    shortcuts.get_environment().credits_stream = None
    return shortcuts
