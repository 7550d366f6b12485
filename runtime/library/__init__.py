"""dyknow as a library: `connect` asks a federation and delegates to it, `join` adds a platform to it.

Programs import both from `dyknow`. A thread of its own steps the member or the platform; what it learns comes back as
results, as `Feed`s that are iterated, and as errors of `dyknow.model.errors`.
"""
