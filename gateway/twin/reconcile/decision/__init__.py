"""From validated candidate fits to one verdict."""
