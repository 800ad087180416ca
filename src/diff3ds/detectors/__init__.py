"""Networks that find edges in photographs."""
