"""Zenoh: the session, the keys, what is published and what is answered."""
