"""JSON documents that commands read: from a file, or from standard input."""

import sys
from pathlib import Path

from dyknow.console.commands.texts.specification_files import STANDARD_INPUT
from dyknow.model.errors import WrongCall
from dyknow.proxies.files.named_files import opened_file


def read_document(path: Path) -> tuple[bytes, str]:
    """The bytes of a file, or of standard input if it is called `-`, and its name; raises WrongCall.

    A little more than is allowed is read, so that a document that is too long is refused by its reader.
    """
    from dyknow.documents.documents import LONGEST

    if str(path) == STANDARD_INPUT:
        return sys.stdin.buffer.read(LONGEST + 1), "standard input"
    try:
        with opened_file(path) as file:
            return file.read(LONGEST + 1), str(path)
    except OSError as error:
        raise WrongCall(
            f"{path} cannot be read ({error.strerror}); it is a JSON file, or - for standard input."
        ) from None


def as_text(source: bytes, name: str) -> str:
    """The text of a document; raises WrongCall."""
    try:
        return source.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise WrongCall(
            f"{name} is no UTF-8 text ({error.reason}); it is a text file, or - for standard input."
        ) from None
