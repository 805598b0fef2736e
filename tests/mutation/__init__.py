"""Mutation tests: each equation of docs/reference/equations.md is broken in two ways, and the test that it names must fail."""
