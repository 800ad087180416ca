"""`diff3ds text` and `diff3ds image`: a phrase or a picture to a sketch, by score distillation."""
