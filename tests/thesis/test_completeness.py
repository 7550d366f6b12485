"""Every numbered example of chapters 4 and 7.8 has a test named after it, and every definition that fixes something."""

import re
from pathlib import Path

import pytest

HERE = Path(__file__).parent
TEXT = "\n".join(path.read_text(encoding="utf-8") for path in sorted(HERE.rglob("test_*.py")))
EXAMPLES = {"4_3": 11, "4_4": 14, "4_5": 6, "7_8": 3}  # chapters 3 and 5 have figures, and no numbered example
DEFINITIONS = {"4_3": 16, "4_4": 15, "4_5": 12, "7_8": 6}
NOTATION = {"4_3_1", "4_3_4", "4_5_1", "4_5_2", "4_5_3", "7_8_1", "7_8_2", "7_8_3"}
NUMBER = r"\d_\d_\d+"


def numbered(sections: dict[str, int]) -> list[str]:
    return [f"{section}_{n}" for section, last in sections.items() for n in range(1, last + 1)]


def named(name: str) -> set[str]:
    """The numbers in the name of a test; `a_to_b` are all between, in one section."""
    found = set(re.findall(NUMBER, name))
    for first, last in re.findall(rf"({NUMBER})_to_({NUMBER})", name):
        section, begin, end = first[:4], int(first[4:]), int(last[4:])
        found |= {f"{section}{n}" for n in range(begin, end + 1)}
    return found


@pytest.mark.parametrize("number", numbered(EXAMPLES))
def test_an_example_has_a_test_named_after_it(number: str) -> None:
    assert re.search(rf"def test_example_{number}(?!\d)", TEXT)


@pytest.mark.parametrize("number", [each for each in numbered(DEFINITIONS) if each not in NOTATION])
def test_a_definition_that_fixes_something_has_a_property_test_named_after_it(number: str) -> None:
    properties = re.findall(r"@definition\n@given\((?:.|\n)*?\n?def (test_\w+)", TEXT)
    keywords = ["4_4_2"]  # a finite set, gone through word by word
    assert number in {*keywords, *(one for name in properties for one in named(name))}
