"""Feeds hand items from the node thread to a program that iterates, with or without an event loop."""

import asyncio
import threading

import pytest

from dyknow import FederationFailed
from dyknow.runtime.library.feed import CAPACITY, Feed


def test_items_come_in_their_order_and_the_iteration_ends_with_the_feed() -> None:
    feed: Feed[int] = Feed()
    posting = threading.Thread(target=lambda: [*map(feed.put, range(100)), feed.close()])
    posting.start()
    assert list(feed) == list(range(100))
    posting.join()
    feed.put(1)
    assert feed.get() is None, "what is closed takes nothing"


def test_an_error_comes_after_what_is_left() -> None:
    feed: Feed[int] = Feed()
    feed.put(1)
    feed.close(FederationFailed("all gone"))
    assert next(feed) == 1
    with pytest.raises(FederationFailed, match="all gone"):
        next(feed)


def test_the_oldest_give_way_and_are_counted() -> None:
    feed: Feed[int] = Feed()
    for number in range(CAPACITY + 3):
        feed.put(number)
    assert (feed.get(), feed.dropped) == (3, 3)


def test_nothing_within_the_time_is_none() -> None:
    feed: Feed[int] = Feed()
    assert feed.get(0) is None
    feed.put(7)
    assert feed.get(0) == 7


def test_an_event_loop_waits_without_standing_still() -> None:
    async def main() -> list[int]:
        feed: Feed[int] = Feed()
        found: list[int] = []

        async def take() -> None:
            found.extend([item async for item in feed])

        task = asyncio.create_task(take())
        await asyncio.sleep(0)
        threading.Thread(target=lambda: [feed.put(1), feed.put(2), feed.close()]).start()
        await asyncio.wait_for(task, 5)
        return found

    assert asyncio.run(main()) == [1, 2]


def test_no_value_is_an_item_like_another() -> None:
    feed: Feed[int] = Feed()
    feed.put(0)
    feed.close()
    assert list(feed) == [0]
