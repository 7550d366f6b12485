"""The member that records a federation: it asks for every stream and subscribes to all that is reported.

Positions are drawn for Foxglove on the way. A sink takes the messages: a file of `dyknow.runtime.recordings`, or clients that watch live.
"""
