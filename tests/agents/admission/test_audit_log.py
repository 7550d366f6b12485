"""Every act that enters or leaves a platform is in its account, with what became of it (thesis 9.3.2)."""

from collections import Counter
from random import Random

import pytest

from dyknow.agents.capabilities.flight.options import AvoidanceOptions
from dyknow.agents.monitoring.alarm_log import AlarmLog
from dyknow.agents.options import Chosen
from dyknow.agents.platform import Platform
from dyknow.federation import keys
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.codec import decode_act
from dyknow.federation.messages.contents import (
    ActList,
    Acts,
    Alarm,
    Alarms,
    Content,
    CreateMulticast,
    Hold,
    MonitorProximity,
    Query,
    Reason,
    Tasks,
    read,
)
from dyknow.federation.messages.receipts import RECEIPT_AGENT
from dyknow.federation.transport import Put
from tests.box import Box

P = Performative
QUESTIONS: list[tuple[Performative, Content]] = [
    (P.QUERY_REF, Query(semantic_label="heli-position")),
    (P.QUERY_REF, Query(semantic_label="heli-position", scope="global")),
    (P.QUERY_REF, Tasks()),
    (P.QUERY_REF, ActList()),
    (P.SUBSCRIBE, Alarms()),
    (P.REQUEST, Hold()),
    (P.REQUEST, Tasks()),
    (P.INFORM, Tasks()),
    (P.REQUEST, MonitorProximity(profile="nonsense")),
    (P.REQUEST, CreateMulticast(semantic_labels=("battery",), sample_period_s=1.0, delay_s=1.0, to_units=("1", "2"))),
]


def crossed(wire: Box, unit: str) -> tuple[set[tuple[str, int]], set[tuple[str, int]]]:
    """(peer, number) of the acts that left a platform, and of those that reached it."""
    out, into = set(), set()
    for _, sender, put in wire.wire.log:
        key = keys.parse_key(put.key)
        if isinstance(key, keys.ActKey) and key.agent != RECEIPT_AGENT:
            act = decode_act(put.payload)[0]
            if sender == unit:
                out.add((act.receiver.unit, act.seq))
            elif act.receiver.unit == unit:
                into.add((act.sender.unit, act.seq))
    return out, into


def accounted(platform: Platform, direction: str) -> set[tuple[str, int]]:
    return {
        (e.peer, e.act.seq)
        for e in platform.ports.agent.audit_log.entries
        if e.direction == direction and e.act is not None
    }


@pytest.mark.parametrize("seed", range(6))
def test_the_account_is_what_crossed_the_wire(wire: Box, seed: int) -> None:
    rng = Random(seed)
    units = ["0", "1", "2", "cc"]
    for unit in units[:3]:
        wire.join(unit)
    wire.centre()
    wire.run(1.0)
    open_: list[tuple[str, str, str]] = []
    for _ in range(25):
        by, to = rng.sample(units, 2)
        performative, content = rng.choice(QUESTIONS)
        if performative is P.INFORM:
            wire.member(by).acts.tell(to, content, wire.now_us)
            wire.settle(by)
        else:
            open_.append((by, to, wire.question(by, to, content, performative).conversation))
        if rng.random() < 0.2:
            wire.cancel(*rng.choice(open_))
        wire.run(rng.choice([0.0, 0.01, 0.3]))
    wire.run(6.0)
    for unit, platform in wire.platforms.items():
        out, into = crossed(wire, unit)
        assert accounted(platform, "out") == out
        assert accounted(platform, "in") == into
        received = [e for e in platform.ports.agent.audit_log.entries if e.direction == "in"]
        assert len(received) == len(into), "each once"
        assert Counter(e.outcome.split(":")[0] for e in received) == Counter(
            {outcome: n for (way, outcome), n in platform.ports.agent.audit_log.counts.items() if way == "in"}
        )


def test_what_is_put_again_is_one_act_that_left_and_its_copies_are_duplicates(wire: Box, node: Platform) -> None:
    wire.wire.drop = lambda sender, receiver, put: sender == "0" and put.key.startswith(f"acl/{receiver}/0/")
    question = wire.question("cc", "0", Query(semantic_label="heli-position"), P.QUERY_REF)
    wire.run(1.5)
    out = [e for e in node.ports.agent.audit_log.entries if e.direction == "out"]
    assert len({(e.act.seq, e.act.boot) for e in out if e.act is not None}) == len(out) == 1
    assert node.ports.agent.audit_log.refused == {"duplicate": 3}
    wire.wire.drop = lambda *_: False
    wire.run(1.5)
    assert question.performatives == [P.INFORM] or question.failed


def test_an_act_that_is_never_acknowledged_is_noted_as_undelivered(wire: Box, node: Platform) -> None:
    wire.wire.drop = lambda _sender, receiver, put: receiver == "cc" and put.key.startswith("acl/")
    node.ports.agent.tell("cc", Tasks(), wire.now_us)
    wire.settle("0")
    wire.run(12.0)
    assert [e.outcome for e in node.ports.agent.audit_log.entries if e.direction == "out"] == ["sent", "undelivered"]


