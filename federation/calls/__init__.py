"""Calls for streams that are offered at a cost: which proposal is taken, and what is done when it fails.
A call is a value that a platform and a command centre step alike.
What is proposed and promised on the other side is `agents/calls/`.
"""
