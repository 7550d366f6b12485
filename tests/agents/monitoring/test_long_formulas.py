"""A long formula of another member is parsed next to the thread of the platform; how many and how much one may ask is limited."""

from dyknow.agents.effects import Computed
from dyknow.agents.monitoring.checks import MOST_CHECKS_OF_ONE, Checks
from dyknow.agents.monitoring.recognitions import MOST_OF_ONE
from dyknow.agents.monitoring.text_reading import LONG
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import CheckFormula, Reason, Recognise, Verdict
from dyknow.network.process import Work
from tests.agents.rosters import trust
from tests.box import Box, Question, Vehicle

P = Performative
FORMULA = " and ".join(["altitude[self] > 1"] * 60)
assert len(FORMULA) > LONG


class HeldWorkers:
    """Workers that do nothing until they are told to."""

    def __init__(self, box: Box, unit: str) -> None:
        self._box, self._unit = box, unit
        self.held: list[tuple[int, Work]] = []
        box.platform(unit).part(Checks)._gateway.network.calls.workers = self

    def now_us(self) -> int:
        return self._box.now_us

    def start(self, number: int, work: Work) -> None:
        self.held.append((number, work))

    def finish(self, *, works: bool = True) -> None:
        """All is done; or has been, and a journal is replayed."""
        held, self.held = self.held, []
        for number, work in held:
            outcome = work() if works else ((), ())
            self._box.happens(self._unit, Computed(self._box.now_us, number, outcome, 1))


def begun() -> tuple[Box, HeldWorkers]:
    box = Box(1)
    box.join("0", Vehicle(), trust=trust("0"))
    box.join("1", Vehicle(), trust=trust("1"))
    box.centre("cc", trust=trust("cc"))
    box.run(2)
    return box, HeldWorkers(box, "0")


def check(box: Box, text: str, by: str = "1") -> Question:
    return box.asked(by, "0", CheckFormula(text=text, timeout_s=2.0), P.QUERY_IF)


def test_a_long_formula_is_read_in_a_worker_and_decided_as_a_short_one() -> None:
    for works in (True, False):
        box, workers = begun()
        question = check(box, FORMULA)
        assert len(workers.held) == 1
        assert question.performatives == []
        workers.finish(works=works)
        box.run(3)
        assert question.performatives == [P.AGREE, P.INFORM]
        assert isinstance(question.contents[-1], Verdict)
        assert question.contents[-1].verdict == "true"
        assert check(box, "altitude[self] > 1").performatives[0] is P.AGREE
        assert not workers.held, "a short one is read at once"


def test_what_is_wrong_with_a_long_formula_is_answered_when_it_is_read() -> None:
    box, workers = begun()
    questions = [check(box, FORMULA + " and and"), check(box, FORMULA + " and no-such-thing[self] > 1")]
    workers.finish()
    box.run(0.5)
    for question in questions:
        assert question.performatives == [P.NOT_UNDERSTOOD]
        assert "1:" in question.reason


def test_a_long_formula_whose_requester_is_gone_is_forgotten() -> None:
    box, workers = begun()
    question = check(box, FORMULA)
    box.speak("1", lambda member, now_us: member.acts.cancel("0", question.conversation, now_us))
    box.run(0.2)
    workers.finish()
    box.run(0.5)
    assert P.AGREE not in question.performatives


def test_one_member_checks_a_limited_number_of_formulas_and_others_still_can() -> None:
    box, workers = begun()
    pending = "eventually[5s, 60s] altitude[self] > 10000"
    asked = [
        check(box, pending if number % 2 else f"{pending} or {FORMULA}") for number in range(MOST_CHECKS_OF_ONE + 2)
    ]
    codes = [content.code for one in asked for content in one.contents if isinstance(content, Reason)]
    assert codes == ["too-many-checks"] * 2
    assert check(box, "altitude[self] > 1", by="cc").performatives[0] is P.AGREE
    workers.finish()


CHRONICLE = (
    "chronicle climbs[?uav] {\n    event(altitude[?uav]:(?from, ?to), t1)\n}\n" + "# a remark that makes it long\n" * 20
)
assert len(CHRONICLE) > LONG


def watch(box: Box, text: str = CHRONICLE, by: str = "1") -> Question:
    return box.asked(by, "0", Recognise(text=text, timeout_s=2.0), P.SUBSCRIBE)


def test_long_chronicles_are_read_in_a_worker_and_count_for_the_member_that_asks() -> None:
    for works in (True, False):
        box, workers = begun()
        asked = [watch(box) for _ in range(MOST_OF_ONE + 1)]
        assert len(workers.held) == MOST_OF_ONE
        assert [each.performatives for each in asked] == [[]] * MOST_OF_ONE + [[P.REFUSE]]
        wrong = watch(box, CHRONICLE + "chronicle", by="cc")
        of_centre = watch(box, by="cc")
        workers.finish(works=works)
        box.run(0.5)
        assert [each.performatives for each in asked[:-1]] == [[P.AGREE]] * MOST_OF_ONE
        assert (wrong.performatives[0] in {P.REFUSE, P.NOT_UNDERSTOOD}, of_centre.performatives) == (True, [P.AGREE])
        box.run(3)


def test_chronicles_that_are_cancelled_while_they_are_read_do_not_begin() -> None:
    box, workers = begun()
    asked = watch(box)
    box.cancel("1", "0", asked.conversation)
    box.run(0.2)
    workers.finish()
    box.run(0.2)
    assert P.AGREE not in asked.performatives
    assert watch(box, by="1").performatives == []
    assert len(workers.held) == 1, "its place is free again"
    workers.finish()
    box.run(3)
