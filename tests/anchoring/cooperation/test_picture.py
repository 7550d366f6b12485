"""Cooperative anchoring: one name for one car at all members, through overlaps, gaps, splits, cuts and returns."""

import numpy as np

from dyknow.anchoring.cooperation.picture import NEW_US
from tests.anchoring.cooperation.skies import START_US, Sky, along

CAR, NEXT = along(0.0), along(25.0, 3.5)


def test_a_car_that_two_see_has_one_name_at_both_and_is_one_row() -> None:
    sky = Sky()
    sky.run(4, lambda t: {"0": {"co3": CAR(t)}, "1": {"co7": CAR(t)}})
    assert sky.name("co3", "0") == sky.name("co7", "1")
    for picture in sky.pictures.values():
        (row,) = picture.rows(sky.now_us)
        assert row.by == ("0", "1")
        assert abs(row.state.x_m - CAR(4)[0]) < 2.0


def test_two_cars_that_drive_near_each_other_are_two() -> None:
    sky = Sky()
    sky.run(6, lambda t: {"0": {"a": CAR(t), "b": NEXT(t)}, "1": {"c": CAR(t), "d": NEXT(t)}})
    assert sky.name("a", "0") == sky.name("c", "1") != sky.name("b", "0") == sky.name("d", "1")


def test_a_car_keeps_its_name_from_area_to_area_where_areas_overlap() -> None:
    sky = Sky("012")

    def seen(t):
        x_m = CAR(t)[0]
        return {
            unit: {f"co{unit}": CAR(t)} if west <= x_m <= west + 80 else {}
            for unit, west in (("0", 0.0), ("1", 50.0), ("2", 100.0))
        }

    sky.run(4, seen)
    first = sky.name("co0", "0")
    sky.run(8, seen)
    assert sky.names("co2", "2") == {first}


def test_a_car_keeps_its_name_over_a_gap_in_which_no_member_sees_it() -> None:
    sky = Sky()
    sky.run(4, lambda t: {"0": {"a": CAR(t)}, "1": {}})
    name = sky.name("a", "0")
    sky.run(5, lambda t: {"0": {}, "1": {"b": CAR(t)} if t > 6 else {}})
    assert sky.names("b", "1") == {name}
    assert "reacquired" in sky.kinds("1")


def test_where_two_cars_may_be_the_one_that_was_lost_neither_takes_its_name() -> None:
    sky = Sky()
    one, other = along(0.0, 1.0), along(0.0, -1.0)
    sky.run(4, lambda t: {"0": {"a": CAR(t)}, "1": {}})
    name = sky.name("a", "0")
    sky.run(9, lambda t: {"0": {}, "1": {"b": one(t), "c": other(t)} if t > 7 else {}})
    assert name not in sky.names("b", "1") | sky.names("c", "1")
    assert sky.names("b", "1") != sky.names("c", "1")


def test_what_was_taken_for_one_car_is_split_when_it_drives_apart_and_the_reason_is_given() -> None:
    sky = Sky()

    def turned(t):
        return CAR(t) if t < 5 else (CAR(5)[0], 8.0 * (t - 5), 0.0, 8.0)

    sky.run(5, lambda t: {"0": {"a": CAR(t)}, "1": {"b": CAR(t)}})
    name = sky.name("a", "0")
    sky.run(6, lambda t: {"0": {"a": CAR(t)}, "1": {"b": turned(t)}})
    assert sky.names("a", "0") != sky.names("b", "1")
    assert name in sky.names("a", "0") | sky.names("b", "1")
    (split,) = (event for event in sky.pictures["0"].recent if event.kind == "split")
    assert "d^2" in split.because


def test_where_one_mistakes_the_car_that_comes_for_the_one_that_leaves_both_keep_their_names() -> None:
    sky = Sky("12")

    def west(t):
        return (200.0 - 10.0 * t, 4.0, -10.0, 0.0)

    def seen(t):  # they meet at 100 m, where the area of 1 ends
        return {"1": {"a": CAR(t) if t < 10 else west(t)}, "2": {"c": CAR(t), "d": west(t)}}

    sky.run(9.8, seen)
    leaves, comes = sky.name("c", "2"), sky.name("d", "2")
    assert sky.names("a", "1") == {leaves}
    sky.run(8, seen)
    assert (sky.name("c", "2"), sky.name("d", "2")) == (leaves, comes)
    assert sky.names("a", "1") == {comes}
    (doubted,) = (event for event in sky.pictures["1"].recent if event.kind == "doubted")
    assert (doubted.name, doubted.by) == (leaves, "1")


def test_a_car_that_turns_as_fast_as_cars_do_is_not_doubted() -> None:
    sky = Sky("0")

    def circling(t):  # 10 m/s about a circle of 12 m: 8 m/s^2
        east, north = np.cos(10.0 / 12.0 * t), np.sin(10.0 / 12.0 * t)
        return (12.0 * east, 12.0 * north, -10.0 * north, 10.0 * east)

    sky.run(20, lambda t: {"0": {"a": circling(t)}})
    assert "doubted" not in sky.kinds()


def test_two_names_of_one_car_become_the_older_one_everywhere() -> None:
    sky = Sky()
    sky.wire.cut("1", sky.now_us)
    sky.run(4, lambda t: {"0": {"a": CAR(t)}, "1": {"b": CAR(t)} if t > 2 else {}})
    assert sky.pictures["0"].name_of("0", "a") != sky.pictures["1"].name_of("1", "b")
    sky.wire.heal("1", sky.now_us)
    sky.run(4, lambda t: {"0": {"a": CAR(t)}, "1": {"b": CAR(t)}})
    assert sky.name("a", "0") == sky.name("b", "1") == "car0_1"
    assert "renamed" in sky.kinds("1")
    for picture in sky.pictures.values():
        (row,) = picture.rows(sky.now_us)
        assert row.others == ("car1_1",)


