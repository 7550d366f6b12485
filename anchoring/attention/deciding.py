"""Where a camera looks next: at the view from which most is to be learnt for the time it takes to turn there and see.

Every object has a need of being seen, 0 to 1: little for one that a percept shows; s^2 / (s^2 + S^2) for one that is
not linked, where s is how far its hypotheses and their errors spread, or will soon, so that it is looked at before it
is lost; more for new, wanted, undecided or followed objects. A view is worth the needs of all objects, each times the
weight of the hypotheses in the image, and a little for ground that was not seen for long. Where the camera has looked
and not found an object, its hypotheses weigh less for some seconds. The camera stays until it has settled, and turns
only for a view that is clearly worth more.
"""

from collections.abc import Sequence
from math import exp, hypot
from typing import Final, NamedTuple

import numpy as np

from dyknow import US_PER_S
from dyknow.anchoring.attention.ground import SearchedGround
from dyknow.anchoring.attention.view import TurnableCamera
from dyknow.anchoring.attention.watched import WatchedObject, WatchedPlace, spread_m
from dyknow.anchoring.roads.geometry import Point2
from dyknow.navigation.cameras.pinhole import FloatArray

MOST_OBJECTS: Final = 200
MOST_VIEWS: Final = 64
_OF_ONE, _OF_GROUND = 4, 12
_PLACES: Final = 16
"""The most probable hypotheses of an object; others do not count."""
_FARTHEST: Final = 1e7
"""Metres, and metres per second; a place or speed beyond it, or that is no number, is ignored."""
_MARGIN: Final = 0.85
"""Share of the image, from its middle, in which something is counted on to be found."""


class AttentionSettings(NamedTuple):
    """Weights and times by which views are compared.

    Attributes:
        sees_s: how long the camera looks at a place to find what is there.
        settles_s: it stays for so long after it has turned.
        better: it turns for a view that is worth this many times as much.
        spread_m: an object that is spread so far has half the need of one that is lost.
        shown: the need of an object that a percept shows.
        ahead: the weight of a spread in the near future next to the present one, so that crossings are looked at in
            time.
        followed, wanted, undecided: how much more these need than others.
        ground: the worth of a place on the ground that was never seen; `searched` while something wanted may be anywhere.
        missed_s, forgives_s: time constants: of finding what is in view, and of forgetting that it was not found.
    """

    sees_s: float = 0.5
    settles_s: float = 0.4
    better: float = 1.25
    spread_m: float = 8.0
    shown: float = 0.05
    ahead: float = 0.5
    followed: float = 6.0
    wanted: float = 3.0
    undecided: float = 1.5
    ground: float = 0.01
    searched: float = 0.1
    missed_s: float = 0.6
    forgives_s: float = 8.0


USUAL: Final = AttentionSettings()


class Gaze(NamedTuple):
    """Where to look, and why.

    Attributes:
        symbol: of the object that is looked at, or for; empty where ground is searched.
        worth: of the view, by the second.
    """

    x_m: float
    y_m: float
    symbol: str
    because: str
    worth: float


class _View(NamedTuple):
    """A place that can be looked at, moving or not, for one object or for none."""

    place: WatchedPlace
    one: WatchedObject | None
    number: int = 0


class _Missed(NamedTuple):
    """For how long a place was in view where an object was not found."""

    x_m: float
    y_m: float
    seconds: float


