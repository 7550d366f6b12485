"""The saliency map as a drawing: each person with its name, in the colour of the platform that has found it."""

from xml.etree import ElementTree as ET

from dyknow.runtime.library.pictures.saliency import FoundPerson
from dyknow.runtime.library.pictures.saliency_drawing import SEVERAL, saliency_svg

PERSON = FoundPerson("0:s1", 10.0, 20.0, None, None, (9.0, 0.0, 1.0), 0, 1, 6.0, 0.8, 0.7, "", "", ("0",), ("0:s1",))


def test_each_person_is_drawn_with_its_ellipse_and_name() -> None:
    other = PERSON._replace(name="<1:s2>", x_m=-120.0, by=("0", "1"))
    root = ET.fromstring(saliency_svg([PERSON, other]))
    one, two = (each for each in root if each.tag.endswith("ellipse"))
    assert float(one.get("rx", 0)) > 2.0 * float(one.get("ry", 0)), "the standard deviations are 3 m and 1 m"
    assert (one.get("stroke") == SEVERAL, two.get("stroke") == SEVERAL) == (False, True)
    texts = [each.text for each in root if each.tag.endswith("text")]
    assert {"0:s1, 6 s", "<1:s2>, 6 s"} <= set(texts)
    assert float(one.get("cx", 0)) > float(two.get("cx", 0))


def test_a_map_without_persons_is_an_empty_picture() -> None:
    assert [each.tag.rpartition("}")[2] for each in ET.fromstring(saliency_svg([]))] == ["rect"]
