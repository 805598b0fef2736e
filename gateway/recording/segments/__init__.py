"""The segments of a recorder: written, compacted, trimmed, deleted, recovered."""
