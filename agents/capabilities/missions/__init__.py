"""Missions: goals and plans that are delegated, searched for, flown by several vehicles, and watched while they are.

The part `Missions` takes them on and leads them; `Performing` lends the platform's own vehicle to a mission. Decisions
of a mission are made in `planning`; here commands become orders to the pilot, and are done when the vehicle shows it.
"""
