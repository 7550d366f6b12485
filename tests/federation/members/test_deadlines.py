from hypothesis import given
from hypothesis import strategies as st

from dyknow.federation.members.deadlines import Deadlines


@given(st.lists(st.tuples(st.sampled_from("abcde"), st.none() | st.integers(0, 50)), max_size=60), st.integers(0, 60))
def test_deadlines_are_what_was_set_last(steps: list[tuple[str, int | None]], now_us: int) -> None:
    deadlines: Deadlines[str] = Deadlines()
    known: dict[str, int] = {}
    for key, due_us in steps:
        deadlines.set(key, due_us)
        known.pop(key, None)
        if due_us is not None:
            known[key] = due_us
        assert deadlines.next_us == min(known.values(), default=None)
    due = deadlines.pop_due(now_us)
    assert set(due) == {key for key, due_us in known.items() if due_us <= now_us}
    assert [known[key] for key in due] == sorted(known[key] for key in due)
    assert deadlines.pop_due(now_us) == []
