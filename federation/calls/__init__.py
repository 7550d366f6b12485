"""Calls for streams that are offered at a cost: the choice of a proposal, and the next one when it fails. A call is a
value that a platform and a command centre step alike; the platforms that propose have `agents/capabilities/calls/`.
"""
