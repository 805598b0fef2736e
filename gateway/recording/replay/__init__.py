"""The results of a recording, computed again and compared."""
