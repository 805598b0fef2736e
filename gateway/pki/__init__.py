"""The public key infrastructure of a site: its CA, the certificates it issues, and its revocation list (X.509, RFC 5280)."""
