"""Commands that ask the federation's members: ls, query, watch, delegate, alarms, monitors, acts.

Each opens a connection, asks, prints and leaves. Platforms that do not answer are named.
"""
