"""Declarations as text for another process of this platform, and back: without the places of their nodes, which only messages need.

It is a pickle that can build declarations and formulas and nothing else: a platform that a journal is replayed to reads what a stranger
may have written.
"""

import io
import pickle
from base64 import b64decode, b64encode
from dataclasses import fields, is_dataclass
from typing import Any, Final, TypeVar

T = TypeVar("T")
_PLACE: Final = "place"
_MODULES: Final = {"planning.domains.model", "reasoning.formulas.tree", "dyknow.model.values"}


class _Packer(pickle.Pickler):
    """Values by their constructors: to set them field by field takes three times as long."""

    def reducer_override(self, value: Any) -> Any:
        if isinstance(value, type) or not is_dataclass(value):
            return NotImplemented
        given = [one for one in fields(value) if one.init and one.name != _PLACE]
        return type(value), tuple(getattr(value, one.name) for one in given)


def packed(value: object) -> str:
    """As text of one line."""
    written = io.BytesIO()
    _Packer(written, pickle.HIGHEST_PROTOCOL).dump(value)
    return b64encode(written.getvalue()).decode("ascii")


class _Unpacker(pickle.Unpickler):
    """Builds values of `kind`, declarations and formulas."""

    def __init__(self, text: str, kind: type) -> None:
        super().__init__(io.BytesIO(b64decode(text)))
        self._kind = kind

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == (self._kind.__module__, self._kind.__qualname__):
            return self._kind
        found = super().find_class(module, name) if module in _MODULES and "." not in name else None
        if isinstance(found, type) and found.__module__ == module:
            return found
        raise pickle.UnpicklingError(f"{module}.{name} is no declaration")


def unpacked(text: str, kind: type[T]) -> T:
    """What was packed.

    Raises:
        ValueError: it was not packed here, or is no `kind`.
    """
    try:
        found = _Unpacker(text, kind).load()
    except Exception as error:  # noqa: BLE001  (whatever bytes make of a constructor)
        raise ValueError(f"what was packed cannot be read: {error}") from None
    if not isinstance(found, kind):
        raise ValueError(f"what was packed is no {kind.__name__}")  # noqa: TRY004  (bad text, not a wrong call)
    return found
