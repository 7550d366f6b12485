"""Ids of maps as names of objects: each has one, none two ids, and what is a name already keeps it."""

from random import Random

from dyknow.anchoring.roads.names import object_names
from dyknow.model.members import MAX_NAME, is_object_name, member_name, object_name


def drawn(random: Random) -> str:
    pieces = ("-", "_", ".", ":", "#", " ", "1", "42", "a", "B", "ü", "\\", "self", "units", "x" * 70, "--", "")
    return "".join(random.choice(pieces) for _ in range(random.randrange(6)))


def test_every_id_has_a_name_of_its_own_that_is_one() -> None:
    random = Random(3)
    for _ in range(200):
        ids = {drawn(random) for _ in range(random.randrange(40))}
        names = object_names(ids)
        assert names.keys() == ids
        assert len(set(names.values())) == len(ids)
        for id_, name in names.items():
            assert member_name(name) == name
            assert len(name) <= MAX_NAME
            assert not is_object_name(id_) or name == id_


def test_a_text_that_is_a_name_stays_as_it_is() -> None:
    assert [object_name(each) for each in ("l1", "103", "a-b", "_x")] == ["l1", "103", "a-b", "_x"]
    assert [object_name(each) for each in ("-103", "4711.0", "103-back", "", "a--b")] == [
        "_103", "_4711_0", "_103-back", "_", "a_-b",
    ]  # fmt: skip