class Attention:
    """Decides for one camera, a few times a second; `looks` has its present decision.

    Args:
        ground: places to search, metres east and north.
    """

    def __init__(self, ground: Sequence[Point2] = (), settings: AttentionSettings = USUAL) -> None:
        self._ground, self._settings = SearchedGround(ground), settings
        self._missed: dict[str, list[_Missed]] = {}
        self._looked_s: dict[str, float] = {}
        self._now_us: int | None = None
        self._until_us = 0
        self._view: _View | None = None
        self.looks: Gaze | None = None

    def search(self, ground: Sequence[Point2]) -> None:
        """Search other places from now on."""
        self._ground = SearchedGround(ground)
        if self._view is not None and self._view.one is None:
            self._view = self.looks = None

    def decide(self, now_us: int, camera: TurnableCamera, objects: Sequence[WatchedObject]) -> Gaze | None:
        """Where to look now; None: there is nothing to look at, nor ground to search.

        Args:
            now_us: valid time of the camera and the objects.
            camera: as it is now.
            objects: all known ones; of more than `MOST_OBJECTS`, those that were not seen for longest are looked at.
                Places that are no numbers are left out.
        """
        objects = sorted(objects, key=lambda each: (each.interest != "followed", each.seen_us, each.symbol))
        objects = [each._replace(places=_finite(each.places)) for each in objects[:MOST_OBJECTS]]
        self._remember(now_us, camera, objects)
        views = self._views(now_us, camera, objects)
        if not views:
            self._view = self.looks = None
            return None
        worth, places = self._worth(now_us, camera, objects, views)
        best = int(np.argmax(worth))
        if views[0] is self._view and (now_us < self._until_us or worth[best] < self._settings.better * worth[0]):
            best = 0
        else:
            turns_s = camera.turns_s(camera.aim(*places[best]))
            self._until_us = now_us + round((turns_s + self._settings.settles_s) * US_PER_S)
        self._view = views[best]
        self.looks = Gaze(*places[best], *_said(views[best], now_us), float(worth[best]))
        return self.looks

    # Objects in view, seen or overlooked

    def _remember(self, now_us: int, camera: TurnableCamera, objects: Sequence[WatchedObject]) -> None:
        """Note the ground and the objects in view, and the objects in view that no percept shows."""
        seconds = 0.0 if self._now_us is None else min(max(now_us - self._now_us, 0) / US_PER_S, 1.0)
        self._now_us = now_us
        looks_at = [camera.pose.mount]
        self._ground.on_view(now_us, camera.sees(looks_at, self._ground.x_m, self._ground.y_m)[0])
        missed, looked_s = {}, {}
        for one in objects:
            if not one.places:
                continue
            x_m, y_m = (np.array([each[axis] for each in one.places]) for axis in (0, 1))
            in_view = camera.sees(looks_at, x_m, y_m, margin=_MARGIN)[0]
            if one.is_anchored:
                looked_s[one.symbol] = self._looked_s.get(one.symbol, 0.0) + seconds * in_view[0]
            else:
                before = self._missed.get(one.symbol, [])
                missed[one.symbol] = [
                    _Missed(place.x_m, place.y_m, self._of_place(before, place, seconds, found))
                    for place, found in zip(one.places, in_view.tolist(), strict=True)
                ]
                looked_s[one.symbol] = self._looked_s.get(one.symbol, 0.0)
        self._missed, self._looked_s = missed, looked_s

    def _of_place(self, before: Sequence[_Missed], place: WatchedPlace, seconds: float, in_view: float) -> float:
        """A hypothesis continues the one that was nearest to it."""
        nearest = min(before, key=lambda each: hypot(each.x_m - place.x_m, each.y_m - place.y_m), default=None)
        kept_s = 0.0 if nearest is None else nearest.seconds * exp(-seconds / self._settings.forgives_s)
        return kept_s + seconds * in_view

    def _need(self, one: WatchedObject) -> float:
        settings = self._settings
        if one.is_anchored:
            looked_s = self._looked_s.get(one.symbol, 0.0)
            match one.interest:
                case "followed":
                    return settings.followed
                case "new":
                    return exp(-looked_s / 3.0)
                case "undecided":
                    return max(settings.shown, exp(-looked_s / 5.0))
                case _:
                    return settings.shown
        factor = {"followed": settings.followed, "wanted": settings.wanted, "undecided": settings.undecided}
        need = 1.0 if one.interest == "wanted" else self._lost(max(spread_m(one.places), settings.ahead * one.ahead_m))
        return need * factor.get(one.interest, 1.0)

    def _lost(self, spread_m: float) -> float:
        """0 to 1: how much of its place is lost of an object that is spread so far."""
        square = (spread_m / self._settings.spread_m) ** 2
        return square / (square + 1.0)

    # Views

    def _views(self, now_us: int, camera: TurnableCamera, objects: Sequence[WatchedObject]) -> list[_View]:
        """The candidate views, the present one first."""
        views = [
            _View(place, one, number)
            for one in objects
            for number, place in enumerate(one.places[:_OF_ONE])
            if self._is_near(camera, place)
        ]
        views.sort(key=lambda each: -each.place.weight * (0.0 if each.one is None else self._need(each.one)))
        near = self._ground_near(camera)
        ground = self._ground.stalest(now_us, _OF_GROUND, near)
        views = [*views[: MOST_VIEWS - _OF_GROUND], *(_View(WatchedPlace(x_m, y_m), None) for x_m, y_m in ground)]
        if self._view is not None and (present := _same(self._view, views)) is not None:
            views = [present, *(each for each in views if each is not present)]
            self._view = present
        return views

    def _is_near(self, camera: TurnableCamera, place: WatchedPlace) -> bool:
        north_m, east_m, down_m = camera.pose.position_m.tolist()
        return hypot(place.y_m - north_m, place.x_m - east_m, camera.ground_m - down_m) <= camera.reach_m

    def _ground_near(self, camera: TurnableCamera) -> FloatArray:
        north_m, east_m, down_m = camera.pose.position_m.tolist()
        above_m = camera.ground_m - down_m
        away = (self._ground.x_m - east_m) ** 2 + (self._ground.y_m - north_m) ** 2 + above_m * above_m
        near: FloatArray = (away <= camera.reach_m**2).astype(np.float64)
        return near

    def _worth(
        self, now_us: int, camera: TurnableCamera, objects: Sequence[WatchedObject], views: Sequence[_View]
    ) -> tuple[FloatArray, list[Point2]]:
        """(M,) the worth of each view by the second, and where it looks when the mount has turned."""
        settings = self._settings
        first_s = np.array([camera.turns_s(camera.aim(each.place.x_m, each.place.y_m)) for each in views])
        places = [
            (each.place.x_m + lead * each.place.vx_m_s, each.place.y_m + lead * each.place.vy_m_s)
            for each, lead in zip(views, first_s.tolist(), strict=True)
        ]
        angles = [camera.aim(*place) for place in places]
        x_m, y_m, vx_m_s, vy_m_s, weights = self._samples(objects)
        leads = first_s[:, None]
        seen = camera.sees(angles, x_m + leads * vx_m_s, y_m + leads * vy_m_s, margin=_MARGIN)
        anywhere = any(each.interest == "wanted" and not each.places for each in objects)
        ground = camera.sees(angles, self._ground.x_m, self._ground.y_m) @ self._ground.staleness(now_us)
        total = seen @ weights + (settings.searched if anywhere else settings.ground) * ground
        worth: FloatArray = total / (first_s + settings.sees_s)
        return worth, places

    def _samples(self, objects: Sequence[WatchedObject]) -> FloatArray:
        """(5, N): x, y, vx, vy and worth of samples of all hypotheses, three along the velocity of each that is spread."""
        samples = [(0.0, 0.0, 0.0, 0.0, 0.0)]
        for one in objects:
            need, missed = self._need(one), self._missed.get(one.symbol)
            for number, place in enumerate(one.places):
                seconds = 0.0 if missed is None else missed[number].seconds
                weight = need * place.weight * exp(-seconds / self._settings.missed_s)
                speed = hypot(place.vx_m_s, place.vy_m_s)
                for along, share in ((-1.0, 0.25), (0.0, 0.5), (1.0, 0.25)):
                    off = along * place.sd_m / speed if speed > 1.0 else 0.0
                    samples.append((
                        place.x_m + off * place.vx_m_s, place.y_m + off * place.vy_m_s,
                        place.vx_m_s, place.vy_m_s, share * weight,
                    ))  # fmt: skip
        return np.array(samples).T


