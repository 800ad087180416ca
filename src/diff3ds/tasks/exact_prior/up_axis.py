"""What a user says of a folder of sketches and meshes."""

from typing import Literal

# The axis of meshes that points up.
Up = Literal["z", "y"]
