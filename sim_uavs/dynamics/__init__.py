"""How a simulated vehicle moves, senses and fails: pure, stepped, seeded.

Routes, missions and scenarios are plain data. Faults change what sensors say or motors do.
"""
