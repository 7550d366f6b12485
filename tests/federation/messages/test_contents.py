import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.federation.messages import codec, contents
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.contents import (
    Alarm,
    CreateMulticast,
    Query,
    Reading,
    Reason,
    Samples,
    TaskEntry,
    TaskList,
    parts,
)
from dyknow.federation.messages.sexpr import Expr
from dyknow.model.errors import ContentError
from dyknow.model.values import NO_VALUE
from tests.federation.expressions import parse_expr
from tests.federation.strategies import EXPRESSIONS

TEXTS = [
    '(reason text: "no such label")',
    "(done)",
    "(cancel)",
    '(progress step: "streams are set up" unit: 1)',
    "(create-multicast semantic-labels: (sequence battery) sample-period: 0.1 delay: 0.0 to-units: (sequence uav1 7) from: 5 to: 6)",
    "(stop-multicast semantic-labels: (sequence battery) to-units: (sequence 0))",
    '(stream owner: 1 semantic-labels: (sequence battery) policy: "sample every 100" hash: ab12cd34)',
    "(end-stream owner: 1 semantic-labels: (sequence battery) hash: ab12cd34)",
    "(call-for-stream call: cc-7-1.call semantic-label: battery sample-period: 0.1 delay: 0.5 min-certainty: 0.8)",
    "(stream-proposal semantic-label: battery cost: 2.5 sample-period: 0.1 delay: 0.2 certainty: 0.9)",
    "(take-proposal)",
    '(divide-area area: (sequence "58.0 15.0" "58.0 15.1" "58.1 15.1") sensor: camera-state)',
    '(assign-area task: cc-1-2.0 generation: 3 rings: (sequence (area-ring corners: (sequence "58 15" "58 15.1" "58.1 15.1"))) area_m2: 5.5 share: 0.5 middle: "58 15.05" units: (sequence 0 1))',
    '(leave-proposal because: "certainty 0.5, not 0.8")',
    "(import-list)",
    "(specification)",
    "(specification number: 2)",
    '(specification-text text: "source pos gps" number: 2 last: 3 at: 1700000000000000)',
    "(restore-specification number: 0)",
    '(add-declarations text: "stream s = a[self]" files: (sequence (named-text path: t.chr text: "chronicle t")) file: s.kpl)',
    '(load-specification text: "source a b")',
    '(reset stream: "speed[self]")',
    '(remove-declarations names: (sequence speed "stream alt"))',
    '(specification-changed number: 3 added: (sequence "stream s = alt[self]") more: 2 warnings: (sequence "a b"))',
    "(import-list imports: (sequence (import-account owner: 1 semantic-label: battery hash: ab12cd34 received: 7)))",
    "(object-list type: car)",
    "(object-events symbol: car1)",
    "(object-picture)",
    '(divide-area area: (sequence "58.0 15.0" "58.0 15.1" "58.1 15.1") scan_m: 45.0)',
    "(saliency-rows)",
    '(saliency-rows members: (sequence "0" "1") rows: (sequence (saliency-row symbol: "0:s1" by: (sequence 0) entries: (sequence "0:s1") attributes: (record x_m: 1.5))) refused: (sequence "of platform 2 3 entries: no score"))',
    "(share level: states unit: 1)",
    "(share kbit_s: 50.0)",
    '(object-picture members: (sequence "0" "1") objects: (sequence (picture-entry symbol: car0_1 by: (sequence 0) tracks: (sequence "0:co1") seen: 5)))',
    '(object-events events: (sequence (object-event at: 5 event: established target: wo1 source: vp1 because: "establish holds")))',
    "(object-list objects: (sequence (object-entry symbol: car1 type: car stream: cars valid: 5 attributes: (record colour: red x_m: 1.5))))",
    "(query semantic-label: heli-position)",
    "(query semantic-label: heli-position op: at at: 5 scope: global select: best)",
    "(query semantic-label: heli-position op: between from: 5 to: 6 merge: inverse-variance)",
    "(samples unit: 1 semantic-label: battery samples: (sequence (reading valid: 1 available: 2 value: (record fraction: 0.5))) more: true)",
    '(query-stream stream: "speed[self]" op: at at: 5)',
    "(query semantic-label: battery op: nth n: 3)",
    '(query-stream stream: "speed[self]" op: last n: 5)',
    '(query-stream stream: "speed[self]" op: slice i: 0 j: 9)',
    '(stream-samples unit: 1 stream: "speed[self]" samples: (sequence (reading valid: 1 available: 2 value: (record value: 3.1))))',
    '(answers semantic-label: battery answers: (sequence (samples unit: 1 semantic-label: battery samples: (sequence))) missing: (sequence (missing unit: 2 reason: "no answer")))',
    "(monitor-proximity)",
    "(monitor-proximity profile: proximity-warn avoidance: false sample-period: 0.2 delay: 1.0)",
    "(create-monitor name: proximity)",
    "(hand-over task: 1-2-3 coordinator: 0 boot: 17 generation: 2)",
    "(create-monitor name: proximity task: 1-2-3 coordinator: 0 generation: 2 sample-period: 0.1 delay: 1.0 avoidance: true)",
    "(remove-monitor name: proximity task: 1-2-3)",
    "(monitors)",
    "(monitor-list monitors: (sequence (monitor by: 0 name: proximity units: (sequence 0 2) verdict: undecided inputs: stale shows: unknown since: 7 which: (sequence heli-position))))",
    "(alarms)",
    "(monitor-changes)",
    "(monitor-change event: unknown monitor: proximity by: 0 units: (sequence 0 2) at: 1800000000000000 which: (sequence heli-position[2]) since: 1799999999000000)",
    '(alarm id: "proximity 0" event: opened monitor: proximity by: 0 units: (sequence 0 1) valid: 5 detected: 6 values: (record "xy_dist[0, 1]": 12.1 seen: no_value))',
    '(alarm id: a event: opened monitor: low by: 0 units: (sequence 0) valid: 5 detected: 6 because: (sequence (because part: "h[0] > 3" holds: false samples: (record h[0]: 2.0))))',
    "(alarm-list)",
    '(check-formula text: "always (speed[self] <= 30)" timeout: 5.0)',
    "(verdict verdict: false valid: 5 index: 13)",
    '(when do: (create-monitor name: energy) condition: "gas[self] > 40")',
    '(when do: (create-monitor name: energy) condition: "gas[self] > 40" timeout: 5.0)',
    '(recognise text: "chronicle t[?a] { event(landed[?a], t1) }" timeout: 5.0 delay: 0.2)',
    '(expected chronicle: t bindings: (record "?a": uav1) instants: (record t1: 5) missing: (sequence "event(a, t2)") until: 9 over: true)',
    '(recognised chronicle: t bindings: (record "?a": uav1) instants: (record t1: 5) recognised: 9)',
    "(tasks)",
    "(task-list tasks: (sequence (task conversation: 1-2-3 task: monitor-proximity unit: 0 state: running delegator: interface@1)))",
    "(acts)",
    '(act-log at: 5 direction: in peer: interface@1 outcome: "accepted" act: "(request :sender a@1)")',
    "(act-list acts: (sequence))",
    "(directory)",
    "(directory-event event: platform-appeared unit: 3 at: 5)",
    "(search service: dyknow-federation)",
    "(found agents: (sequence interface@0 interface@1))",
    "(found agents: (sequence interface@0) missing-units: (sequence 1) missing-since: (sequence 1800000000000000))",
    "(leave)",
    "(rejoin)",
    "(goto latitude_deg: 58.5 longitude_deg: 15.0 altitude_m: 100.0)",
    "(follow object: car3 standoff_m: 35.0)",
    "(attend)",
    '(want symbol: suspect type: cars description: "colour[suspect] = 1")',
    "(hold)",
    "(land)",
    "(return-home)",
    "(resume)",
    "(avoid units: (sequence 0 1) legs: 58.0000000,15.0000000,80.0)",
    "(fault kind: gps-loss duration: 5.0)",
    "(fault kind: packet-loss value: 30)",
    '(fly-mission mission: m1 domain: "#objects" problem: "#goal" actions: (sequence "land(uav1)") platforms: (record uav1: "0") chain: (sequence cc))',
    '(call-for-mission mission: m1 domain: "#objects" problem: "#goal")',
    '(mission-proposal cost: 2.5 duration: 60.0 actions: (sequence "land(uav1)"))',
    "(take-mission)",
    '(leave-mission because: "another is cheaper")',
    '(permit-mission mission: m1 leaders: (sequence "0") vehicles: (sequence "0" "1"))',
    "(task-over task: cc-1-2.0)",
    "(join-mission mission: m1 chain: (sequence cc))",
    '(perform-commands mission: m1 step: 2 action: "fly(uav1)" commands: (sequence (command-entry name: goto numbers: (sequence 58.1 15.1 7.0))))',
    '(keep-mission mission: m1 delegator: cc conversation: cc-1 problem: "#goal" platforms: (record uav1: "0") chain: (sequence cc))',
    "(performed step: 2 failure: refused)",
    '(vehicle-news waits: "its pilot has it")',
    "(mission-query)",
    '(flight-outlook commander: order doing: "goto 58.0" ahead: (sequence "58.5 15.0") altitude_m: 100.0 fences: (sequence (fence name: autopilot centre: "58.5 15.0" radius_m: 300.0)) origin: "58.5 15.0")',
    '(mission-list missions: (sequence (mission-entry mission: m1 conversation: cc-1 phase: flying since: 5 question: (mission-question number: 1 text: "where is b1?" options: (sequence "try again" "give up") default: "give up" until: 7))))',
    '(answer-question mission: m1 number: 1 answer: "give up")',
    "(control-mission mission: m1 how: resume)",
]  # fmt: skip


