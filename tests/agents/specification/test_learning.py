"""What is learnt of things of lasting interest is kept, and known again after a restart."""

from pathlib import Path

import pytest

from dyknow import Label
from dyknow.agents.effects import Fed, Keep, Specify
from dyknow.agents.platform import Platform
from dyknow.agents.specification.learning import Learning
from dyknow.kpl.linking.beliefs import BeliefStream
from dyknow.model.errors import WrongCall
from dyknow.runtime.learnt_files import LearntFiles
from tests.box import Box

YARD = Path("examples/world/yard.toml").read_text("utf-8") + "\n[attributes.mass_kg]\nmean = 1000.0\nsd = 500.0\n"
KNOWN = 'name = "yard"\n[classes.car]\nlasting = true\n[classes.pedestrian]\n'
TEXT = (
    "sort percept(symbol in text, x_m in m, y_m in m, colour in text)\nsource percept camera\nstrmgen percepts = camera\n"
    'strmgen beliefs = believe("yard.toml", "known.toml", percepts as camera)\nstream believed = beliefs\n'
)
S = 1_000_000


def platform(wire: Box, **config: object) -> Platform:
    found = wire.join("0", **config)
    wire.happens("0", Specify(wire.now_us, TEXT, "a.kpl", (("yard.toml", YARD), ("known.toml", KNOWN))))
    return found


def stream(found: Platform) -> BeliefStream:
    process = found.ports.network.process(Label("beliefs"))
    assert isinstance(process, BeliefStream)
    return process


def watch_one(wire: Box) -> None:
    """A car is seen for three seconds, and then no longer."""
    for step in range(30):
        at_us = wire.now_us // 100_000 * 100_000
        wire.happens("0", Fed(wire.now_us, "camera", at_us, ("p1", 5.0 + step, 0.0, "red")))
        wire.run(0.1)
    wire.run(90.0)


def kept(wire: Box) -> list[Keep]:
    return [each for each in wire.nodes["0"].kept if isinstance(each, Keep)]


def test_what_was_learnt_is_kept_and_known_after_a_restart_and_a_second_one_has_another_name(
    wire: Box, tmp_path: Path
) -> None:
    platform(wire)
    watch_one(wire)
    [effect] = kept(wire)
    assert effect.stream == "beliefs"
    assert 'id = "known-i0_1"' in effect.text
    files = LearntFiles(tmp_path / "learnt", "0")
    files.keep(effect.stream, effect.text)

    wire.kill("0")
    found = platform(wire, learnt=files.read())
    wire.run(0.2)
    assert list(stream(found).watch.informed.knowledge.learnt) == ["known-i0_1"]
    assert stream(found).learnt() == effect.text, "as it was"


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("[[known]]\nid = 3\n", "known[0].id: a text is expected, got 3"),
        ('[[known]]\nid = "a"\nattributes.mass_kg = { mean = [nan], sd = 1.0 }\n', "a list of"),
        ('[[known]]\nid = "a"\n[[known]]\nid = "a"\n', "there twice"),
        ("[classes.car]\nlasting = true\n", "[[known]] alone"),
        ("".join(f'[[known]]\nid = "k{n}"\n' for n in range(1001)), "at most 1000"),
        ("]", "no TOML"),
    ],
)
def test_what_cannot_have_been_learnt_is_refused_with_its_place_and_cause_and_not_written_over(
    wire: Box, text: str, cause: str
) -> None:
    found = platform(wire, learnt={"beliefs": text})
    wire.run(0.2)
    [note] = [each for each in wire.nodes["0"].notes if "are not taken" in each]
    assert cause in note
    assert "learnt parameters of beliefs:" in note, "its place"
    assert not stream(found).watch.informed.knowledge.learnt
    assert found.part(Learning)._streams[Label("beliefs")][1] is False


def test_files_that_no_platform_wrote_are_refused(tmp_path: Path) -> None:
    files = LearntFiles(tmp_path, "0")
    files.path("beliefs").write_bytes(b"\xff\xfe")
    with pytest.raises(WrongCall, match=r"0-beliefs\.toml cannot be read"):
        files.read()
    files.path("beliefs").write_text("[[known]]\n")
    with pytest.raises(WrongCall, match="not written by a platform"):
        files.read()
    files.keep("a/../b[1]", "text\n")
    assert files.path("a/../b[1]").parent == tmp_path
