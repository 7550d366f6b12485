"""What a platform keeps of what it learns, in files.

One file for each stream of beliefs, read when the platform starts.
What is in them is read by the platform itself.
"""
