"""What the site makes of a page that is written to be read in the repository as well.

A fence names the file that it includes, ```kpl examples/cars.kpl, which becomes its title; links to files that are no
pages become their names.
"""

import re
from typing import Any

_FENCE = re.compile(r"^```(\w+) ([^\n`]+)$", re.MULTILINE)
_OUTSIDE = re.compile(r"\[([^\]]+)\]\(\.\./[^)]+\)")


def on_page_markdown(markdown: str, **_about: Any) -> str:
    """The text of a page as the site has it."""
    return _OUTSIDE.sub(r"\1", _FENCE.sub(_titled, markdown))


def _titled(found: "re.Match[str]") -> str:
    language, about = found.groups()
    return f'```{language} title="{about}"' if "/" in about else f"```{language}"
