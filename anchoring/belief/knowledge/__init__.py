"""Prior knowledge: classes with their attributes and rules, and instances that are known from before.

It comes in bundles, which are loaded and unloaded by area and task. `informed` joins it with an environment model: beliefs are
completed, checked and repaired by it, and what was of lasting interest is learnt back.
"""
