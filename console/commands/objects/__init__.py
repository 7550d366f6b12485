"""Commands about objects and the roads on which they are.

`link` reads recorded percepts, `world` recorded observations, `roads` files of road networks; the room `anchoring`
computes their results. `objects` asks platforms.
"""
