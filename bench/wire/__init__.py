"""Samples and acts between processes over Zenoh, next to raw zenoh-python."""
