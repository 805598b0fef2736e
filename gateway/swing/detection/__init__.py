"""Windows without a swing, and axes without a signal."""
