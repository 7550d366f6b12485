"""The Zenoh session: the only modules that import zenoh.

Callbacks stamp, post and return; a session can be replaced without stopping the node. Its configuration is computed by a pure function.
"""
