"""Missions: goals and plans that are delegated, searched for, flown by several vehicles, and watched while they are.

The part `Missions` takes them on and leads them; `Performing` lends the platform's own vehicle to a mission.
What a mission does is decided in `planning`; how a command becomes orders to the pilot, and what shows that it is done, is here.
"""
