"""In which order declarations are taken in, and how what goes wrong is told."""

from dyknow.errors import TextError, TextErrors
from kpl.specification import Declaration, Export, Import, MonitorDeclaration, StreamDeclaration


def rank(declaration: Declaration) -> int:
    """Makers first, then what goes to other platforms, then who takes the streams."""
    ranks = {Import: 1, Export: 2, StreamDeclaration: 3, MonitorDeclaration: 4}
    return ranks.get(type(declaration), 0)


def as_text_errors(wrong: BaseException, text: str, file: str) -> TextErrors:
    if isinstance(wrong, TextErrors):
        return wrong
    if isinstance(wrong, TextError):
        return TextErrors((wrong,))
    said = "a chain of streams is too long" if isinstance(wrong, RecursionError) else str(wrong)
    return TextErrors((TextError(said, text=text, file=file),))
