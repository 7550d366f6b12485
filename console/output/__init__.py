"""Output for readers: tables, JSON lines, notes and errors.

Standard output is for results, standard error for everything else. With `--json` each result is one object a line.
"""
