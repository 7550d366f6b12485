"""Attention of a platform to the objects that it knows: where its camera looks, and which object its vehicle follows.

Both are tasks that a user gives and ends. The camera is turned past the pilot, the vehicle is flown through it, under its rules.
"""
