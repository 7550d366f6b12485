"""The vehicle of a platform: its streams, its pilot, and giving way to others (thesis 9.4.1).

Orders go to the vehicle from here alone, within the limits of the pilot. Which of two climbs is agreed by speech acts between the two platforms concerned.
"""
