"""Where something that was dropped can lie, and how a camera looks for it there.

A prior follows from height, speed, wind and ground; places to look from follow the prior, from its middle outwards. Looks come
in, a place comes out, or that all of it was looked at in vain.
"""
