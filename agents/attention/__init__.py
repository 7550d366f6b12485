"""What a platform does to learn more of the objects that it knows: where its camera looks, and what its vehicle follows.

Both are tasks that a user gives and ends. The camera is turned past the pilot, the vehicle is flown through it, under its rules.
"""
