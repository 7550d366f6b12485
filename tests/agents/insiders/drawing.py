"""Contents drawn from the models of all speech acts: each is understood, and as odd as its model lets it be."""

from random import Random
from types import NoneType, UnionType
from typing import Annotated, Any, Final, Literal, Union, get_args, get_origin

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from dyknow.federation.messages import contents
from dyknow.federation.messages.contents import parts
from dyknow.federation.messages.sexpr import Expr
from dyknow.model.values import NO_VALUE, NoValue

TRIES: Final = 40
_EDGES: Final = (0, 1, -1, 2, 3, 17, 2**31, 2**53, 2**62, 2**63 - 1, -(2**63), 10**13, 10**15, 1_700_000_003_000_000)
_REALS: Final = (
    0.0, -0.0, 1.0, -1.0, 0.1, 0.5, 1e-300, 5e-324, -1e-12, 1e-6, 1e-3, 2.5, 20.0, 45.0, 100.0, 3600.0, 86_400.0, 1e6,
    1e12, -1e12, 1e30, 1e100, -1e200, 1e303, 1.7e308, 55.725, 58.0, 13.46, 15.0,
)  # fmt: skip
_CORNERS: Final = (
    "55.725 13.458", "55.7253 13.459", "55.7247 13.460", "58 15", "58.001 15", "58.001 15.001", "58 15.001", "0 0",
    "90 180", "-90 -180", "89.9999 0", "58.0000001 15", "1e-300 1e-300", "58.002 15.001", "58.0005 15.0005",
)  # fmt: skip
_FORMULAS: Final = (
    "always forall u in units: distance_xy[self,u] > 10", "heli-altitude[self] > 1/0", "true", "(", "eventually false",
    "heli-altitude[self] > 10", "always (heli-altitude[0] > 1)", "((((((((((a[1] > 2))))))))))", "not " * 60 + "a[b] > 1",
    "a[self] > 1e308 * 1e308", "chronicle c { occurs(1, 2, a[?x], (t, t)) }", "stream s = a[self]", "source a b", "",
    "heli-altitude[0]", "speed[self]", "colour[s] = 1", "#objects", "#goal", "strmgen x = heli-altitude[self]",
    "always[0, 1e18 s] a[b] > 1", "[" * 300, "{" * 300, "forall x in units: " * 50 + "true", "a -> " * 300 + "a[b] > 1",
)  # fmt: skip
_POLICIES: Final = (
    "sample every 100", "from 0, sample every 100, max delay 100", "newest", "sample every 1us", "any change", "",
    "from 0, sample every 1us, max delay 1us, use linear", "from 0, sample every 100, max delay 100, use most recent",
    "from 0, to 1, sample every 0.001", "sample every 4611686018427387904us", "predict 1h, sample every 100",
)  # fmt: skip
_WORDS: Final = (
    "proximity", "proximity-warn", "goto", "take-off", "land", "hold", "climb", "gps-loss", "battery-drain", "packet-loss",
    "kpl", "a", "s", "s1", "0:s1", "car1", "b1", "uav1", "wo1", "x" * 64, "é", "opened", "ß[?]", "dyknow-federation",
)  # fmt: skip
LASTING: Final = ("m1", "t", "2-x-1.2", "2-y-1.2", "2-x-2.0", "2-x-3.1", "obs-x-1.2", "cc-9-1.2", "cc-9-2.0")
"""Names of tasks by which a member delegates to itself, or others to it."""
_HASHES: Final = ("ab12cd34", "00000000", "ffffffff")
_LISTED: Final = {"leaders": 8, "chain": 4}
_CORNER_FIELDS: Final = frozenset({"corners", "area", "whole", "middle", "corner", "centre", "origin", "ahead"})
_UNIT_FIELDS: Final = frozenset({*parts._UNIT_FIELDS, "leaders", "chain", "members", "peer", "delegate"})


