"""Object linkage on road scenes, next to a tracker and to a new object per percept; scored by py-motmetrics."""
