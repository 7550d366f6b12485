"""Texts of contents, read back by the product's reader."""

from dyknow.federation.messages.sexpr import Expr, ExprReader, ExprValue


def parse_value(text: str) -> ExprValue:
    """Read one value, to its end."""
    reader = ExprReader(text)
    value = reader.value()
    reader.end()
    return value


def parse_expr(text: str) -> Expr:
    """Read one expression, as `(monitor-proximity)`."""
    value = parse_value(text)
    if not isinstance(value, Expr):
        raise ExprReader(text).wrong("an expression is needed here", at=0, repair="(head name: value ...)")
    return value
