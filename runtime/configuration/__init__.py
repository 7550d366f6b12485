"""The configuration of one platform process: what a command hands over, and what it comes to.

Files that it names are read once, here. Everything is validated before the process begins.
"""
