"""Wanted objects in running specifications: found by a description, and only by it."""

import pytest

from dyknow import Label
from dyknow.kpl import parse_specification, print_specification
from dyknow.kpl.checking.symbols import SymbolTable
from dyknow.kpl.linking.streams import LinkStream
from dyknow.kpl.linking.wants import MOST, Wanted, wants_in
from dyknow.model.errors import SourceText, TextError, TextErrors
from tests.kpl.instances import Running
from tests.kpl.linking.test_linking import PERCEPTS, WORLD

RED = 'want suspect in world = colour[suspect] = "red"\n'


class Crossing(Running):
    """An instance that sees a blue car from the beginning, and a red one from 2 s to 4 s and from 5 s on."""

    def __init__(self, text: str) -> None:
        super().__init__("")
        self.told: list[tuple[int, str, str]] = []
        self.instance.hooks.on_found = lambda event: self.told.append(
            (event.valid_us // 1000, event.kind, event.target)
        )
        self.add(text)

    def drive(self, from_ms: int = 0, until_ms: int = 8000) -> None:
        for t in range(from_ms, until_ms, 100):
            self.wait(t * 1000)
            with self.network.instant.whole():
                self.push("camera", ("vp1", t / 100, 50.0, "blue", False), t * 1000)
                if 2000 <= t <= 4000 or t >= 5000:
                    is_last = t == 4000
                    self.push("camera", (f"vp{2 + (t >= 5000)}", t / 100, 0.0, "red", is_last), t * 1000)


def test_what_is_described_is_anchored_when_it_comes_into_view_and_what_becomes_of_it_is_told() -> None:
    crossing = Crossing(PERCEPTS + WORLD + RED)
    crossing.drive(until_ms=2000)
    assert not crossing.told
    process = crossing.network.process(Label("world"))
    assert isinstance(process, LinkStream)
    assert process.linkage.wanted == ("suspect",)
    crossing.drive(2000)
    assert crossing.told == [
        (2000, "find", "suspect"), (3000, "track", "suspect"), (4000, "lost", "suspect"), (5000, "reacquire", "suspect"),
        (6000, "track", "suspect"),
    ]  # fmt: skip


def test_it_is_an_object_of_its_stream_like_any_other() -> None:
    crossing = Crossing(PERCEPTS + WORLD + RED + "stream seen = world\nmonitor calm = always speed[suspect] < 5\n")
    crossing.drive()
    assert {sample.value[0] for name, sample in crossing.outputs if name == "seen"} == {"wo1", "suspect"}
    first = next(sample for name, sample in crossing.outputs if name == "seen" and sample.value[0] == "suspect")
    assert first.valid_us == 2_000_000


def test_a_description_may_be_defined_and_need_time_and_another_one_is_looked_for_when_that_changes() -> None:
    text = (
        PERCEPTS + WORLD + "define MOST_SPEED = 5\nwant runner in world = always [0, 1s] speed[runner] > MOST_SPEED\n"
    )
    crossing = Crossing(text)
    crossing.drive(until_ms=3000)
    assert [each[1] for each in crossing.told] == ["find", "track"]
    assert crossing.told[0][0] > 1000
    changed = parse_specification(text.replace("SPEED = 5", "SPEED = 50"))
    crossing.instance.change(changed, crossing.now_us, "")
    crossing.drive(3000, 5000)
    assert [each[1:] for each in crossing.told].count(("find", "runner")) == 1
    assert not crossing.network.process(Label("world")).linkage.objects("world").keys() & {"runner"}  # type: ignore[union-attr]


def test_it_is_printed_and_taken_back() -> None:
    crossing = Crossing(PERCEPTS + WORLD + RED)
    assert print_specification(crossing.instance.specification).endswith(RED)
    crossing.drive(until_ms=3000)
    crossing.instance.remove([crossing.instance.specification[-1]], crossing.now_us)
    process = crossing.network.process(Label("world"))
    assert isinstance(process, LinkStream)
    assert not process.running
    assert process.linkage.wanted == ()


@pytest.mark.parametrize(
    ("want", "message", "repair"),
    [
        ("want s in worlds = speed[s] > 5", "nothing makes worlds", "world"),
        ("want s in percepts = speed[s] > 5", "no link makes percepts", "want s in world"),
        ('want s in world = color[s] = "red"', "objects of world have no color", "colour[s]"),
        ("want s in world = colour[s] = red", "red is no constant", '"red"'),
        ("want s in world = speed[wo1] > 5", "speaks of s alone", "speed[s]"),
        ("want s in world = forall o in world: speed[o] > 5", "of one object", "speed[s] > 5"),
        ("want s in world = speed[s]", "true or false", "speed[s] > 5"),
        ("want s = speed[s] > 5", "", "want suspect in cars"),
        (RED + RED, "suspect is wanted already", "another name"),
        ("want s in world = on_road[s]", "have no on_road", ""),
    ],
)
def test_what_cannot_be_wanted_is_told_with_place_cause_and_remedy(want: str, message: str, repair: str) -> None:
    text = SourceText(PERCEPTS + WORLD + want, "a.kpl")
    running = Running(PERCEPTS + WORLD)
    with pytest.raises(TextError) as wrong:
        running.instance.change(parse_specification(text), 0, text)
    first = wrong.value.errors[0] if isinstance(wrong.value, TextErrors) else wrong.value
    assert message in first.message
    assert repair in first.repair
    assert first.line == text.count("\n") + (not want.endswith("\n"))


def test_only_so_many_are_looked_for() -> None:
    many = "".join(f"want w{i} in world = speed[w{i}] > 5\n" for i in range(MOST + 1))
    with pytest.raises(TextErrors, match=f"{MOST} objects are looked for already"):
        Running(PERCEPTS + WORLD + many)


def test_a_symbol_that_an_object_has_is_not_given_to_another() -> None:
    crossing = Crossing(PERCEPTS + WORLD + "stream seen = world\n")
    crossing.drive(until_ms=2000)
    with pytest.raises(TextErrors, match="wo1 is the symbol of an object"):
        crossing.add("want wo1 in world = speed[wo1] > 5\n")


def test_offline_they_are_checked_against_the_links_alone() -> None:
    links = "strmgen world = link(vision_percept, WorldObject, true, false, true)\n"

    def wanted(text: str) -> list[Wanted]:
        declarations = parse_specification(links + text)
        return wants_in(declarations, SymbolTable(declarations), links + text)

    (suspect,) = wanted(RED)
    assert (suspect.symbol, suspect.type) == ("suspect", "world")
    with pytest.raises(TextError, match="no link makes worlds"):
        wanted(RED.replace("world", "worlds"))
    with pytest.raises(TextErrors, match="speaks of suspect alone"):
        wanted(RED.replace("colour[suspect]", "colour[other]"))
