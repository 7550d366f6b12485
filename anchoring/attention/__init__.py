"""Top-down attention: where a camera is to look next, given what is known of objects (thesis 8.5, 10.4).

Predicted places of objects that are not linked, descriptions of wanted ones, undecided types and an object to follow draw
the camera; ground that was not seen for long draws it a little. Pure: poses and objects in, a place to look at out.
"""
