"""Many platforms in one process on a fake clock and a fake wire, from one seed.

Loss, delay, duplication, reordering and partitions are drawn by chance. It runs faster than real time.
"""
