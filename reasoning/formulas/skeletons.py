"""A formula taken apart: its atoms, each a formula about one state, and the skeleton around them.

Negations are pushed down to the atoms; quantifiers over fixed domains become conjunctions and disjunctions. Equal parts
are one node, so that formulas of one skeleton, such as those of all pairs of UAVs, share all that is worked out for it.
"""

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, TypeAlias

from dyknow.model.errors import TextError
from dyknow.reasoning.formulas import tree
from dyknow.reasoning.formulas.evaluation import EvaluationCompiler

Kind: TypeAlias = Literal["atom", "constant", "and", "or", "always", "eventually", "until", "release", "growing"]
_DUAL: Final[dict[Kind, Kind]] = {"and": "or", "always": "eventually", "until": "release"}
DUAL: Final[dict[Kind, Kind]] = _DUAL | {other: kind for kind, other in _DUAL.items()}


class SkeletonNode(NamedTuple):
    """One node of a skeleton.

    `parts` are the numbers of the nodes inside; of an atom its own number and 1 if it is negated, of a constant its
    truth, of until and release the left and the right side, of a growing quantifier its number. Windows are microseconds, `hi_us` None without end.
    """

    kind: Kind
    parts: tuple[int, ...]
    lo_us: int = 0
    hi_us: int | None = None


class Skeleton(NamedTuple):
    """Nodes, those inside before those around them; the last one is the formula. `atoms` counts them."""

    nodes: tuple[SkeletonNode, ...]
    atoms: int


Binding: TypeAlias = tuple[tuple[str, str], ...]
"""Variables of quantifiers with the members that stand for them."""


class AtomOrigin(NamedTuple):
    """Where a node comes from: the formula that was written, whether it stands negated, and for which members."""

    formula: tree.Formula
    negated: bool
    binding: Binding


@dataclass(frozen=True, slots=True)
class TakenApart:
    """A skeleton, the atoms by number, and where each node comes from.

    Attributes:
        growing: the growing quantifiers over temporal bodies, by number, and whether each stands negated.
        is_deep: more than `LIMIT_CLAUSES` temporal operators stand inside one another.
    """

    skeleton: Skeleton
    atoms: tuple[tree.Formula, ...]
    origins: tuple[AtomOrigin, ...]
    growing: tuple[tuple[tree.Forall | tree.Exists, bool], ...] = ()
    is_deep: bool = False


LIMIT_CLAUSES: Final = 5
"""Measured: with six, the remainder of random formulas comes to 100 000 obligations within 25 states if distributed."""


def take_apart(formula: tree.Formula, domains: tree.Domains, compiler: EvaluationCompiler | None = None) -> TakenApart:
    """The skeleton of a formula over these domains; `compiler` bounds its size.

    Raises:
        TextError: if it expands beyond all limits, nests more than `LIMIT_TEMPORAL` temporal operators, or puts one inside
            a comparison.
        UnknownLabel: if a quantifier ranges over a domain that `domains` lacks.
    """
    depth, place = tree.deepest_temporal(formula)
    if depth > tree.LIMIT_TEMPORAL:
        raise TextError.at(place, tree.too_deep(depth), repair="say it with fewer of them")
    found = _Parts(compiler or EvaluationCompiler(domains))
    found.add(formula, negated=False, binding=())
    skeleton = Skeleton(tuple(found.nodes), len(found.atoms))
    return TakenApart(skeleton, tuple(found.atoms), tuple(found.origins), tuple(found.growing), depth > LIMIT_CLAUSES)


