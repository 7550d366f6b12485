"""Encounters of real autopilots: ArduCopter in the loop, one platform each, and what they really did."""
