"""Execution flags (thesis 7.6.2): which operators are executed with which objects, at any valid time."""

from dataclasses import dataclass

from dyknow.planning.domains.sorts import EXECUTING

_KEPT_US = 60_000_000
"""So long after its end the flag of an action is known: states may come late."""


@dataclass(slots=True)
class _Execution:
    name: str
    objects: tuple[str, ...]
    from_us: int
    until_us: int | None = None


class ExecutionFlags:
    """A flag is true for the objects of its action, for fewer of them, and for all of them with the number of the step."""

    def __init__(self) -> None:
        self._executions: dict[int, _Execution] = {}

    def begin(self, step: int, operator: str, objects: tuple[str, ...], now_us: int) -> None:
        self._executions[step] = _Execution(f"{EXECUTING}{operator}", (*objects, str(step)), now_us)

    def end(self, step: int, now_us: int) -> None:
        """The flag is false from now on."""
        one = self._executions.get(step)
        if one is not None and one.until_us is None:
            one.until_us = now_us
        old_us = now_us - _KEPT_US
        ended = [key for key, each in self._executions.items() if each.until_us is not None and each.until_us < old_us]
        for key in ended:
            del self._executions[key]

    def value(self, label: str, valid_us: int) -> bool:
        """Of a flag's label at a time."""
        name, _, rest = label.partition("[")
        objects = tuple(rest.rstrip("]").split(", ")) if rest else ()
        return any(
            one.name == name
            and one.objects[: len(objects)] == objects
            and one.from_us <= valid_us
            and (one.until_us is None or valid_us < one.until_us)
            for one in self._executions.values()
        )

    def now(self) -> tuple[str, ...]:
        """Labels of the flags that are set."""
        return tuple(
            f"{one.name}[{', '.join(one.objects[:-1])}]" for one in self._executions.values() if one.until_us is None
        )


def is_flag(label: str) -> bool:
    return label.startswith(EXECUTING)
