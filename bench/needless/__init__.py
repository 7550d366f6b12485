"""Flights in which vehicles pass each other at a harmless distance: how often they make way for each other all the same."""
