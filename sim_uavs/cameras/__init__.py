"""A colour and a thermal camera on a pan-tilt mount of a simulated UAV, over simulated roads and boxes.

Their detections are noisy, now and then wrong or missing, hidden by obstacles. Put on the ground, fused and tracked it
is a stream of percepts, in whose place the percepts of a real detector can be.
"""
