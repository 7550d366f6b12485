"""What people want to know of a platform's live streams while it happens: formulas and chronicles. Node clock."""

from agents.checks import Checks
from agents.context import Context
from agents.recognitions import Recognitions
from dyknow import earlier
from kpl import Instance


class Inquiries:
    """All of one platform."""

    def __init__(self, context: Context, instance: Instance) -> None:
        self.checks, self.recognitions = Checks(context, instance), Recognitions(context)

    @property
    def deadline_us(self) -> int | None:
        """When `on_time` has work next."""
        return earlier(self.checks.deadline_us, self.recognitions.deadline_us)

    def on_time(self, now_us: int) -> None:
        """Say what was decided, and what is over."""
        self.checks.on_time(now_us)
        self.recognitions.on_time(now_us)

    def cancel(self, conversation: str, by: str) -> bool:
        """Whoever asked does not want to know any more; whether there was such an inquiry."""
        return self.checks.cancel(conversation, by) or self.recognitions.cancel(conversation, by)