def test_bytes_that_are_no_act_are_noted_with_their_reason(wire: Box, node: Platform) -> None:
    for payload in (b"", b"\xc1", bytes(70_000), b"\x91" * 900):
        wire.put(keys.act("0", "1", "interface"), payload)
    wire.run(0.1)
    noted = [(e.peer, e.act, e.outcome) for e in node.ports.agent.audit_log.entries if e.direction == "in"]
    assert [(peer, act) for peer, act, _ in noted] == [("1", None)] * 4
    assert sum(node.ports.agent.audit_log.refused.values()) == 4


def test_who_follows_the_acts_is_told_of_all_but_of_that_telling(wire: Box, node: Platform) -> None:
    followed = wire.asked("cc", "0", Acts(), P.SUBSCRIBE)
    wire.asked("1", "0", Tasks(), P.QUERY_REF)
    wire.put(keys.act("0", "1", "interface"), b"\xc1")
    wire.run(2.0)
    logs = [said.content for said in followed.answers if said.performative is P.INFORM]
    assert [(log.direction, log.peer, log.act is None) for log in logs] == [  # type: ignore[union-attr]
        ("in", "1", False),
        ("out", "1", False),
        ("in", "1", True),
    ]
    assert "task-list" in str(logs[1].act)  # type: ignore[union-attr]


def test_the_account_is_read_page_by_page(wire: Box, node: Platform) -> None:
    for _ in range(30):
        wire.asked("1", "0", Tasks(), P.QUERY_REF)
    wire.run(1.0)
    wire.asked("cc", "0", ActList(), P.QUERY_REF)
    pages = [read(act.content) for act in wire.acts("0", "cc", "act-list") if act.content is not None]
    assert [page.more for page in pages] == [True, True, False]  # type: ignore[attr-defined]
    assert sum(len(page.acts) for page in pages) == 60, "thirty in and thirty out"  # type: ignore[attr-defined]


def test_a_put_under_our_own_name_is_counted_and_not_heard(wire: Box, node: Platform) -> None:
    wire.wire.put("1", Put(keys.act("0", "0", "interface"), b"\xc1", None))  # type: ignore[arg-type]
    wire.run(0.1)
    assert node.refused == {"our own name": 1}
    wire.wire.log[:] = [crossed for crossed in wire.wire.log if crossed.put.payload != b"\xc1"]


def test_an_act_stands_before_what_follows_from_it(wire: Box, node: Platform) -> None:
    for performative, content in QUESTIONS[:6]:
        wire.asked("1", "0", content, performative)
    entries = node.ports.agent.audit_log.entries
    assert [entry.number for entry in entries] == sorted(entry.number for entry in entries)
    came = {entry.act.reply_with: entry.number for entry in entries if entry.direction == "in" and entry.act}
    answers = [e for e in entries if e.direction == "out" and e.act and e.act.in_reply_to and e.peer == "1"]
    assert len(answers) >= 6
    assert all(came[answer.act.in_reply_to] < answer.number for answer in answers)


def test_control_characters_of_others_are_listed_as_what_they_are_not(wire: Box, node: Platform) -> None:
    wire.platform("1").ports.agent.tell("0", Reason(text="\x1b[2J\x9b1mgone\u202e"), wire.now_us)
    wire.settle("1")
    wire.run(0.2)
    (answer,) = wire.asked("cc", "0", ActList(), P.QUERY_REF).contents
    assert isinstance(answer, ActList)
    (listed,) = [each.act for each in answer.acts or () if each.peer == "1" and "gone" in (each.act or "")]
    assert listed is not None
    assert listed.isprintable()


def test_an_answer_about_the_log_does_not_hold_the_log_again(wire: Box) -> None:
    wire.join("0")
    wire.centre()
    for _ in range(3):
        contents = wire.asked("cc", "0", ActList(), P.QUERY_REF).contents
    texts = [entry.act or "" for page in contents for entry in page.acts or ()]
    answers = [text for text in texts if "(act-list" in text and text.startswith("(inform")]
    assert len(answers) >= 2
    assert all("(act-list more: false)" in text or "(act-list)" in text for text in answers)


def test_who_follows_the_log_is_sent_all_else_that_it_asked_for(wire: Box) -> None:
    wire.fly("0", 0.0, 0.0, 4.0, options=Chosen(AvoidanceOptions(avoidance=False)))
    wire.fly("1", 60.0, 3.0, -4.0, options=Chosen(AvoidanceOptions(avoidance=False)))
    wire.centre()
    wire.run(2.0)
    wire.ask("cc", "0", Acts(), P.SUBSCRIBE)
    alarms = wire.question("cc", "0", Alarms(), P.SUBSCRIBE)
    wire.asked("cc", "0", MonitorProximity())
    wire.run(12.0)
    heard = [content.event for content in alarms.contents if isinstance(content, Alarm)]
    assert len(heard) == len(wire.platform("0").part(AlarmLog).events) > 0
    sent = [act.seq for act in wire.acts("0", "cc")]
    assert len(set(sent)) == len(sent)
