"""Areas divided among platforms by ask and tell (thesis 9.2.3).
The leader collects what each platform can do, divides, and informs; each platform has its piece as a stream.
The geometry is `navigation/areas.py`.
"""
