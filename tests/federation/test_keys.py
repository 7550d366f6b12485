import re
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.federation import keys
from dyknow.model.errors import NameRefused
from tests.federation import schema

UNITS = st.one_of(
    st.integers(0, 10**31).map(str), st.from_regex(r"[a-z][a-z0-9_]{0,8}(-[a-z0-9_]{1,5}){0,3}", fullmatch=True)
).filter(lambda name: name not in schema.SCHEME)
LABELS = st.from_regex(r"[a-z][a-z0-9]{0,8}(-[a-z0-9]{1,5}){0,4}", fullmatch=True)
HASHES = st.from_regex(r"[0-9a-f]{8}", fullmatch=True)
ZIDS = st.from_regex(r"[0-9a-f]{1,32}", fullmatch=True)
COUNTS = st.integers(0, 10**18 - 1)
CONVERSATIONS = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,20}", fullmatch=True)
KEYS = st.one_of(
    st.builds(keys.act, UNITS | st.just("all"), UNITS, LABELS),
    st.builds(keys.stream, UNITS, LABELS, HASHES),
    st.builds(keys.history, UNITS, LABELS),
    st.builds(keys.describe, UNITS),
    st.builds(keys.heartbeat, UNITS),
    st.builds(keys.clock, UNITS),
    st.builds(keys.token_platform, ZIDS, UNITS, LABELS, COUNTS),
    st.builds(keys.token_service, ZIDS, UNITS, LABELS, COUNTS),
    st.builds(keys.token_label, ZIDS, UNITS, LABELS, HASHES, COUNTS),
)
BUILDERS = {
    keys.ActKey: keys.act,
    keys.StreamKey: keys.stream,
    keys.HistoryKey: keys.history,
    keys.DescribeKey: keys.describe,
    keys.HeartbeatKey: keys.heartbeat,
    keys.ClockKey: keys.clock,
    keys.PlatformToken: keys.token_platform,
    keys.ServiceToken: keys.token_service,
    keys.LabelToken: keys.token_label,
}
EXPRESSIONS = ["acl/{}/**", "x/*/{}/**", "hb/*", "@df/v1/**", "q/**", "time/*", "*/df", "**", "acl/all/**"]


@given(KEYS)
def test_a_key_that_was_built_parses_back_to_what_built_it(key: str) -> None:
    parsed = keys.parse_key(key)
    assert parsed is not None
    assert BUILDERS[type(parsed)](*parsed) == key


@given(
    st.text(max_size=60)
    | st.lists(st.sampled_from(["acl", "x", "q", "hb", "df", "@df", "v1", "0", "all", "P", "", "*"]), max_size=8).map(
        "/".join
    )
)
def test_any_text_is_a_key_only_if_a_builder_makes_it(text: str) -> None:
    parsed = keys.parse_key(text)
    assert parsed is None or BUILDERS[type(parsed)](*parsed) == text


@given(KEYS)
def test_a_received_key_has_one_meaning(key: str) -> None:
    purposes = [keys.HEARTBEATS, keys.TOKENS, "acl/**", "x/**", "q/**", "time/*", "*/df"]
    assert sum(keys.matches(expr, key) for expr in purposes) == 1


@given(st.text(max_size=40) | UNITS | LABELS)
def test_names_are_refused_or_kept_as_they_are(name: str) -> None:
    for check, is_valid in [
        (keys.unit, schema.unit),
        (keys.label, schema.label),
        (keys.conversation, schema.identifier),
    ]:
        if is_valid(name):
            assert check(name) == name
        else:
            with pytest.raises(NameRefused):
                check(name)


def test_the_words_of_the_scheme_name_no_unit() -> None:
    for word in ["acl", "all", "df", "hb", "q", "time", "x"]:
        with pytest.raises(NameRefused, match="another"):
            keys.unit(word)


def test_keys_read_as_the_scheme_says() -> None:
    assert keys.act("0", "uav1", "interface") == "acl/0/uav1/interface"
    assert keys.act("all", "uav1", "alarms") == "acl/all/uav1/alarms"
    assert keys.stream("0", "heli-position", "ab12cd34") == "x/0/heli-position/ab12cd34"
    assert keys.token_label("a1", "0", "battery", "ab12cd34", 100_000) == "@df/v1/a1/0/L/battery/ab12cd34/100000"
    assert keys.describe("0") == "0/df"
    assert keys.namespace("default") == "dyknow/default"


@pytest.mark.parametrize("federation", ["", "a/b", "**", "A", "a b", "a" * 65, "a\n", "-a"])
def test_a_federation_that_could_reach_into_another_is_refused(federation: str) -> None:
    with pytest.raises(NameRefused):
        keys.namespace(federation)


@pytest.mark.parametrize(
    ("expr", "key", "delivered"),
    [
        ("acl/0/**", "acl/0/1/interface", True),
        ("acl/0/**", "acl/0", True),
        ("acl/0/**", "acl/00/1/interface", False),
        ("x/*/heli-position/ab12cd34", "x/7/heli-position/ab12cd34", True),
        ("x/*/heli-position/ab12cd34", "x/7/8/heli-position/ab12cd34", False),
        ("**", "@df/v1/a/0/P/uav/1", False),
        ("*/v1/**", "@df/v1/a/0/P/uav/1", False),
        ("@df/v1/**", "@df/v1/a/0/P/uav/1", True),
        ("@df/*/a/0/**", "@df/v1/a/0/P/uav/1", True),
        ("fed/**", "fed/0/@private/key", False),
        ("fed/**/@private/*", "fed/0/@private/key", True),
        ("**/b/**/c", "a/b/b/d/c", True),
        ("**/b/**/c", "a/b/b/d/e", False),
        ("acl/*/cc-$*/**", "acl/0/cc-4711/interface", True),
        ("acl/*/cc-$*/**", "acl/0/cd-4711/interface", False),
        ("a/*", "a", False),
        ("a/*", "a/b/c", False),
    ],
)
def test_matching_is_zenohs(expr: str, key: str, delivered: bool) -> None:
    assert keys.matches(expr, key) is delivered


def _reference(expr: str, key: str) -> bool:
    """Expression to regular expression, chunk by chunk."""
    chunk = r"[^/@][^/]*"
    pieces = {"*": f"/{chunk}", "**": f"(/{chunk})*"}
    pattern = "".join(pieces.get(part, "/" + re.escape(part)) for part in expr.split("/"))
    return re.fullmatch(pattern, "/" + key) is not None


@given(
    st.lists(st.sampled_from(["a", "b", "*", "**", "@c"]), min_size=1, max_size=5).filter(
        lambda parts: all(pair not in {("**", "**"), ("**", "*")} for pair in pairwise(parts))
    ),
    st.lists(st.sampled_from(["a", "b", "@c"]), min_size=1, max_size=6),
)
def test_matching_agrees_with_a_regular_expression(expr: list[str], key: list[str]) -> None:
    assert keys.matches("/".join(expr), "/".join(key)) == _reference("/".join(expr), "/".join(key))


@given(KEYS, st.sampled_from(EXPRESSIONS))
def test_zenoh_itself_agrees(key: str, expr: str) -> None:
    zenoh = pytest.importorskip("zenoh")
    written = expr.format("0")
    assert keys.matches(written, key) == zenoh.KeyExpr(written).includes(zenoh.KeyExpr(key))
