"""Random formulas as people type them, with every operator there is, and random states for them.

A formula is drawn as a text; constants are named in it, so that reading it has to put them in. States come at every
period, with some left out, or at any times; values are missing, NaN or of another sort now and then.
"""

from hypothesis import strategies as st

from dyknow.kpl import FeatureType, Vocabulary
from dyknow.reasoning.formulas.tree import Duration
from tests.reasoning.meaning import State

MS = 1_000
UNIT_US = 100 * MS
MEMBERS = ("a", "b", "c")
VOCABULARY = Vocabulary(
    features={
        **{name: FeatureType(0, "boolean") for name in "pqr"},
        **{name: FeatureType(0, "number") for name in "xy"},
        **{name: FeatureType(1, "boolean") for name in "st"},
        "w": FeatureType(1, "number"),
        "near": FeatureType(2, "boolean"),
        "mode": FeatureType(),
    },
    objects=MEMBERS,
    domains=("fixed", "changing", "none"),
    constants={"LIMIT": 2, "HALF": 0.5, "SOON": Duration(2 * UNIT_US), "LATER": 300, "me": "a"},
)
DOMAINS = {"fixed": ("a", "b"), "changing": ("b",), "none": ()}
EVENTS = ("landed", "landed[a]", "landed[b]")
LO = ("0", "0", "0", "100", "SOON", "150", "1us")
HI = ("oo", "oo", "0", "100", "200ms", "LATER", "0.4s", "250", "99", "500")
IN_MS = {"0": 0, "1us": 0.001, "100": 100, "150": 150, "SOON": 200, "200ms": 200, "LATER": 300, "0.4s": 400, "250": 250,
         "99": 99, "500": 500, "oo": float("inf")}  # fmt: skip
SETS = ("fixed", "changing", "none", "{a, c}", "fixed - {me}", "{a, b, c} - changing", "fixed - {b} - none")


@st.composite
def intervals(draw):
    lo, hi = draw(st.sampled_from(LO)), draw(st.sampled_from(HI))
    if (lo, hi) == ("0", "oo"):
        return ""
    return f"[{lo}, {hi}]" if IN_MS[lo] <= IN_MS[hi] else f"[{lo}, oo]"


@st.composite
def typed_formulas(draw, depth=3, variables=(), growing=True):
    """A text in which every variable is bound."""

    def inside(names=variables):
        return f"({draw(typed_formulas(depth=depth - 1, variables=names, growing=growing))})"

    kind = draw(st.integers(0 if variables or depth < 3 else 3, 11)) if depth else 0
    if kind <= 1:
        return draw(atoms(variables))
    if kind == 2:
        return f"not {inside()}"
    if kind in {3, 4}:
        return f" {draw(st.sampled_from(['and', 'or']))} ".join(inside() for _ in range(draw(st.integers(2, 3))))
    if kind == 5:
        return f"{inside()} -> {inside()}"
    if kind in {6, 7}:
        return f"always{draw(intervals())} {inside()}"
    if kind in {8, 9}:
        return f"eventually{draw(intervals())} {inside()}"
    if kind == 10:
        return f"{inside()} until{draw(intervals())} {inside()}"
    variable = draw(st.sampled_from(["u", "v"]))
    where = draw(st.sampled_from([*SETS, *(f"fixed - {{{one}}}" for one in variables)]))
    grows = " growing" if growing and draw(st.booleans()) else ""
    body = inside(tuple({*variables, variable}))
    return f"{draw(st.sampled_from(['forall', 'exists']))} {variable} in {where}{grows}: {body}"


@st.composite
def nested_operators(draw, depth=3):
    """A text of operators within operators over p and q, in which obligations of many states meet."""
    if not depth or draw(st.integers(0, 5)) == 0:
        return draw(st.sampled_from(["p", "q", "not p", "not q"]))
    one, interval = f"({draw(nested_operators(depth - 1))})", draw(intervals())
    kind = draw(st.integers(0, 7))
    if kind <= 4:
        return f"{'always' if kind % 2 else 'eventually'}{interval} {one}"
    other = f"({draw(nested_operators(depth - 1))})"
    return f"{one} {['->', 'or', f'until{interval}'][kind - 5]} {other}"


