"""Geodesy, vehicle reports and orders, and the filter that fuses reports to positions."""

from dyknow.navigation.geodesy import LocalFrame, distance_m

__all__ = ["LocalFrame", "distance_m"]
