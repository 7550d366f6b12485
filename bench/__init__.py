"""Figures the project claims, each measured next to its peer or its limit."""
