"""Cars, trucks and motorcycles on a small road network, from one seed, and their percepts as from a camera's tracker.

Stepped with time as an argument. Frame: x east, y north, metres; headings in radians from x to y; traffic keeps right.
"""
