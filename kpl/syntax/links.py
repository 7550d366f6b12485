"""Links as they are typed: with their three conditions, or without any where those of the unit are ready."""

from collections.abc import Sequence
from typing import Any, Final

from dyknow import Label
from dyknow.kpl.syntax import specification as spec
from dyknow.kpl.syntax.link_options import LINK_OPTIONS, LinkOptions, read_options
from dyknow.kpl.syntax.parsing import FormulaReader
from dyknow.reasoning.formulas.tree import Const, Place

LINKED: Final = frozenset({"from", "to"})
"""The names of both objects in conditions."""


def read_link(reader: FormulaReader, source: Label, name: str, rest: Sequence[Any], place: Place) -> spec.Link:
    """`link(LABEL, UNIT)` or `link(LABEL, UNIT, E, R, M)`, and options; errors are noted with their places."""
    from dyknow.anchoring.ready import READY_CONDITIONS

    options = [each for each in rest if getattr(each, "data", "") == "link_option"]
    typed = tuple(reader.read(each, LINKED) for each in rest if each not in options)
    if not typed and name not in READY_CONDITIONS:
        repair = f"link({source}, {name}, eventually[1s, oo] true, eventually[0, 1s] xy_dist[from, to] < 5, true)"
        reader.error(f"no conditions are ready for {name}: a link to it has three", place, repair)
    establish, reestablish, maintain = typed or READY_CONDITIONS.get(name, (Const(value=True),) * 3)
    made = LinkOptions(**read_options(reader, options, LINK_OPTIONS))
    return spec.Link(source, name, establish, reestablish, maintain, made, is_ready=not typed, place=place)
