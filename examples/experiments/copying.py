"""The computational unit of the third experiment: each sample of its input is its output."""

from dyknow import value_unit


@value_unit("int", "int", name="CU")
def copied(value: int) -> int:
    """The same value, valid when the input is."""
    return value
