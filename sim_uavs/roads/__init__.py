"""Cars, trucks and motorcycles on a small road network, from one seed, and what a camera's tracker would make of them.

Stepped with time as an argument. Frame: x east, y north, metres; headings in radians from x to y; traffic keeps right.
"""