class Drawing:
    """Draws contents by chance from one seed.

    Args:
        units: names that units may have.
        labels: semantic labels that platforms know.

    Attributes:
        conversations: names of tasks, missions and calls that are used again and again.
        boots: lives that members have.
    """

    def __init__(self, random: Random, units: tuple[str, ...], labels: tuple[str, ...]) -> None:
        self.random, self._units, self._labels = random, units, labels
        self.conversations: list[str] = list(LASTING)
        self.boots: list[int] = [0]
        contents.prepare()
        self.kinds = [parts._CONTENTS[head] for head in sorted(parts._CONTENTS)]

    def content(self, kind: type[parts.ContentPart]) -> parts.ContentPart | None:
        """One that its model takes; None: none was found."""
        for _ in range(TRIES):
            fields = {
                name: self._field(name, field)
                for name, field in kind.model_fields.items()
                if field.is_required() or self.random.random() < 0.5
            }
            fields |= self._question(kind, fields)
            try:
                return kind.model_validate(fields)
            except ValidationError:
                continue
        return None

    def _question(self, kind: type[parts.ContentPart], fields: dict[str, Any]) -> dict[str, Any]:
        """A query needs the instants of its way of asking, and no others."""
        if kind not in {contents.Query, contents.QueryStream}:
            return {}
        needed = {"at": ("at_us",), "between": ("from_us", "to_us"), "nth": ("n",), "last": ("n",), "slice": ("i", "j")}
        wanted = needed.get(fields.get("op", "latest"), ())
        numbers = sorted(max(0, self._whole((), instant=True)) for _ in wanted)
        for name in ("at_us", "from_us", "to_us", "n", "i", "j", "select", "merge"):
            fields.pop(name, None)
        return dict(zip(wanted, numbers, strict=True))

    def _field(self, name: str, field: FieldInfo) -> Any:
        return self._value(name, field.annotation, tuple(field.metadata))

    def _value(self, name: str, kind: Any, metadata: tuple[Any, ...]) -> Any:
        origin, arguments = get_origin(kind), get_args(kind)
        if origin is Annotated:
            within = (one for each in arguments[1:] for one in getattr(each, "metadata", (each,)))
            return self._value(name, arguments[0], (*metadata, *within))
        if origin in {Union, UnionType}:
            return self._value(name, self.random.choice(arguments), metadata)
        if origin is Literal:
            return self.random.choice(arguments)
        if origin is tuple:
            return self._list(name, arguments, metadata)
        if origin is dict:
            size = self.random.choice((0, 1, 2, 5))
            return {self._value("word", arguments[0], ()): self._value(name, arguments[1], ()) for _ in range(size)}
        if kind is NoneType:
            return None
        if kind is NoValue:
            return NO_VALUE
        if kind is bool:
            return self.random.random() < 0.5
        if kind is int:
            if name in {"boot", "delegate_boot"} and self.random.random() < 0.7:
                return self.random.choice(self.boots)
            if name == "generation" and self.random.random() < 0.7:
                return self.random.randrange(1, 4)
            return self._whole(metadata, instant=name.endswith("_us"))
        if kind is float:
            return self._real(metadata)
        if kind is str:
            return self._text(name, metadata)
        if isinstance(kind, type) and issubclass(kind, parts.ContentPart):
            return self.content(kind)
        return self._expression()

    def _expression(self) -> Expr:
        found = self.content(self.random.choice(self.kinds))
        return Expr("hold") if found is None else found.expr()

    def _list(self, name: str, arguments: tuple[Any, ...], metadata: tuple[Any, ...]) -> tuple[Any, ...]:
        if arguments[-1] is not Ellipsis:
            return tuple(self._value(name, each, ()) for each in arguments)
        most = min(
            (each.max_length for each in metadata if getattr(each, "max_length", None)), default=_LISTED.get(name, 64)
        )
        size = most if self.random.random() < 0.02 else self.random.choice((0, 1, 1, 2, 3, 4, 5))
        found = tuple(self._value(name, arguments[0], ()) for _ in range(min(size, most)))
        if name in {"area", "whole", "corners"} and self.random.random() < 0.6:
            found = self.random.choice((_CORNERS[3:7], _CORNERS[:3], (*_CORNERS[3:6], "58.0005 15.0001")))
        return found * 2 if self.random.random() < 0.02 else found

    def _bounds(self, metadata: tuple[Any, ...]) -> list[float]:
        return [
            bound
            for each in metadata
            for side in ("ge", "gt", "le", "lt")
            if (bound := getattr(each, side, None)) is not None
        ]

    def _whole(self, metadata: tuple[Any, ...], *, instant: bool) -> int:
        if instant and self.random.random() < 0.5:
            return 1_700_000_000_000_000 + self.random.randrange(-(10**7), 10**8)
        edges = [int(bound) + self.random.choice((-1, 0, 1)) for bound in self._bounds(metadata)]
        return self.random.choice((*_EDGES, *edges, self.random.randrange(8)))

    def _real(self, metadata: tuple[Any, ...]) -> float:
        bounds = self._bounds(metadata)
        if len(bounds) > 1 and self.random.random() < 0.4:
            return self.random.uniform(min(bounds), max(bounds))
        return self.random.choice((*_REALS, *map(float, bounds)))

    def _text(self, name: str, metadata: tuple[Any, ...]) -> str:
        random = self.random
        if name in _CORNER_FIELDS:
            return random.choice(_CORNERS)
        if name in _UNIT_FIELDS:
            return random.choice(self._units)
        if "label" in name or name == "sensor":
            return random.choice(self._labels)
        if name in {"task", "mission", "conversation", "call"} and random.random() < 0.9:
            return random.choice(self.conversations)
        if name == "hash":
            return random.choice(_HASHES)
        if name == "policy":
            return random.choice(_POLICIES)
        if name in {"agents", "delegator", "sender"}:
            return f"interface@{random.choice(self._units)}"
        if name in {"text", "condition", "stream", "description", "domain", "problem", "constraints", "part", "within"}:
            return random.choice(_FORMULAS)
        pool = (*_WORDS, *self._labels, *self.conversations[-3:], *self._units, *_FORMULAS[:4], "")
        return random.choice(pool) if random.random() < 0.95 else "x" * random.choice((63, 65, 1024, 1025, 4096, 8192))
