"""The node's clock: UTC when the process started, monotonic from then on, so that time never jumps or goes back."""

import time


class NodeClock:
    """Microseconds since the Unix epoch.

    Args:
        skew_us: how wrong the clock is to be; for tests of what a federation does about wrong clocks.
    """

    def __init__(self, skew_us: int = 0) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns() + skew_us * 1000

    @property
    def monotonic_offset_us(self) -> int:
        """This clock minus the monotonic clock of the machine."""
        return self._offset_ns // 1000

    def now_us(self) -> int:
        return (time.monotonic_ns() + self._offset_ns) // 1000
