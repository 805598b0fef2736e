"""The commands for a gateway on this machine: run, configuration, setup, keys."""
