"""Several platforms, one picture: identities over platforms, partitions, and manoeuvres that no platform sees whole."""
