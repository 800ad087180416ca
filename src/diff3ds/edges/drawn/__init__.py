"""Lines as people draw them: long ones, that end where others begin, and none that pictures full of texture made up."""
