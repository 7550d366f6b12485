"""What stands in for the world in tests: time that moves when the test says so."""


class FakeClock:
    """A node clock. Pass `clock.now_us` where a function is wanted, or `clock.now_us()` where an instant is."""

    def __init__(self, now_us: int = 0) -> None:
        self._now_us = now_us

    def now_us(self) -> int:
        return self._now_us

    def advance_us(self, duration_us: int) -> int:
        """Let time pass; the new instant."""
        if duration_us < 0:
            raise ValueError(f"time cannot go back, got {duration_us} us")
        self._now_us += duration_us
        return self._now_us

    def advance_s(self, seconds: float) -> int:
        """Let time pass; the new instant."""
        return self.advance_us(round(seconds * 1e6))
