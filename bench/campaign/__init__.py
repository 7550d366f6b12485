"""A campaign: flights in the simulated world that are drawn from seeds so that they meet, each judged by where the vehicles really were."""