class _Parts:
    def __init__(self, compiler: EvaluationCompiler) -> None:
        self.nodes: dict[SkeletonNode, int] = {}
        self.atoms: dict[tree.Formula, int] = {}
        self.origins: list[AtomOrigin] = []
        self.growing: dict[tuple[tree.Forall | tree.Exists, bool], int] = {}
        self._compiler = compiler

    def add(self, formula: tree.Formula, *, negated: bool, binding: Binding) -> int:
        self._compiler.count()
        part = self._part(formula, negated, binding)
        if isinstance(part, int):
            return part
        known = self.nodes.setdefault(part, len(self.nodes))
        if known == len(self.origins):
            self.origins.append(AtomOrigin(formula, negated, binding))
        return known

    def _part(self, formula: tree.Formula, negated: bool, binding: Binding) -> SkeletonNode | int:
        if not tree.is_temporal(formula):
            return self._atom(formula, negated, binding)
        match formula:
            case tree.Not(operand):
                return self.add(operand, negated=not negated, binding=binding)
            case tree.And(parts):
                return self._joined("and", parts, negated, binding)
            case tree.Or(parts):
                return self._joined("or", parts, negated, binding)
            case tree.Implies(left, right):
                ends = (
                    self.add(left, negated=not negated, binding=binding),
                    self.add(right, negated=negated, binding=binding),
                )
                return self._node("or", ends, negated)
            case tree.Always(operand, lo_us, hi_us):
                inside = (self.add(operand, negated=negated, binding=binding),)
                return self._node("always", inside, negated, lo_us, hi_us)
            case tree.Eventually(operand, lo_us, hi_us):
                inside = (self.add(operand, negated=negated, binding=binding),)
                return self._node("eventually", inside, negated, lo_us, hi_us)
            case tree.Until(left, right, lo_us, hi_us):
                sides = (
                    self.add(left, negated=negated, binding=binding),
                    self.add(right, negated=negated, binding=binding),
                )
                return self._node("until", sides, negated, lo_us, hi_us)
            case tree.Forall() | tree.Exists():
                return self._quantified(formula, negated, binding)
        raise TextError(
            "a temporal operator stands inside a comparison or a calculation",
            line=formula.place.line,
            column=formula.place.column,
            repair="compare values, and put the temporal operator around the comparison",
        )

    def _atom(self, formula: tree.Formula, negated: bool, binding: Binding) -> SkeletonNode:
        while isinstance(formula, tree.Not):
            formula, negated = formula.operand, not negated
        if isinstance(formula, tree.Const) and isinstance(formula.value, bool):
            return SkeletonNode("constant", (formula.value is not negated,))
        if binding and isinstance(formula, tree.Forall | tree.Exists):
            self._compiler.test(formula)  # counts what it expands to
        return SkeletonNode("atom", (self.atoms.setdefault(formula, len(self.atoms)), int(negated)))

    def _joined(
        self, kind: Kind, parts: tuple[tree.Formula, ...], negated: bool, binding: Binding
    ) -> SkeletonNode | int:
        return self._node(kind, tuple([self.add(one, negated=negated, binding=binding) for one in parts]), negated)

    def _quantified(self, formula: tree.Forall | tree.Exists, negated: bool, binding: Binding) -> SkeletonNode | int:
        if formula.growing:
            return SkeletonNode("growing", (self.growing.setdefault((formula, negated), len(self.growing)),))
        members = tree.domain_members(formula.domain, self._compiler.domains)
        parts = tuple(
            [
                self.add(
                    tree.instantiate(formula.body, formula.variable, one),
                    negated=negated,
                    binding=(*binding, (formula.variable, one)),
                )
                for one in members
            ]
        )
        return self._node("and" if isinstance(formula, tree.Forall) else "or", parts, negated)

    def _node(
        self, kind: Kind, parts: tuple[int, ...], negated: bool, lo_us: tree.Bound = 0, hi_us: tree.Bound | None = None
    ) -> SkeletonNode | int:
        for bound in (lo_us, hi_us):
            if bound is not None and not isinstance(bound, int):
                raise TextError.at(bound.place, "the bound is no time: it was not checked")
        if negated:
            kind = DUAL[kind]
        parts = tuple(dict.fromkeys(parts)) if kind in {"and", "or"} else parts
        return SkeletonNode(kind, parts, lo_us, hi_us)  # type: ignore[arg-type] # the loop made sure of it
