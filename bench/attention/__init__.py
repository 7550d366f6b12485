"""A camera that looks where attention says, and one that looks down: the same cars, vehicle and seeds for both."""
