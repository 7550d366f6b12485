"""When a stream satisfies a policy, by the constraints of the policy itself."""

from collections.abc import Iterable

from dyknow import Policy, Sample


def satisfied(policy: Policy, samples: Iterable[Sample]) -> bool:
    """Whether a stream, ordered by available time, satisfies every constraint (Def. 4.5.11)."""
    constraints = policy.named_constraints()
    last: Sample | None = None
    for sample in samples:
        if not all(accept(sample, last) for _, accept in constraints):
            return False
        last = sample
    return True
