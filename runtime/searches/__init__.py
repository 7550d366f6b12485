"""Searches for plans, which may take long: each in a process of its own, next to the node.

`workers` begins, follows and ends them; `search` is what such a process runs. Their results are events of the platform.
"""
