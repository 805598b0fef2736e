"""What commands print: colours, progress, results."""
