"""The checker of annotations in tests: beartype with Python's own rule that an int will do for a float (PEP 484)."""

import beartype

checked = beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))
