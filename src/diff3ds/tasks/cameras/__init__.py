"""`diff3ds cameras`: where photographs were taken from."""