@st.composite
def atoms(draw, variables=()):
    one, other = (draw(st.sampled_from([*variables, *variables, *MEMBERS, "me"])) for _ in range(2))
    kind = draw(st.integers(0, 13))
    if kind <= 5:
        return draw(st.sampled_from([*"pqrpqr", f"s[{one}]", f"t[{one}]", f"near[{one}, {other}]", "true"]))
    if kind == 6:
        return f"occurred({draw(st.sampled_from(['landed', f'landed[{one}]']))})"
    if kind == 7:
        left, right = ["mode", *variables], ['"idle"', "me", "b"]
        return " ".join(draw(st.sampled_from(each)) for each in (left, ["=", "!="], right))
    if kind <= 9:
        left, right = ["x", "y", f"w[{one}]"], ["1", "LIMIT", "0.5"]
    elif kind <= 11:
        left, right = [draw(numbers(one))], [draw(numbers(other))]
    elif kind == 12:
        left, right = [f"since({each})" for each in ("p", "x", f"s[{one}]", f"w[{one}]")], ["SOON", "100", "150ms", "0"]
    else:
        left, right = ["now", "now - SOON", "now - since(x)"], ["LATER * 1ms", "0.2s", "100"]
    return " ".join(draw(st.sampled_from(each)) for each in (left, ["<", "<=", "=", "!=", ">=", ">"], right))


@st.composite
def numbers(draw, one):
    plain = st.sampled_from(["x", "y", f"w[{one}]", "LIMIT", "HALF", "1", "-x", "abs(y)"])
    if draw(st.booleans()):
        return draw(plain)
    return f"({draw(plain)} {draw(st.sampled_from('+-*/'))} {draw(plain)})"


LABELS = ("p", "q", "r", *(f"{name}[{one}]" for name in "st" for one in MEMBERS))
PAIRS = tuple(f"near[{one}, {other}]" for one in MEMBERS for other in MEMBERS)
NUMBERS = ("x", "y", *(f"w[{one}]" for one in MEMBERS))


def changing_values(missing):
    """What features may be: two bits per feature keep drawing cheap."""
    odd = [float("nan"), "odd", float("inf")] if missing else [1, 2.5, 0]
    return [0, 1, 2, 3, 2, 1, 0.5, *odd]


@st.composite
def states(draw, count, missing=False):
    """Values, domains and events of states without their times."""
    found = []
    choices = changing_values(missing)
    for _ in range(count):
        bits, holes = draw(st.integers(0, 2**24 - 1)), draw(st.integers(0, 2**30 - 1)) if missing else 0
        values = {label: bool(bits >> at & 1) for at, label in enumerate((*LABELS, *PAIRS))}
        for at, label in enumerate(NUMBERS):
            values[label] = choices[(bits >> at * 3 & 15) % len(choices)]
        values["mode"] = draw(st.sampled_from(["idle", "a", "b"]))
        lacks = {label for at, label in enumerate(values) if holes >> at % 30 & 3 == 3}
        domains = DOMAINS | {"changing": tuple(one for at, one in enumerate(MEMBERS) if bits >> 18 + at & 1)}
        events = tuple(one for at, one in enumerate(EVENTS) if bits >> 21 + at & 1)
        found.append(({label: value for label, value in values.items() if label not in lacks}, domains, events))
    return found


@st.composite
def traces(draw, max_size=8, missing=False, irregular=None):
    """(states, period or None): with a period no state lies closer to another than that."""
    if irregular is None:
        irregular = draw(st.booleans())
    steps = st.sampled_from([UNIT_US, UNIT_US, UNIT_US, 2 * UNIT_US, 150 * MS, 5 * UNIT_US])
    if irregular:
        steps = st.integers(1, 3 * UNIT_US) | st.sampled_from([1, 50 * MS, 99 * MS, UNIT_US, 250 * MS])
    bare = draw(states(draw(st.sampled_from(range(max_size, 0, -1))), missing))
    at_us, found = draw(st.sampled_from([0, 0, 0, -UNIT_US, 37, 1_790_000_000_000_000])), []
    for values, domains, events in bare:
        found.append(State(at_us, values, domains, events))
        at_us += draw(steps)
    return found, None if irregular else draw(st.sampled_from([UNIT_US, None]))
