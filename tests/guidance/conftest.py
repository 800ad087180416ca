"""Settings of all tests with diffusion models: nothing is looked for on the network."""

import os

os.environ["HF_HUB_OFFLINE"] = "1"
