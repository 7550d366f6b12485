"""Formulas to text, with the parentheses they need and no others: parsing the text gives the formula back."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Final

from dyknow.model.instants import print_duration
from dyknow.reasoning.formulas import tree

EXPR, OR, AND, UNTIL, UNARY, COMPARISON, SUM, PRODUCT, FACTOR, PRIMARY = range(10)
"""Levels of the grammars, from the one that binds least."""
_LEVELS: Final[dict[type, int]] = {
    tree.Implies: EXPR,
    tree.Or: OR,
    tree.And: AND,
    tree.Until: UNTIL,
    **dict.fromkeys((tree.Not, tree.Always, tree.Eventually, tree.Forall, tree.Exists), UNARY),
    tree.Compare: COMPARISON,
    tree.Negate: FACTOR,
}


class ExpressionPrinter(ABC):
    """Prints what the grammars of specifications and of domains share; each adds its words and its own nodes."""

    words: ClassVar = {tree.Or: "or", tree.And: "and", tree.Not: "not "}
    equal: ClassVar = "="
    levels: ClassVar[dict[type, int]] = _LEVELS
    quantifiers: ClassVar[tuple[type, ...]] = (tree.Forall, tree.Exists)
    """Nodes that swallow what follows them."""

    def show(self, node: Any, level: int = EXPR, *, last: bool = True) -> str:
        """Text that stands where the grammar wants `level`; `last` if nothing follows that a quantifier would swallow."""
        fits = self._level(node) >= level and (last or not isinstance(node, self.quantifiers))
        return self._text(node, last=last) if fits else f"({self._text(node, last=True)})"

    def interval(self, lo_us: tree.Bound, hi_us: tree.Bound | None) -> str:
        if lo_us == 0 and hi_us is None:
            return ""
        return f"[{self.bound(lo_us)}, {'oo' if hi_us is None else self.bound(hi_us)}]"

    def bound(self, bound: tree.Bound) -> str:
        if not isinstance(bound, int):
            return self.show(bound, SUM, last=False)
        return print_duration(bound) if bound else "0"

    def left(self, node: Any, level: int) -> str:
        """A left operand of a connective."""
        return self.show(node, level, last=False)

    @abstractmethod
    def own(self, node: Any, *, last: bool) -> str:
        """A node that only one of the grammars has; a node at its end is `last` too."""

    def _level(self, node: Any) -> int:
        match node:
            case tree.Arithmetic(operator, _, _):
                return SUM if operator in "+-" else PRODUCT
            case tree.Const(value) if not isinstance(value, bool | str) and value < 0:
                return FACTOR
        return self.levels.get(type(node), PRIMARY)

    def _text(self, node: Any, *, last: bool) -> str:
        match node:
            case tree.Implies(left, right):
                return f"{self.left(left, OR)} -> {self.show(right, last=last)}"
            case tree.Or(parts):
                return self._joined(parts, self.words[tree.Or], AND, last=last)
            case tree.And(parts):
                return self._joined(parts, self.words[tree.And], UNTIL, last=last)
            case tree.Until(left, right, lo_us, hi_us):
                interval = self.interval(lo_us, hi_us)
                return f"{self.left(left, UNARY)} until{interval} {self.show(right, UNTIL, last=last)}"
            case tree.Not(operand):
                return f"{self.words[tree.Not]}{self.show(operand, UNARY, last=last)}"
            case tree.Always(operand, lo_us, hi_us):
                return f"always{self.interval(lo_us, hi_us)} {self.show(operand, UNARY, last=last)}"
            case tree.Eventually(operand, lo_us, hi_us):
                return f"eventually{self.interval(lo_us, hi_us)} {self.show(operand, UNARY, last=last)}"
            case tree.Compare(operator, left, right):
                sign = self.equal if operator == "=" else operator
                return f"{self.show(left, SUM, last=False)} {sign} {self.show(right, SUM, last=False)}"
            case tree.Arithmetic(operator, left, right):
                level = self._level(node)
                return f"{self.show(left, level, last=False)} {operator} {self.show(right, level + 1, last=False)}"
            case tree.Negate(operand):
                return f"-{self.show(operand, FACTOR, last=False)}"
            case tree.Const(bool(value)):
                return "true" if value else "false"
            case tree.Const(int(value) | float(value)):
                return repr(value)
            case tree.Duration(us):
                return print_duration(us)
        return self.own(node, last=last)

    def _joined(self, parts: tuple[Any, ...], word: str, level: int, *, last: bool) -> str:
        *before, end = parts
        return f" {word} ".join([*(self.left(each, level) for each in before), self.show(end, level, last=last)])


class _FormulaPrinter(ExpressionPrinter):
    def left(self, node: Any, level: int) -> str:
        """Always and eventually never stand there without parentheses."""
        return f"({self.show(node)})" if isinstance(node, tree.Always | tree.Eventually) else super().left(node, level)

    def own(self, node: Any, *, last: bool) -> str:
        match node:
            case tree.Forall(variable, domain, body, growing) | tree.Exists(variable, domain, body, growing):
                word = "forall" if isinstance(node, tree.Forall) else "exists"
                grows = " growing" if growing else ""
                return f"{word} {variable} in {_domain(domain)}{grows}: {self.show(body, last=last)}"
            case tree.Abs(operand):
                return f"abs({self.show(operand)})"
            case tree.Const(value, quoted):
                return f'"{value}"' if quoted else str(value)
            case tree.Variable(name):
                return name
            case tree.Now():
                return "now"
            case tree.Since(feature):
                return f"since({feature.label})"
            case tree.Occurred(event):
                return f"occurred({event.label})"
            case tree.Feature():
                return node.label
        raise TypeError(f"{type(node).__name__} is no formula")


_PRINTER: Final = _FormulaPrinter()


def print_formula(formula: tree.Formula) -> str:
    """The formula as it is typed, on one line."""
    return _PRINTER.show(formula)


def _domain(domain: tree.Domain) -> str:
    return " - ".join(_set(one) for one in (domain.base, *domain.minus))


def _set(found: tree.DomainSet) -> str:
    if isinstance(found, str):
        return found
    return f"{{{', '.join(one if isinstance(one, str) else one.name for one in found)}}}"
