"""The report of an incident: one page on what the recordings show, and the part of the recordings that it is made from."""
