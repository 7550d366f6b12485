"""The configuration of one platform process: its files, read, and its checks.

Files that it names are read once, here. Everything is validated before the process begins.
"""
