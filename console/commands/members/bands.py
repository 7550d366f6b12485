"""`dyknow bands`: when a vehicle loses well clear of others, and which tracks, speeds and altitudes would lose it."""

from collections.abc import Sequence
from typing import Annotated, Any

import typer

from dyknow.console.centre.client import connected, note_unreached
from dyknow.console.command import Call, command
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import unit_json
from dyknow.console.output.shown import Shown, styled
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.model.instants import print_span
from dyknow.reasoning.features.bands import ConflictBand
from dyknow.runtime.library.pictures import bands as pictures
from dyknow.runtime.library.pictures.bands import BandsPicture, ClearanceRow

AGAIN_S = 1.0
SOON_S = 10.0


@command(example="dyknow bands --unit 0 --follow")
def bands(
    call: Call,
    *,
    unit: Annotated[str, typer.Option(metavar="U", help="The platform whose vehicle it is about.")],
    lookahead: Annotated[
        str, typer.Option(metavar="TIME", help="How far ahead a loss of well clear to members is looked for.")
    ] = "30s",
    profile: Annotated[
        str, typer.Option(metavar="NAME", help="The ready profile whose thresholds are kept to members.")
    ] = pictures.PROFILE,
    follow: Annotated[bool, typer.Option("--follow", "-f", help="Again every second, until Ctrl-C.")] = False,
    count: Annotated[int | None, typer.Option(metavar="K", min=1, help="With --follow: stop after K times.")] = None,
) -> int:
    """When a vehicle loses well clear of each other one, and which tracks, speeds and altitudes would lose it.

    All fly straight on from where they are; well clear is lost as NASA DAIDALUS defines it. Positions older than 3 s are
    unknown, and in no band. Exit 1 if the vehicle's own motion is unknown.
    """
    lookahead_s = duration_us(lookahead, option="--lookahead", least_us=SHORTEST_US) / 1e6
    pictures.goal_of(profile, lookahead_s)  # before platforms are asked
    times = (count or 0) if follow else 1
    shown = 0
    with connected(call) as client:
        while True:
            picture = client.run(pictures.bands(client, unit, profile, lookahead_s))
            if follow:
                call.out.clear()
            _show(call, picture)
            shown += 1
            if shown == times:
                note_unreached(call, client)
                return NO if picture.why else DONE
            client.wait_for(lambda: False, AGAIN_S)


def _show(call: Call, picture: BandsPicture) -> None:
    if call.out.json_lines:
        call.out.line(_json(picture))
        return
    if picture.why:
        call.out.show(styled(picture.unit, "bold"), "  ", styled(f"unknown: {picture.why}", "red"))
    elif not picture.others:
        call.out.note("no other vehicle is there.")
    if picture.others:
        headings = ("unit", "well clear", "apart", "above", "closest approach", "age")
        call.out.table("", headings, [_row(row) for row in picture.others], right=("apart", "above", "age"))
    if not picture.why:
        call.out.table(
            "", (picture.unit, "now", "loses well clear", "of"), _band_rows(picture), wraps=("loses well clear",)
        )
    unknown = [row.unit for row in picture.others if row.is_clear is None]
    if unknown and not picture.why:
        call.out.note(f"the bands are without {', '.join(unknown)}, where that is not known.", style="yellow")


def _json(picture: BandsPicture) -> dict[str, Any]:
    record = picture.as_json()
    others = [row | {"unit": unit_json(row["unit"])} for row in record["others"]]
    return record | {"unit": unit_json(picture.unit), "others": others}


def _row(row: ClearanceRow) -> tuple[Shown, ...]:
    if row.is_clear is None:
        return row.unit, styled(f"unknown: {row.why}", "yellow"), "", "", "", ""
    if row.is_clear:
        kept: Shown = styled("clear", "green")
    elif not row.loses_in_s:
        kept = styled("lost", "red")
    else:
        kept = styled(f"lost in {row.loses_in_s:.1f} s", "red" if row.loses_in_s < SOON_S else "yellow")
    when = f"in {row.passes_in_s:.1f} s: " if row.passes_in_s else "now: "
    return (
        row.unit, kept, f"{row.apart_m:.0f} m", _signed(row.above_m),
        f"{when}{row.passes_m:.0f} m, {_signed(row.passes_above_m)}", print_span(row.age_us or 0),
    )  # fmt: skip


def _band_rows(picture: BandsPicture) -> list[tuple[Shown, ...]]:
    """The three bands: the own value, what loses well clear, what was tried."""
    track = "hovers" if picture.track_deg is None else f"{round(picture.track_deg) % 360} deg"
    rows: list[tuple[Shown, ...]] = [
        ("track", track, _lost(picture.tracks, "deg"), f"all, at {picture.tried_at_m_s:.1f} m/s")
    ]
    if picture.speeds:
        rows.append(
            ("speed", f"{picture.speed_m_s:.1f} m/s", _lost(picture.speeds, "m/s", 1), _span(picture.speeds, "m/s"))
        )
    rows.append(
        ("altitude", f"{picture.altitude_m:.0f} m", _lost(picture.altitudes, "m"), _span(picture.altitudes, "m"))
    )
    return rows


def _lost(found: Sequence[ConflictBand], unit: str, decimals: int = 0) -> Shown:
    lost = [(band.low, band.high) for band in found if not band.is_clear]
    if not lost:
        return styled("none", "green")
    if len(lost) == len(found):
        return styled("all", "red")
    if unit == "deg" and lost[0][0] == 0.0 and lost[-1][1] == 360.0:
        lost = [(lost[-1][0], lost[0][1]), *lost[1:-1]]
    return styled(", ".join(f"{low:.{decimals}f} to {high:.{decimals}f}" for low, high in lost) + f" {unit}", "yellow")


def _span(found: Sequence[ConflictBand], unit: str) -> str:
    return f"{found[0].low:.0f} to {found[-1].high:.0f} {unit}"


def _signed(metres: float | None) -> str:
    return f"{round(metres or 0.0):+d} m"
