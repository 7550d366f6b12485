from dataclasses import dataclass

from dyknow.proxies.zenoh.open_questions import LIMIT, PATIENCE_US, OpenAsks


@dataclass
class Question:
    dropped: int = 0

    def drop(self) -> None:
        self.dropped += 1


def test_a_question_is_there_until_it_is_ended_and_is_dropped_once() -> None:
    asks, question = OpenAsks[Question](), Question()
    number = asks.add(question, 0)
    assert asks.get(number) is question
    asks.end(number)
    asks.end(number)
    assert asks.get(number) is None
    assert question.dropped == 1


def test_beyond_the_limit_the_oldest_question_is_given_up() -> None:
    asks = OpenAsks[Question]()
    questions = [Question() for _ in range(LIMIT + 3)]
    for question in questions:
        asks.add(question, 0)
    assert len(asks) == LIMIT
    assert [question.dropped for question in questions[:4]] == [1, 1, 1, 0]
    assert asks.given_up == 3


def test_questions_nobody_answers_do_not_stay() -> None:
    asks, old, new = OpenAsks[Question](), Question(), Question()
    asks.add(old, 0)
    asks.add(new, PATIENCE_US - 1)
    asks.add(Question(), PATIENCE_US)
    assert (old.dropped, new.dropped) == (1, 0)


def test_at_the_end_nobody_is_left_waiting() -> None:
    asks = OpenAsks[Question]()
    questions = [Question() for _ in range(5)]
    for question in questions:
        asks.add(question, 0)
    asks.end_all()
    assert all(question.dropped == 1 for question in questions)
