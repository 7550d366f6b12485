"""Mistakes people make in KPL specifications, as data; see mistakes.py. Those in formulas are the same as there."""

from typing import Final

from kpl.mistakes import MISTAKES, Mistake

_NOT_NEGATIVE: Final = "a time or a limit is not negative"
_STATEMENTS: Final = (
    Mistake(
        "objects stand in brackets after the feature",
        "pos[car1]",
        ("stream a = b c", "strmgen a = f(b c)", "strmgen a b = c"),
    ),
    Mistake(
        "an output is one stream, named by its label; what is to be computed is a generator",
        "strmgen sum = Add(speed[car1], speed[car2])",
        ("stream a = b + 3", "stream a = b[c] + 3", "stream a = b, c", "stream a = b[c], d", "stream a = b * 3"),
    ),
    Mistake(
        "a time is a number and us, ms, s, min or h; a number alone is milliseconds",
        "200ms",
        ("stream a = b with max delay 3 c", "stream a = b with sample every 3 c", "stream a = b with from 3 c"),
    ),
    Mistake(_NOT_NEGATIVE, "max delay 1000", ("stream a = b with max delay -3",)),
    Mistake(_NOT_NEGATIVE, "max deviation 2.0", ("stream a = b with max deviation -3",)),
    Mistake(_NOT_NEGATIVE, "sample every 200", ("stream a = b with sample every -3",)),
    Mistake(_NOT_NEGATIVE, "from 300 to 400", ("stream a = b with from -3 to 3", "stream a = b with from 3 to -3")),
    Mistake(
        "a duration ends with `to`",
        "from 300 to 400",
        ("stream a = b with from 3 until 5", "strmgen a = f(b with from 3 until 5)", "stream a = b with from 3 - 5"),
    ),
    Mistake(
        "a policy follows `with`",
        "pos[car1] with sample every 200",
        (
            "stream a = b sample every 3",
            "stream a = b max delay 3",
            "stream a = b use most recent",
            "stream a = b any change",
            "stream a = b no approximation",
            "stream a = b strict order",
            "stream a = b monotone order",
            "strmgen a = f(b sample every 3)",
            "strmgen a = f(b max delay 3)",
            "strmgen a = f(b use most recent)",
            "strmgen a = f(b any change)",
            "strmgen a = f(b no approximation)",
            "strmgen a = f(b strict order)",
            "strmgen a = f(b monotone order)",
            "strmgen a = f(b from 3 to 5)",
            "strmgen a[b] = f(b[c] sample every 3)",
            "strmgen a[b] = f(b[c] max delay 3)",
            "stream a = b[c] sample every 3",
            "stream a = b[c] max delay 3",
            "stream a = b from 3 to 5",
            "stream a = b[c] from 3 to 5",
            "stream a = b to 5",
            "stream a = b[c] to 5",
            "stream a = b min certainty 0.9",
            "stream a = b[c] min certainty 0.9",
            "stream a = b[c] any change",
            "stream a = b[c] use most recent",
            "stream a = b[c] monotone order",
            "stream a = b[c] strict order",
            "strmgen a[b] = f(b[c] from 3 to 5)",
            "strmgen a = state(b) sample every 3",
            "strmgen a = select b sample every 3 for c in d",
            "strmgen a = merge b max delay 3 for c in d",
        ),
    ),
    Mistake(
        "constraints are parted by commas",
        "with sample every 200, max delay 1000",
        (
            "stream a = b with sample every 3 max delay 4",
            "stream a = b with max delay 4 sample every 3",
            "stream a = b with any change max delay 3",
            "strmgen a = f(b with sample every 3 max delay 4)",
            "strmgen a = f(b with max delay 3 use most recent)",
            "stream a = b with strict order max delay 3",
            "stream a = b with use most recent sample every 3",
        ),
    ),
    Mistake(
        "constraints are parted by commas",
        "with sample every 200, max delay 1000",
        (
            "stream a = b with sample every 3 and max delay 4",
            "stream a = b with max delay 4 and sample every 3",
            "strmgen a = f(b with max delay 3 and sample every 3)",
        ),
    ),
    Mistake(
        "a sample period is a time",
        "sample every 200",
        (
            "stream a = b with sample 3",
            "stream a = b with sample c 3",
            "stream a = b with sample every",
            "stream a = b with every 3",
            "stream a = b with sample every oo",
        ),
    ),
    Mistake(
        "a duration begins with `from` and a time",
        "from 0 to 300",
        ("stream a = b with from oo to 3", "stream a = b with to 3 from 0", "stream a = b with from"),
    ),
    Mistake("a delay is a time or oo", "max delay 1000", ("stream a = b with delay 3", "stream a = b with max 3")),
    Mistake(
        "`use most recent` is the approximation by the most recent value",
        "use most recent",
        ("stream a = b with most recent", "stream a = b with use recent", "stream a = b with use most"),
    ),
    Mistake(
        "a source has a sort and a name",
        "source pos pos_car1",
        ("source pos", "source pos, a", "source pos = a", "source pos[a]", "source pos(a)", "source pos a[b]"),
    ),
    Mistake(
        "a computational unit has a sort, a name, and the sorts of its inputs",
        "compunit speed SpeedEst(pos)",
        (
            "compunit speed SpeedEst",
            "compunit speed SpeedEst pos",
            "compunit SpeedEst(pos)",
            "compunit speed S()",
            "compunit speed S = a",
        ),
    ),
    Mistake(
        "a stream generator is made from a source, or from a unit with its streams",
        "strmgen speed[car1] = SpeedEst(pos[car1])",
        ("strmgen a", "strmgen a[b] c", "strmgen a = ", "strmgen a = 3", "strmgen a = b[c]"),
    ),
    Mistake(
        "a unit takes streams, each by its label",
        "SpeedEst(pos[car1])",
        (
            "strmgen a = f b",
            "strmgen a = f b[c]",
            "strmgen a = f()",
            "strmgen a = f(3)",
            "strmgen a = f{b}",
            "strmgen a = state()",
        ),
    ),
    Mistake(
        "an output has a name without objects",
        "stream speed_car1 = speed[car1]",
        ("stream a[b] = c", "stream a(b) = c", "stream a.b = c"),
    ),
    Mistake(
        "an output is made from a label", "stream speed_car1 = speed[car1]", ("stream a", "stream a b", "stream a = 3")
    ),
    Mistake(
        "a semantic label stands alone; the stream that it names follows `=`",
        "export heli-position = pos[self]",
        ("export a[b] = c", "export a", "export a as b", "export a.b = c", "export a = 3"),
    ),
    Mistake(
        "an import names the semantic label, the unit it comes from, and the label it gets here",
        "import heli-position from 1 as pos[uav1]",
        (
            "import a",
            "import a from 1",
            "import a as b",
            "import a from b",
            "import a[b] from c",
            "import a from 1 = b",
            "import a = b",
        ),
    ),
    Mistake(
        "select and merge name a member and the stream of members",
        "merge pos[car] for car in car_ids",
        (
            "strmgen a = select b",
            "strmgen a = select b in c",
            "strmgen a = merge b[c] in d",
            "strmgen a = select b[c] in d",
            "strmgen a = merge b for c",
            "strmgen a = merge(b)",
            "strmgen a = merge b, c",
            "strmgen a = select(b)",
        ),
    ),
    Mistake(
        "a configuration names a member, the stream of members, and the generator of each",
        "for car in car_ids strmgen dist[car] = Distance(pos[car])",
        (
            "for a in b: strmgen c = d",
            "for a strmgen c = d",
            "for a in b stream c = d",
            "for each a in b",
        ),
    ),
    Mistake(
        "a link has a stream, a unit and three conditions",
        "link(vision_objects, Car, true, false, always on_road[from])",
        ("strmgen a = link(b)", "strmgen a = link(b, c)", "strmgen a = link(b, c, d)", "strmgen a = link(b, c, d, e)"),
    ),
    Mistake(
        "a monitor has a name without objects, and a formula after `=`",
        "monitor calm = always speed[self] < 5",
        (
            "monitor a",
            "monitor a always b",
            "monitor a not b",
            "monitor a forall b in c: d",
            "monitor a[b] = c",
            "monitor a: b",
            "monitor a b",
        ),
    ),
    Mistake("a definition has a formula after `=`", "define MIN_XY = 15.0", ("define a", "define a 3")),
    Mistake(
        "a chronicle file is named in quotes", 'chronicle file "overtake.chr"', ("chronicle a", "chronicle file a")
    ),
    Mistake(
        "a statement begins with source, compunit, strmgen, stream, for, export, import, define, monitor or chronicle",
        "strmgen pos[car1] = pos_car1",
        (
            "a",
            "a = b",
            "a b c",
            "with a",
            "3",
            "a[b] = c",
            "= a",
            "(a)",
            ", a",
            "and",
            "source a b,",
            "source a b c",
            "strmgen a = f(b) c",
            "strmgen a = f(b) c d = e",
        ),
    ),
)
_IN_MONITORS: Final = tuple(
    Mistake(one.message, one.repair, tuple(f"monitor m = {sample}" for sample in one.samples)) for one in MISTAKES
)
STATEMENT_MISTAKES: Final = (*_IN_MONITORS, *_STATEMENTS)
