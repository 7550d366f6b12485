"""Formats of others, and the sockets through which they leave."""
