"""The page of all commands, made of what they say of themselves: `python -m docs.command_page` writes it."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, get_args

from dyknow.console.command import PANEL, loaded
from dyknow.console.main import COMMANDS

PAGE = Path(__file__).with_name("commands.md")
HEAD = """# Commands

All commands and their options, as `dyknow COMMAND --help` has them. Exit codes and the meaning of refusals: [errors by their
code](errors.md); the output of `--json`: [JSON](reference.md#json).
"""


def page() -> str:
    """The whole page."""
    parts, common = [HEAD], dict[str, tuple[str, str]]()
    for name, (where, summary) in COMMANDS.items():
        if not where:
            parts.append(f"## dyknow {name}\n\n{summary}\n")
            continue
        rows = list[tuple[str, str]]()
        for parameter in loaded(where, name).params:
            row = _row(parameter)
            if getattr(parameter, "rich_help_panel", None) == PANEL:
                common[row[0]] = row
            elif not row[0].startswith("`--help`"):
                rows.append(row)
        parts.append(f"{'###' if ' ' in name else '##'} dyknow {name}\n\n{summary}\n{_table(rows)}")
    parts.append(f"## Options of every command\n{_table(common.values())}")
    return "\n".join(parts)


def _row(parameter: Any) -> tuple[str, str]:
    """How an argument or option is written, and what it does."""
    if parameter.param_type_name == "argument":
        return f"`{parameter.metavar or parameter.name.upper()}`", _text(getattr(parameter, "help", None))
    is_flag = parameter.is_flag
    written = ", ".join(f"`{each}`" for each in (*parameter.opts, *parameter.secondary_opts))
    value = "" if is_flag else f" `{parameter.metavar or _choices(parameter.type_descriptor.annotation)}`"
    default = parameter.default
    shown = (
        f" Default: `{default}`." if isinstance(default, int | float | str) and not is_flag and default != "" else ""
    )
    return f"{written}{value}", _text(parameter.help) + shown


def _choices(annotation: Any) -> str:
    """What may be written: the choices there are, else the kind of value."""
    words = [each for part in (annotation, *get_args(annotation)) for each in get_args(part) if isinstance(each, str)]
    return "|".join(dict.fromkeys(words)) or "VALUE"


def _text(text: str | None) -> str:
    return re.sub(r"\s+", " ", text or "").replace("|", "\\|").replace("<", "&lt;")


def _table(rows: Iterable[tuple[str, str]]) -> str:
    lines = [f"| {written.replace('|', chr(92) + '|')} | {text} |" for written, text in rows]
    return "\n| option or argument | effect |\n|---|---|\n" + "\n".join(lines) + "\n" if lines else ""


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
