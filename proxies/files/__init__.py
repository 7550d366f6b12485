"""Files that users name, opened: only what is a file, a text within a limit, and other files that a text names.

Whatever reads a file from anyone opens it here. Lines of a pipe come as they are written, and a file that is watched is compared.
"""
