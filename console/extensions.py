"""Commands of extensions: of the modules that a call names, and of the installed ones.

An extension is a module with `COMMANDS`, a table like the one in `dyknow.console.main`. It is named
with `--extension MODULE`, `DYKNOW_EXTENSIONS` or `extensions = [...]` in a TOML file, by its module or by its name in the
entry-point group `dyknow.extensions`.
"""

from collections.abc import Sequence
from importlib.metadata import entry_points
from itertools import pairwise
from pathlib import Path

from dyknow.console.command import CommandTable, search_working_directory
from dyknow.runtime.configuration.settings import load

GROUP = "dyknow.extensions"


def extension_commands(arguments: Sequence[str]) -> CommandTable:
    """The commands of extensions, for a call whose `arguments` are not parsed yet.

    Raises:
        WrongCall: the settings are wrong.
        UnitError: an extension does not load.
    """
    flags: dict[str, object] = {}
    if federations := _values(arguments, "--federation"):
        flags["federation"] = federations[-1]
    if given := _values(arguments, "--extension"):
        flags["extensions"] = given
    config = [Path(value) for value in _values(arguments, "--config")]
    settings = load(flags, config[-1] if config else None)
    named = [*settings.extensions, *(each.name for each in entry_points(group=GROUP))]
    if not named:
        return {}
    from dyknow.agents.extensions import load_extension

    search_working_directory()
    modules = [load_extension(name).module for name in named]
    return {name: entry for module in modules for name, entry in getattr(module, "COMMANDS", {}).items()}


def _values(arguments: Sequence[str], option: str) -> list[str]:
    """The values of an option, `--option VALUE` or `--option=VALUE`."""
    apart = [value for name, value in pairwise(arguments) if name == option]
    return apart + [each.removeprefix(f"{option}=") for each in arguments if each.startswith(f"{option}=")]
