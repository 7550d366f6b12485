"""The cameras of a platform's vehicle: where they look, and what of their images becomes percepts.

Detections come as reports of the vehicle; the state of the cameras comes from the platform's own fused position, so
that both can be replayed. Percepts are streams, offered to the federation like any other.
"""
