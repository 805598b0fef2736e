"""The chain of signed segments: statements, keys and their verification."""
