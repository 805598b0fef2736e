"""The search for missing effects: candidate fits and the steps that add, swap and remove effects."""
