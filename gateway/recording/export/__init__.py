"""Recordings for people and other programs: their contents, tables, viewers, the bus."""
