"""The configuration: TOML file, environment and defaults."""
