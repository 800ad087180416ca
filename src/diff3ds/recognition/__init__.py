"""What a picture shows: kind, attributes and pose."""
