"""Cameras on vehicles: pinhole geometry, the pose of a camera on its mount, the ground that its rays meet.

Frames: NED metres about the platform's origin, body (forward, right, down), camera (right, down, ahead).
"""
