"""Persons on a field, and things that look like them to a thermal or to a colour camera.

Where they lie, and how much they look like persons, follows from the seed, so that every process has the same ones.
Their detections have a score in each channel.
"""
