"""Streams, policies and hosts on one machine: the experiments of thesis section 5.5 and what came after."""
