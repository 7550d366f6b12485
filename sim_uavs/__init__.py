"""Simulated UAVs: how they fly, the autopilot they carry, and a world of many platforms.

Everything but the autopilot's socket is pure and stepped by time. One seed gives one history.
"""
