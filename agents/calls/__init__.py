"""Streams at a cost: what this platform proposes for the calls of others, and its own calls.
The protocol of a call is `federation/calls/`.
What is offered and called for is declared in the specification, which `agents/specification/` runs.
"""
