"""Recordings for other programs: tables, viewers, the bus."""
