"""The ground below: elevation grids, what is read from their files, and how high a way is above the ground.

Heights are metres above mean sea level (the EGM96 geoid of these files), as all altitudes are.
"""
