"""Streams at a cost: this platform's proposals for the calls of others, and its own calls. The protocol of a call is
`federation/calls/`. Offers and calls are declared in the specification, which `agents/specification/` runs.
"""
