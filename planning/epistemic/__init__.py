"""Actions in general, and plans over epistemic states: effects and observations of an action may depend on the
hypothesis.

An epistemic state is a world for each hypothesis that remains; the language is that which "Have another look", section 4.2, prints.
Problems in which only looks decide are planned faster by `planning/contingent`.
"""
