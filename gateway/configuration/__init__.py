"""What the gateway is told: TOML file, environment, defaults."""