def test_a_platform_that_leaves_and_returns_changes_no_name() -> None:
    sky = Sky("012")
    own = along(400.0)

    def seen(t):
        here = {"0": {"a": CAR(t)}, "1": {"b": CAR(t), "c": NEXT(t)}, "2": {"d": NEXT(t), "e": own(t)}}
        return here if not 5 < t < 15 else {**here, "2": {}}

    sky.run(5, seen)
    before = sky.name("a", "0"), sky.name("c", "1")
    for unit in "01":
        sky.pictures[unit].depart("2", sky.now_us)
    sky.run(10, seen)
    for unit in "01":
        sky.pictures[unit].arrive("2", sky.now_us, restarted=True)
    sky.run(5, lambda t: {**seen(t), "2": {"x": NEXT(t)}})
    assert (sky.name("a", "0"), sky.name("c", "1")) == before
    assert {"departed", "arrived"} <= {*sky.kinds("0")}
    assert sky.names("x", "2") == {before[1]}


def test_after_a_cut_a_car_that_both_sides_call_by_its_name_is_called_so_all_the_time() -> None:
    """1 sees it come while 2 is cut off, and takes it for what it is; 2 has had the name for longer."""
    sky = Sky("12")
    sky.run(5, lambda t: {"1": {}, "2": {"b": CAR(t)}})
    name = sky.name("b", "2")
    sky.wire.cut("2", sky.now_us)
    sky.run(5, lambda t: {"1": {"a": CAR(t)} if t > 7 else {}, "2": {"b": CAR(t)}})
    assert sky.pictures["1"].name_of("1", "a") == name
    sky.wire.heal("2", sky.now_us)
    for _ in range(20):
        sky.run(0.2, lambda t: {"1": {"a": CAR(t)}, "2": {"b": CAR(t)}})
        assert sky.names("a", "1") | sky.names("b", "2") <= {name, None}
    assert sky.name("a", "1") == sky.name("b", "2") == name


def test_what_only_a_member_sees_that_is_cut_off_is_kept_with_growing_uncertainty() -> None:
    sky = Sky()
    sky.run(4, lambda t: {"0": {}, "1": {"b": CAR(t)}})
    name = sky.name("b", "1")
    sky.wire.cut("1", sky.now_us)
    vague = []
    for _ in range(4):
        sky.run(4, lambda t: {"0": {}, "1": {"b": CAR(t)}})
        (row,) = sky.pictures["0"].rows(sky.now_us)
        assert row.name == name
        assert row.by == ()
        vague.append(row.state.deviation_m)
    assert vague == sorted(vague)
    assert vague[-1] > 2 * vague[0]


def test_a_name_waits_until_the_object_was_seen_for_a_second() -> None:
    sky = Sky("0")
    sky.run(NEW_US / 1e6 - 0.2, lambda t: {"0": {"a": CAR(t)}})
    assert sky.names("a", "0") == {None}


def test_pictures_do_not_depend_on_the_order_in_which_reports_come() -> None:
    names = []
    for order in (1, -1):
        sky = Sky()
        step = sky.wire.step
        sky.wire.step = lambda reports, now_us, step=step, order=order: step(  # type: ignore[method-assign]
            {unit: each[::order] for unit, each in reports.items()}, now_us
        )
        cars = [along(20.0 * number, 0.0) for number in range(5)]
        sky.run(4, lambda t, cars=cars: {"0": {f"a{n}": car(t) for n, car in enumerate(cars)}, "1": {}})
        names.append(len({*map(str, (sky.name(f"a{n}", "0") for n in range(5)))}))
    assert names == [5, 5]


def test_a_car_that_two_see_after_a_gap_is_the_one_that_was_lost() -> None:
    """They link nothing themselves, so that one member names the tracks of both: those are of one car, not rivals."""
    sky = Sky("01")
    sky.pictures["1"].name_for("2")

    def seen(t):
        there = {"a": CAR(t)} if t > 4.2 else {}
        return {"0": {"a": CAR(t)} if t <= 4 else {}, "1": there, "2": there}

    sky.run(4, seen)
    name = sky.name("a", "0")
    sky.wire.pictures["1"].arrive("2", sky.now_us)
    begin = len(sky.pictures["1"].recent)
    for _ in range(25):
        sky.run(0.2, seen)
        for report in sky.reports("2", seen((sky.now_us - START_US) / 1e6)["2"]):
            sky.pictures["1"].report(report, sky.now_us)
    assert sky.pictures["1"].name_of("1", "a") == sky.pictures["1"].name_of("2", "a") == name
    assert "appeared" not in {each.kind for each in [*sky.pictures["1"].recent][begin:]}


def test_what_may_be_a_car_that_is_about_to_be_lost_is_not_named_before_that() -> None:
    """Seen for a second elsewhere, and no longer where it was: that is known half a second later."""
    sky = Sky()
    sky.run(3, lambda t: {"0": {"a": CAR(t)}, "1": {}})
    name = sky.name("a", "0")
    sky.run(5, lambda t: {"0": {}, "1": {"b": CAR(t)} if t > 3.4 else {}})
    assert sky.names("b", "1") == {name}
    assert "appeared" not in {each.kind for each in sky.pictures["1"].recent if each.by == "1"}