@pytest.mark.parametrize("text", TEXTS)
def test_a_content_is_understood_and_said_again_as_it_was(text: str) -> None:
    found = contents.read(parse_expr(text))
    assert str(found.expr()) == text
    assert contents.read(found.expr()) == found


@pytest.mark.parametrize("text", TEXTS)
def test_a_content_is_understood_after_its_journey(text: str) -> None:
    act = Act(Performative.INFORM, AgentName("interface", "1"), AgentName("interface", "0"), parse_expr(text))
    arrived = codec.decode_act(codec.encode_act(act))[0].content
    assert arrived is not None
    assert str(arrived) == text
    assert contents.read(arrived) == contents.read(parse_expr(text))


def test_every_head_is_tried_above() -> None:
    tried = {parse_expr(text).head for text in TEXTS}
    offered = [getattr(contents, name) for name in contents.__all__]
    kinds = [kind for kind in offered if isinstance(kind, type) and issubclass(kind, contents.Content)]
    assert {kind.head for kind in kinds if kind is not contents.Content} <= tried
    assert tried <= parts._CONTENTS.keys()


def test_units_are_names_however_they_are_written() -> None:
    text = '(create-multicast semantic-labels: (sequence battery) sample-period: 1 delay: 1.5 to-units: (sequence 0 "1" uav2))'
    found = contents.read(parse_expr(text))
    assert isinstance(found, CreateMulticast)
    assert found.to_units == ("0", "1", "uav2")
    assert (found.sample_us, found.delay_us) == (1_000_000, 1_500_000)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("(fly)", "fly"),
        ("(reading valid: 1 available: 2 value: (record))", "reading"),
        ("(create-monitor)", "name"),
        ("(create-monitor name: proximity colour: red)", "colour"),
        ('(create-monitor name: "a\x1b[2J")', "name"),
        ('(create-monitor name: "a\u202eb")', "name"),
        ('(check-formula text: "always a\x9b > 0")', "text"),
        ("(create-monitor name: 5)", "name"),
        ("(create-monitor name: proximity coordinator: Uav)", "coordinator"),
        ('(create-monitor name: proximity task: "a/b")', "task"),
        ("(create-multicast semantic-labels: (sequence) sample-period: 1.0 delay: 1.0 to-units: (sequence 0))", "semantic-labels"),
        ('(create-multicast semantic-labels: (sequence "a/**") sample-period: 1.0 delay: 1.0 to-units: (sequence 0))', "semantic-labels"),
        ("(create-multicast semantic-labels: (sequence battery) sample-period: 0.0 delay: 1.0 to-units: (sequence 0))", "sample-period"),
        ("(create-multicast semantic-labels: (sequence battery) sample-period: 1.0 delay: -1.0 to-units: (sequence 0))", "delay"),
        ("(create-multicast semantic-labels: (sequence battery) sample-period: true delay: 1.0 to-units: (sequence 0))", "sample-period"),
        ("(create-multicast semantic-labels: (sequence battery) sample-period: 1.0 delay: 1.0 to-units: (sequence -1))", "to-units"),
        ("(query semantic-label: battery op: at)", "at"),
        ("(query semantic-label: battery at: 5)", "latest"),
        ("(query semantic-label: battery op: between from: 6 to: 5)", "after"),
        ("(query semantic-label: battery select: best merge: mean)", "both"),
        ('(when do: 5 condition: "a[b]")', "do"),
        ('(when do: (hold) condition: "a[b]" timeout: 3601.0)', "timeout"),
        ("(query semantic-label: battery op: nth)", "op nth needs n"),
        ("(query semantic-label: battery op: slice i: 3)", "op slice needs i and j"),
        ("(query semantic-label: battery op: slice i: 3 j: 2)", "i lies after j"),
        ("(query semantic-label: battery op: last n: -1)", "n"),
        ("(query semantic-label: battery op: last n: 1 at: 5)", "nothing else"),
        ("(follow object: car3 standoff_m: -1.0)", "standoff_m"),
        ("(goto latitude_deg: 91.0 longitude_deg: 15.0 altitude_m: 100.0)", "latitude_deg"),
        ("(task-list tasks: (sequence (alarm)))", "tasks"),
        ("(task-list tasks: (sequence 5))", "tasks"),
        ("(alarm id: a event: opened monitor: m by: 0 units: 5 valid: 1 detected: 2)", "units"),
    ],
)  # fmt: skip
def test_what_is_not_understood_is_named(text: str, named: str) -> None:
    with pytest.raises(ContentError, match=named):
        contents.read(parse_expr(text))


