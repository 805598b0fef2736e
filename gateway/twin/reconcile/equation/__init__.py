"""The law of what no effect of the vocabulary explains: sparse regression over a library of physically typed terms."""
