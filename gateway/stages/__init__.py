"""The stages: small computations without side effects; time is an argument, and no stage imports another."""
