"""The daemon, the only package with threads, sockets and clocks."""