def _finite(places: Sequence[WatchedPlace]) -> tuple[WatchedPlace, ...]:
    return tuple(each for each in places[:_PLACES] if all(abs(value) < _FARTHEST for value in each))


def _same(before: _View, views: Sequence[_View]) -> _View | None:
    """The view that continues one before: of the same object the nearest place; ground stays."""
    if before.one is None:
        return before
    same = [each for each in views if each.one is not None and each.one.symbol == before.one.symbol]
    return min(
        same,
        key=lambda each: hypot(each.place.x_m - before.place.x_m, each.place.y_m - before.place.y_m),
        default=None,
    )


def _said(view: _View, now_us: int) -> tuple[str, str]:
    """The symbol, and the reason in words."""
    one = view.one
    if one is None:
        return "", "searches ground that was not seen for long"
    since_s = (now_us - one.seen_us) / US_PER_S
    where = (
        "" if len(one.places) < 2 else f", place {view.number + 1} of {len(one.places)}, weight {view.place.weight:.2f}"
    )
    match one.interest:
        case "wanted":
            return one.symbol, f"looks for {one.symbol}, which is wanted{where}"
        case "followed" if one.is_anchored:
            return one.symbol, f"follows {one.symbol}"
        case "new" | "undecided" if one.is_anchored:
            what = "no object yet" if one.interest == "new" else "of no type yet"
            return one.symbol, f"looks at {one.symbol}, which is {what}"
        case _ if one.is_anchored:
            return one.symbol, f"looks at {one.symbol}"
        case _:
            return one.symbol, f"looks for {one.symbol}, not seen for {since_s:.1f} s{where}"
