"""dyknow as a library: `connect` asks a federation and delegates to it, `join` adds a platform to it.

Programs import both from `dyknow`. A thread of its own steps the member or the platform; the program gets results,
`Feed`s that are iterated, and errors of `dyknow.model.errors`.
"""
