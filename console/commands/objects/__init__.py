"""Commands about objects and the roads on which they are.

`link` reads recorded percepts, `world` recorded observations, `roads` files of road networks: what they show is made in the
room `anchoring`. `objects` asks platforms.
"""
