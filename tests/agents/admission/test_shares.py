"""What one member has delegated to a platform, or follows there, is bounded, and what others ask for stays possible."""

from agents.subscribers import OF_ONE as FOLLOWED
from agents.tasks.life import OF_ONE
from federation.messages.acts import Performative
from federation.messages.contents import Alarms, CheckFormula, MonitorProximity, Reason
from tests.agents.rosters import trust
from tests.box import Box, Question, Vehicle

P = Performative


def code(asked: Question) -> str | None:
    reason = asked.contents[-1]
    return reason.code if isinstance(reason, Reason) else None


def test_tasks_of_one_member_leave_room_for_those_of_others(wire: Box) -> None:
    for unit in "012":
        wire.join(unit, Vehicle(north_m=3000.0 * int(unit)), trust=trust(unit))
    wire.centre("cc", trust=trust("cc"))
    wire.run(1.5)
    check = CheckFormula(text="eventually altitude[0] > 10000", timeout_s=60.0)
    asked = [wire.asked("2", "0", MonitorProximity()) for _ in range(OF_ONE)]
    assert [each.performatives[0] for each in asked] == [P.AGREE] * OF_ONE
    for content in (MonitorProximity(), check):
        refused = wire.asked("2", "0", content)
        assert (refused.performatives, code(refused)) == ([P.REFUSE], "too-many-tasks")
    assert wire.asked("1", "0", MonitorProximity()).performatives[0] is P.AGREE
    assert wire.asked("cc", "0", check).performatives[0] is P.AGREE
    wire.cancel("2", "0", asked[0].conversation)
    wire.run(0.2)
    assert wire.asked("2", "0", check).performatives[0] is P.AGREE
    wire.run(2.0)
    assert wire.member("0").directory.is_present("1")


def test_subscriptions_of_one_member_leave_room_for_those_of_others(wire: Box) -> None:
    for unit in "01":
        wire.join(unit, Vehicle(north_m=3000.0 * int(unit)))
    wire.centre("cc")
    wire.run(1.5)
    asked = [wire.asked("1", "0", Alarms(), P.SUBSCRIBE) for _ in range(FOLLOWED + 1)]
    assert [each.performatives for each in asked] == [*[[P.AGREE]] * FOLLOWED, [P.REFUSE]]
    assert code(asked[-1]) == "too-many-subscriptions"
    assert wire.asked("cc", "0", Alarms(), P.SUBSCRIBE).performatives == [P.AGREE]
