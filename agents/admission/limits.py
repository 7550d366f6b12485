"""How much text and how many streams one peer may bring."""

from typing import Any

from dyknow.federation.messages.sexpr import Expr

STREAMS_PER_PEER = 64
TEXT_PER_S, TEXT_BURST = 4096.0, 65_536.0
"""Characters of long texts that a peer may send: formulas take 8 us each to read."""
SHORT_TEXT = 200
"""Characters of a text that is not counted."""


def text_in(value: Any) -> int:
    """Characters of the long texts in a content."""
    if isinstance(value, str):
        return len(value) if len(value) > SHORT_TEXT else 0
    if isinstance(value, Expr):
        value = value.arguments
    if isinstance(value, dict):
        return sum(map(text_in, value.values()))
    return sum(map(text_in, value)) if isinstance(value, tuple) else 0
