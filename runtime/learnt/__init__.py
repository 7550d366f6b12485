"""Learnt knowledge of a platform, in files.

One file for each stream of beliefs, read when the platform starts. The platform itself reads their contents.
"""
