"""Two questions at once, and a stream next to them, in an event loop."""

import asyncio

import dyknow


async def main() -> None:
    async with dyknow.connect() as fed:
        positions, heights = await asyncio.gather(fed.query("heli-position"), fed.query("heli-altitude"))
        print(len(positions), "positions", len(heights), "heights")
        with await fed.watch("heli-velocity", every="100ms") as samples:
            async for sample in samples:
                print(sample.unit, sample.value)
                break


asyncio.run(main())
