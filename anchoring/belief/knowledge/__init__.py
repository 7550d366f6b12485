"""Prior knowledge: classes with their attributes and rules, and instances that are known from before.

It comes in bundles, which are loaded and unloaded by area and task. `informed` joins it with an environment model: it
completes, checks and repairs beliefs, and learns facts of lasting interest back.
"""