@given(EXPRESSIONS)
def test_any_expression_is_understood_or_named_as_not(expr: Expr) -> None:
    with pytest.raises(ContentError, match="is not understood here"):
        contents.read(expr)


@given(st.sampled_from(sorted(parts._CONTENTS)), EXPRESSIONS)
def test_any_arguments_of_a_known_head_are_understood_or_named_as_not(head: str, expr: Expr) -> None:
    try:
        found = contents.read(Expr(head, expr.arguments))
    except ContentError as wrong:
        assert head in str(wrong)
        assert len(str(wrong)) <= 400
    else:
        assert contents.read(found.expr()) == found


def test_lists_are_bounded() -> None:
    reading = Reading(valid_us=1, available_us=2, value=NO_VALUE)
    said = Samples(unit="0", semantic_label="battery", samples=(reading,) * contents.MAX_LIST).expr()
    assert isinstance(contents.read(said), Samples)
    samples = said.arguments["samples"]
    assert isinstance(samples, tuple)
    with pytest.raises(ContentError, match="samples"):
        contents.read(Expr("samples", {**said.arguments, "samples": (*samples, samples[0])}))


def test_contents_are_built_with_the_names_and_units_of_the_code() -> None:
    assert (
        str(Query(semantic_label="battery", op="at", at_us=5).expr()) == "(query semantic-label: battery op: at at: 5)"
    )
    task = TaskEntry(conversation="1-2", task="monitor-proximity", unit="0", state="led by 1")
    assert str(TaskList(tasks=(task,)).expr()) == (
        '(task-list tasks: (sequence (task conversation: 1-2 task: monitor-proximity unit: 0 state: "led by 1")))'
    )
    assert str(Reason(text="no").expr()) == '(reason text: "no")'
    alarm = Alarm(id="a", event="closed", monitor="m", by="uav1", units=("0",), valid_us=1, detected_us=2)
    assert (
        str(alarm.expr()) == "(alarm id: a event: closed monitor: m by: uav1 units: (sequence 0) valid: 1 detected: 2)"
    )
